"""Whether something that one depth image shows is still there in another image of the same sensor.

A surface has gone where the other image reads something farther away, or nothing, in its place; where something nearer
hides the place, nobody can tell. Neither noise nor a ragged edge is motion: a reading at the same depth a few pixels
aside says that the surface stayed.
"""

from __future__ import annotations

import numpy as np

from capture.camera import Camera
from capture.cloud.preprocess import DEPTH_STEP, Image
from capture.projection import project
from capture.rigid import Floats

_STAYS_M, _STAYS_STEPS = 0.03, 2.0 * DEPTH_STEP  # at least, and 1 / m: what depth may change by where nothing moved
_WINDOW_PX = 3  # on each side
_LEAST_KNOWN = 0.2  # of the points must not be hidden


def gone_share(points: Floats, camera: Camera, depth: Image) -> float:
    """Which share of points (N, 3) (m, sensor frame) a later or earlier depth image (H, W) (m) shows to have gone.

    NaN where nearly all of them are hidden in it. Points that the lens model does not reach do not count.

    >>> camera, wall = Camera(64, 48, 60.0, 60.0, 32.0, 24.0), np.full((48, 64), 2.0, dtype=np.float32)
    >>> hand = np.array([[0.0, 0.0, 1.0], [0.1, 0.0, 1.0]])
    >>> gone_share(hand, camera, wall)  # the wall shows in its place
    1.0
    >>> gone_share(hand, camera, np.full((48, 64), 0.5, dtype=np.float32))  # something nearer hides the place
    nan
    """
    pixels, z = project(camera, points)
    has_pixel = np.isfinite(pixels).all(axis=1)
    points, pixels, z = points[has_pixel], pixels[has_pixel], z[has_pixel]
    tolerance = np.maximum(_STAYS_M, _STAYS_STEPS * z**2)
    padded = np.pad(depth, _WINDOW_PX)
    column, row = np.clip(np.rint(pixels).astype(int), 0, [camera.width - 1, camera.height - 1]).T
    stays, nearer = np.zeros((2, len(points)), dtype=np.bool_)
    for down in range(2 * _WINDOW_PX + 1):
        for right in range(2 * _WINDOW_PX + 1):
            now = padded[row + down, column + right]
            stays |= np.abs(now - z) < tolerance
            nearer |= (now > 0.0) & (now <= z - tolerance)
    known = stays | ~nearer
    if np.count_nonzero(known) <= _LEAST_KNOWN * len(points):
        return np.nan
    return float(np.count_nonzero(known & ~stays) / np.count_nonzero(known))
