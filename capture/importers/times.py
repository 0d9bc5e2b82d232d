"""The times of a source's frames as they go by: clocks that begin anew go on, a frame given twice counts once."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from capture.errors import RecordingError
from capture.importers.source import ColourFrame, DepthFrame, Frames
from capture.recording.clocks import Clock
from capture.rigid import Floats


class Timed:
    """Follows the times of one source; ``times_s`` are those of the depth frames that it passed on."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._depth, self._colour = Clock(), Clock()
        self._times: list[float] = []
        self._last: DepthFrame | None = None
        self._twice = 0

    @property
    def times_s(self) -> Floats:
        """When the depth frames (N,) that went by were taken (s), on the file's clock."""
        return np.array(self._times)

    def watched(self, frames: Frames) -> Iterator[DepthFrame | ColourFrame]:
        """The frames with mended times.

        Raises:
            RecordingError: two different depth images have one time, or depth is out of order.
        """
        for frame in frames:
            if isinstance(frame, ColourFrame):
                yield ColourFrame(self._colour(frame.time_s), frame.image)
                continue
            depth = DepthFrame(self._depth(frame.time_s), frame.readings)
            if self._last is not None and self._is_last(depth, self._last):
                self._twice += 1
                continue
            self._times.append(depth.time_s)
            self._last = depth
            yield depth

    def words(self) -> list[str]:
        """What was mended."""
        twice = [f"{self._twice} frames that stood twice, time and image, left out"] if self._twice else []
        return [*self._depth.restarts, *twice]

    def _is_last(self, frame: DepthFrame, last: DepthFrame) -> bool:
        """Whether a frame is the last one once more, which it may be; other frames must come after it."""
        if frame.time_s > last.time_s:
            return False
        count = len(self._times)
        if frame.time_s < last.time_s:
            raise RecordingError(
                f"depth frame {count} (at {frame.time_s:.4f} s) does not come after the one before",
                where=self._path,
                remedy="record or copy it again",
            )
        if not np.array_equal(frame.readings, last.readings):
            raise RecordingError(
                f"depth frames {count - 1} and {count} have one time ({frame.time_s:.4f} s) and different images",
                where=self._path,
                remedy="record or copy it again, or name the images of one sensor",
            )
        return True
