"""The pinhole camera of a depth sensor.

Conventions, OpenCV's: pixel centres stand at integer coordinates, u runs right along a row and v down along a
column; the sensor frame has x right, y down, z forward; depth is the z coordinate, in metres. The distortion
coefficients (k1, k2, p1, p2, k3, ...) come in OpenCV's order too; an empty tuple means none. Where points fall in the
image ``capture.projection`` says.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from capture.rigid import Floats

DISTORTION_LENGTHS = (0, 4, 5, 8, 12, 14)
"""How many distortion coefficients there can be."""

_UNDISTORT_STEPS = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-9)


@dataclass(frozen=True)
class Camera:
    """Image size (px), focal lengths and principal point (px), distortion coefficients (OpenCV's order)."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()

    @property
    def matrix(self) -> Floats:
        """The intrinsic matrix (3, 3)."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])


@lru_cache(maxsize=16)
def ray_slopes(camera: Camera) -> NDArray[np.float32]:
    """For each pixel the slopes (x / z, y / z) of its ray, (H, W, 2), undistorted; read-only because cached.

    >>> ray_slopes(Camera(3, 1, 2.0, 2.0, 1.0, 0.0))[0].tolist()  # the middle column looks straight ahead
    [[-0.5, 0.0], [0.0, 0.0], [0.5, 0.0]]
    """
    if camera.distortion:
        v, u = np.mgrid[: camera.height, : camera.width].astype(np.float64)
        pixels = np.stack([u, v], axis=-1).reshape(-1, 1, 2)
        rays = cv2.undistortPoints(
            pixels, camera.matrix, np.array(camera.distortion), R=None, P=None, criteria=_UNDISTORT_STEPS
        )
        slopes: NDArray[np.float32] = rays.reshape(camera.height, camera.width, 2).astype(np.float32)
    else:
        slopes = np.zeros((camera.height, camera.width, 2), dtype=np.float32)
        slopes[..., 0] = (np.arange(camera.width) - camera.cx) / camera.fx
        slopes[..., 1] = ((np.arange(camera.height) - camera.cy) / camera.fy)[:, None]
    slopes.flags.writeable = False
    return slopes


def backproject(camera: Camera, depth_m: NDArray[np.floating]) -> Floats:
    """Organised points (H, W, 3) (m, sensor frame) of a depth image (H, W) (m); NaN where there is no depth.

    Raises:
        ValueError: the image does not have the camera's size.

    >>> backproject(Camera(2, 1, 500.0, 500.0, 0.0, 0.0), np.array([[1.5, 0.0]]))[0].round(4).tolist()
    [[0.0, 0.0, 1.5], [nan, nan, nan]]
    """
    if depth_m.shape != (camera.height, camera.width):
        raise ValueError(f"depth_m: expected ({camera.height}, {camera.width}), got {depth_m.shape}")
    with np.errstate(invalid="ignore"):
        z = np.where(np.isfinite(depth_m) & (depth_m > 0.0), depth_m, np.nan).astype(np.float64)
    points = np.zeros((*z.shape, 3))
    np.multiply(ray_slopes(camera), z[..., None], out=points[..., :2])
    points[..., 2] = z
    return points
