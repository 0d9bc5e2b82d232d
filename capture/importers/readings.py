"""What the readings of a file look like, before anybody believes them: a count of each value, and what it means.

A wrong unit, an empty stream or the wrong kind of number leaves files of the right size whose images are of no use;
nothing but the values tells.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from capture.errors import RecordingError
from capture.importers.disparity import disparity_bits, of_10_bits
from capture.importers.source import LARGEST_READING, ColourFrame, DepthFrame, Frames
from capture.recording import Sensor

_LEAST_USABLE = 0.05
"""Of the readings, that lie in the depth range: with fewer, the rest is a unit or a range that is wrong."""

_COMMON = 1e-5
"""Values rarer than this, of all readings, do not count as steps."""


class Tally:
    """Counts the readings of a sensor as its frames go by."""

    def __init__(self, sensor: Sensor, path: Path) -> None:
        self._sensor, self._path = sensor, path
        self._counts = np.zeros(LARGEST_READING + 1, dtype=np.int64)
        self._frames = 0

    def watched(self, frames: Frames) -> Iterator[DepthFrame | ColourFrame]:
        """The frames as they come; at their end, refuses readings that are of no use.

        Raises:
            RecordingError: as ``check`` does.
        """
        for frame in frames:
            if isinstance(frame, DepthFrame):
                self._counts += np.bincount(frame.readings.ravel(), minlength=LARGEST_READING + 1)
                self._frames += 1
                if self._frames == 1:
                    self._refuse_disparity()
            yield frame
        self.check()

    def check(self) -> None:
        """Refuse readings that are of no use.

        Raises:
            RecordingError: raw disparities; none, all saturated, or hardly any within the depth range.
        """
        self._refuse_disparity()
        counts = self._counts
        readings = int(counts[1:LARGEST_READING].sum())
        if not self._frames or (readings and self._usable() >= _LEAST_USABLE * readings):
            return
        if not readings:
            saturated = counts[LARGEST_READING] > 0
            raise RecordingError(
                f"has no reading in any of its {self._frames} depth images: every pixel is 0"
                + (f" or {LARGEST_READING}, which is no distance" if saturated else ""),
                where=self._path,
                remedy="the stream was empty, covered or saturated: record it again, or name the depth images with "
                "--pattern and --format",
            )
        low, high = (value * self._sensor.depth_unit_m for value in self._between(0.01, 0.99))
        near, far = self._sensor.depth_range_m
        raise RecordingError(
            f"has depth from {low:.3g} to {high:.3g} m by its unit of {1000 * self._sensor.depth_unit_m:g} mm, of "
            f"which {self._usable() / readings:.0%} lies between {near:g} and {far:g} m",
            where=self._path,
            remedy="state the unit with --unit-mm, or the range with --depth-range; or it is no depth at all",
        )

    def words(self) -> str:
        """How much of the images is usable, of what range, in what steps."""
        counts = self._counts
        total, readings = int(counts.sum()), int(counts[1:LARGEST_READING].sum())
        if not readings:
            return "no readings"
        unit = self._sensor.depth_unit_m
        low, high = (value * unit for value in self._between(0.01, 0.99))
        return (
            f"{self._usable() / total:.0%} of all pixels usable ({self._usable() / readings:.0%} of the readings), "
            f"{low:.2f} to {high:.2f} m, in steps of {1000 * unit * self._step():g} mm"
        )

    def _usable(self) -> int:
        near, far = (round(end / self._sensor.depth_unit_m) for end in self._sensor.depth_range_m)
        return int(self._counts[max(near, 1) : min(far, LARGEST_READING) + 1].sum())

    def _between(self, low: float, high: float) -> tuple[int, int]:
        """The readings, those of no distance aside, below which these shares of them lie."""
        rising = np.cumsum(self._counts[1:LARGEST_READING])
        first, last = np.searchsorted(rising, [low * rising[-1], high * rising[-1]]) + 1
        return int(first), int(last)

    def _step(self) -> int:
        """The smallest gap between values that are common."""
        counts = self._counts[1:LARGEST_READING]
        common = np.flatnonzero(counts > _COMMON * counts.sum())
        return int(np.diff(common).min()) if len(common) > 1 else 1

    def _refuse_disparity(self) -> None:
        bits = disparity_bits(self._counts)
        if bits == 10:
            raise of_10_bits(self._path)
        if bits == 11:
            raise RecordingError(
                "has raw disparities of a Kinect for Xbox 360 (11 bits, 2047 for none), not distances",
                where=self._path,
                remedy="give --kinect-disparity to have them converted, or record millimetres "
                "(FREENECT_DEPTH_MM or _REGISTERED)",
            )
