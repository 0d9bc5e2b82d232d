"""What a user states of a source's depth, applied on the way in: a first Kinect's raw disparity, the range to trust."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from capture.importers.source import ColourFrame, DepthFrame, Frames, Source, Stated

DISPARITY_NONE = 2047
"""The reading of a first Kinect's raw 11-bit disparity that means that there is none."""
_OFFSET, _SLOPE = 3.3309495161, -0.0030711016  # 1/m and 1/m a step, N. Burrus's fit (OpenKinect, "Imaging information")


def adjusted(source: Source, stated: Stated) -> Source:
    """A source with what the user states of its depth applied."""
    if stated.depth_range_m is not None:
        source = replace(source, sensor=replace(source.sensor, depth_range_m=stated.depth_range_m))
    if stated.kinect_disparity:
        times = f"{source.times}; depth by the usual fit to raw Kinect disparity, a few centimetres off at 3 m"
        sensor = replace(source.sensor, depth_unit_m=0.001)
        source = replace(source, sensor=sensor, frames=_from_disparity(source.frames), times=times)
    return source


def _from_disparity(frames: Frames) -> Iterator[DepthFrame | ColourFrame]:
    for frame in frames:
        yield DepthFrame(frame.time_s, millimetres(frame.readings)) if isinstance(frame, DepthFrame) else frame


def millimetres(disparity: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """Depth (H, W) mm of a first Kinect's raw disparity (H, W); 0 where there is none, or none that is possible.

    >>> millimetres(np.array([[500, 900, 2047]], dtype=np.uint16))
    array([[ 557, 1763,    0]], dtype=uint16)
    """
    inverse = _OFFSET + _SLOPE * disparity.astype(np.float64)
    known = (disparity < DISPARITY_NONE) & (disparity > 0) & (inverse > 1e-3)
    depth = np.where(known, 1000.0 / np.where(known, inverse, 1.0), 0.0)
    return np.where(depth < 65535.0, np.rint(depth), 0.0).astype(np.uint16)
