"""Raw 11-bit disparities of the Kinect for Xbox 360, as libfreenect gives them, told from distances, and converted.

The relation, in metres, z = 0.1236 tan(d / 2842.5 + 1.1863), is S. Magnenat's, published on the OpenKinect project's
page "Imaging Information". It is one for all sensors: the exact one differs a little from each to the next. The ROS
page kinect_calibration/technical has z = 8 b f / (1090 - d) with b = 0.075 m and f = 580 px, which is 0.4 % farther at
1.2 m and 2 % at 3.8 m.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from capture.importers.source import LARGEST_READING, ColourFrame, DepthFrame, Frames, Source, fine_unit

_NONE = 2047
_FARTHEST = 1092
"""The relation has its pole behind this; sensors give less, but for none."""

_LEAST_NONE = 0.002
"""Of all pixels are 2047 in a raw image: the shadow of the projector and the strip at the right always are."""


def looks_like_disparity(counts: NDArray[np.int64]) -> bool:
    """Whether counts (65536,) of an image's values are those of raw disparities.

    Values up to about 1090, none between them and 2047, and a good many at 2047, which no distance is likely to do.
    """
    total = counts[1:].sum()
    beyond = counts[_FARTHEST + 1 :].sum() - counts[_NONE]
    return bool(total and beyond == 0 and counts[_NONE] > _LEAST_NONE * counts.sum())


def converted(source: Source) -> Source:
    """The source's raw disparities as distances."""
    unit_m = fine_unit(source.sensor.depth_range_m[1])
    d = np.arange(_FARTHEST + 1)
    metres = 0.1236 * np.tan(d / 2842.5 + 1.1863)
    metres[0] = 0.0
    readings = np.rint(metres / unit_m)
    table = np.zeros(LARGEST_READING + 1, dtype=np.uint16)
    table[: len(d)] = np.where((readings > 0) & (readings <= LARGEST_READING), readings, 0)
    sensor = replace(source.sensor, depth_unit_m=unit_m)
    return replace(source, sensor=sensor, frames=_distances(source.frames, table))


def _distances(frames: Frames, table: NDArray[np.uint16]) -> Iterator[DepthFrame | ColourFrame]:
    for frame in frames:
        yield DepthFrame(frame.time_s, table[frame.readings]) if isinstance(frame, DepthFrame) else frame
