"""A look at the readings before they are believed: how many there are, whether any is usable, how fine their steps are.

A file of the right format can hold nothing that a depth sensor measures: zeros, saturated values, another unit.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.errors import RecordingError
from capture.importers.adjusted import DISPARITY_NONE
from capture.importers.source import ColourFrame, DepthFrame, Source, Stated
from capture.recording import Sensor

LEAST_USABLE = 0.05
"""Of the readings, that must lie within the sensor's range."""
_LOOKED_AT = 12
_DISPARITY_SHARE = 0.01  # of the readings that are the sign of none, in raw disparity


@dataclass
class Readings:
    """What the depth images of one sensor hold, added up image by image."""

    sensor: Sensor
    pixels: int = 0
    read: int = 0
    usable: int = 0
    no_disparity: int = 0
    largest: int = 0
    lowest: float = np.inf
    highest: float = 0.0
    steps: set[int] = field(default_factory=set)
    median: float = 0.0

    def add(self, readings: NDArray[np.uint16]) -> None:
        """Count one image's readings (H, W)."""
        there = readings[readings > 0]
        self.pixels += readings.size
        self.read += there.size
        if not there.size:
            return
        unit, (near, far) = self.sensor.depth_unit_m, self.sensor.depth_range_m
        usable = there[(there * unit >= near) & (there * unit <= far)]
        self.usable += usable.size
        self.no_disparity += int((there == DISPARITY_NONE).sum())
        self.largest = max(self.largest, int(there.max()))
        self.median = float(np.median(there))
        if usable.size:
            self.lowest = min(self.lowest, float(usable.min()) * unit)
            self.highest = max(self.highest, float(usable.max()) * unit)
            self.steps.update(np.unique(np.diff(np.unique(usable)))[:3].tolist())

    def in_words(self) -> str:
        """What is said of them."""
        share, usable = 100.0 * self.read / self.pixels, 100.0 * self.usable / self.read
        step = min(self.steps, default=0) * self.sensor.depth_unit_m * 1e3
        near, far = self.sensor.depth_range_m
        return (
            f"{share:.0f} % of the pixels have a reading, {usable:.0f} % of these between {near:g} and {far:g} m: "
            f"{self.lowest:.2f} to {self.highest:.2f} m in steps of {step:.3g} mm"
        )


def look_at(source: Source, stated: Stated, where: Path) -> Readings:
    """Look at the first images of a source.

    Raises:
        RecordingError: none of the readings is usable, or they are raw disparity.
    """
    seen = Readings(source.sensor)
    for frame in islice(_depth_frames(source.frames), _LOOKED_AT):
        seen.add(frame.readings)
    refuse_unusable(seen, stated, where)
    return seen


def refuse_unusable(seen: Readings, stated: Stated, where: Path) -> None:
    """Raise RecordingError where next to no reading can be what a depth sensor measured."""
    if not seen.read:
        raise RecordingError(
            "has no reading in its first images: all pixels are 0", where=where, remedy="record or export it again"
        )
    if _is_disparity(seen) and not stated.kinect_disparity and stated.depth_unit_m is None:
        raise RecordingError(
            f"looks like a first Kinect's raw 11-bit disparity: no reading is above {DISPARITY_NONE}, "
            f"{100 * seen.no_disparity / seen.read:.0f} % are {DISPARITY_NONE} itself",
            where=where,
            remedy="import it with --kinect-disparity, or state --unit-mm 1 if it is millimetres",
        )
    if seen.usable >= LEAST_USABLE * seen.read:
        return
    near, far = seen.sensor.depth_range_m
    typical = seen.median * seen.sensor.depth_unit_m
    raise RecordingError(
        f"has {100 * seen.usable / seen.read:.0f} % of its readings in the sensor's range, {near:g} to {far:g} m; "
        f"typical is {typical:.3g} m",
        where=where,
        remedy=f"{_likely_unit(seen)}state --unit-mm, or another --depth-range",
    )


def _is_disparity(seen: Readings) -> bool:
    return seen.largest == DISPARITY_NONE and seen.no_disparity > _DISPARITY_SHARE * seen.read


def _likely_unit(seen: Readings) -> str:
    """A unit in which the typical reading would be a usual distance."""
    near, far = seen.sensor.depth_range_m
    for unit_mm in (1.0, 0.1, 0.125, 0.25, 0.2, 10.0, 1000.0):
        if near <= seen.median * unit_mm / 1e3 <= far and abs(unit_mm / 1e3 - seen.sensor.depth_unit_m) > 1e-9:
            return f"is a step {unit_mm:g} mm? "
    return ""


def _depth_frames(frames: Iterable[DepthFrame | ColourFrame]) -> Iterable[DepthFrame]:
    return (frame for frame in frames if isinstance(frame, DepthFrame))
