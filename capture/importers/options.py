"""What may be asked of an import: of the cameras, of the clocks, and of which frames become what."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from capture.importers.source import UserCamera
from capture.importers.time_ranges import ShownBox, Span

NOTHING_STATED = UserCamera()


@dataclass(frozen=True)
class ImportOptions:
    """What is asked of an import.

    Attributes:
        cameras: what the user states of the cameras: of all alike, or of each.
        format_name: what the files are, if not to be found out.
        sensor_names: the sensors' names [``sensor``, or ``sensor-1``, ``sensor-2``, ...].
        offset: of several sensors, by how much the first depth frame of each comes after that of the one before (s);
            or ``motion``, to find it by what moves; or ``clock``, if their files were written by one clock.
        box: which frames show the calibration box; they are kept apart from the others.
        seconds: keep only what was recorded in this time, and the box's frames.
        overwrite: replace a recording that stands there already.

    >>> ImportOptions(cameras=UserCamera(fx=580.0), sensor_names=("left", "right")).camera_of_each(2)[1].fx
    580.0
    """

    cameras: UserCamera | Sequence[UserCamera] = NOTHING_STATED
    format_name: str | None = None
    sensor_names: Sequence[str] = ()
    offset: Literal["motion", "clock"] | float = "motion"
    box: ShownBox | None = None
    seconds: Span | None = None
    overwrite: bool = False

    def camera_of_each(self, count: int) -> list[UserCamera]:
        """What is stated of each of so many cameras."""
        return [self.cameras] * count if isinstance(self.cameras, UserCamera) else list(self.cameras)

    def name_of_each(self, count: int) -> list[str]:
        """What each of so many sensors is called, if they are as many names."""
        return list(self.sensor_names) or (["sensor"] if count == 1 else [f"sensor-{i + 1}" for i in range(count)])


AS_USUAL = ImportOptions()
"""Everything is found out by the files."""
