"""Which of the frames that sensors recorded show the calibration box, which the person, and which neither."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from capture.calibration.box import check_size
from capture.errors import CalibrationError, RecordingError

Span = tuple[float, float]
"""First and last second, on the recording's clock."""


@dataclass(frozen=True)
class ShownBox:
    """The calibration box in what is recorded.

    Attributes:
        size_m: its sides (m).
        seconds: when it stands there, and nobody else does: frames of this time show the box.
        paths: files or folders of the box alone, one a sensor, of the same cameras, instead.

    Raises:
        RecordingError: neither is told, or both; or the sides cannot be told apart.
    """

    size_m: tuple[float, float, float]
    seconds: Span | None = None
    paths: tuple[Path, ...] = ()

    def __post_init__(self) -> None:
        if (self.seconds is None) == (not self.paths):
            raise RecordingError(
                "of the box its size is stated, so either when it is shown or files of it must be, too",
                remedy="state --box-seconds FROM TO, or --box-source once for each sensor",
            )
        try:
            check_size(self.size_m)
        except CalibrationError as error:
            raise RecordingError(error.problem, remedy=error.remedy) from error


@dataclass(frozen=True)
class Parts:
    """What becomes of the frames at a time: the box's while it is shown, the person's else, or left out."""

    box: Span | None = None
    person: Span | None = None

    def of(self, time_s: float) -> Literal["box", "person", "neither"]:
        """Whose a frame at this time of the recording is."""
        if self.box is not None and self.box[0] <= time_s <= self.box[1]:
            return "box"
        if self.person is None or self.person[0] <= time_s <= self.person[1]:
            return "person"
        return "neither"
