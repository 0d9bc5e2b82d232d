"""Raw disparities of the Kinect for Xbox 360, as libfreenect gives them, told from distances, and converted.

Of 11 bits, in metres: z = 0.1236 tan(d / 2842.5 + 1.1863) is S. Magnenat's, published on the OpenKinect project's
page "Imaging Information". It is one for all sensors: the exact one differs a little from each to the next. The ROS
page kinect_calibration/technical has z = 8 b f / (1090 - d) with b = 0.075 m and f = 580 px, which is 0.4 % farther at
1.2 m and 2 % at 3.8 m. Of 10 bits (FREENECT_DEPTH_10BIT) no relation was found published, so they are only told.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.errors import RecordingError
from capture.importers.source import LARGEST_READING, ColourFrame, DepthFrame, Frames, Source, fine_unit

_NONE = 2047
_NONE_OF_10_BITS = 1023
_FARTHEST = 1092
"""The relation has its pole behind this; sensors give less, but for none."""
_FARTHEST_OF_10_BITS = 999
"""None of 10 bits stands apart from what is measured by at least so much; millimetres that end at 1023 do not."""

_LEAST_NONE = 0.002
"""Of all pixels are 2047 in a raw image: the shadow of the projector and the strip at the right always are."""


def disparity_bits(counts: NDArray[np.int64]) -> int | None:
    """How many bits, 11 or 10, raw disparities have of which these are the counts (65536,) of values; None: distances.

    Values up to about 1090, none between them and 2047, and a good many at 2047, which no distance is likely to do; or
    the same below and at 1023.

    >>> counts = np.zeros(65536, dtype=np.int64)
    >>> counts[600:900], counts[2047] = 1000, 20_000
    >>> disparity_bits(counts)
    11
    >>> counts[1500] = 1  # a single reading between them: these are distances
    >>> disparity_bits(counts) is None
    True
    """
    for bits, farthest, none in ((11, _FARTHEST, _NONE), (10, _FARTHEST_OF_10_BITS, _NONE_OF_10_BITS)):
        beyond = counts[farthest + 1 :].sum() - counts[none]
        if beyond == 0 and counts[none] > _LEAST_NONE * counts.sum():
            return bits
    return None


def of_10_bits(where: Path) -> RecordingError:
    """The error to raise about raw disparities of 10 bits."""
    return RecordingError(
        "has raw disparities of a Kinect for Xbox 360 of 10 bits (1023 for none), whose distances nobody tells",
        where=where,
        remedy="record millimetres (FREENECT_DEPTH_MM or _REGISTERED) or 11 bits; if these are millimetres all the "
        "same, make 1023 a 0",
    )


def converted(source: Source, where: Path) -> Source:
    """The source's raw disparities of 11 bits as distances; its frames raise RecordingError if they have 10 bits."""
    unit_m = fine_unit(source.sensor.depth_range_m[1])
    d = np.arange(_FARTHEST + 1)
    metres = 0.1236 * np.tan(d / 2842.5 + 1.1863)
    metres[0] = 0.0
    readings = np.rint(metres / unit_m)
    table = np.zeros(LARGEST_READING + 1, dtype=np.uint16)
    table[: len(d)] = np.where((readings > 0) & (readings <= LARGEST_READING), readings, 0)
    sensor = replace(source.sensor, depth_unit_m=unit_m)
    return replace(source, sensor=sensor, frames=_distances(source.frames, table, where))


def _distances(frames: Frames, table: NDArray[np.uint16], where: Path) -> Iterator[DepthFrame | ColourFrame]:
    for frame in frames:
        if not isinstance(frame, DepthFrame):
            yield frame
            continue
        if disparity_bits(np.bincount(frame.readings.ravel(), minlength=LARGEST_READING + 1)) == 10:
            raise of_10_bits(where)
        yield DepthFrame(frame.time_s, table[frame.readings])
