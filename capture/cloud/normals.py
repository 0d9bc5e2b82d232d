"""Where the surface is at a pixel, and its normal, from the smooth patch fitted to the readings around."""

from __future__ import annotations

import numpy as np

from capture.camera import Camera, ray_slopes
from capture.cloud.patches import SMOOTHING_ANGLE, Pixels, fit_patches
from capture.cloud.preprocess import Image
from capture.rigid import Floats


def surface_at(depth: Image, camera: Camera, pixels: Pixels) -> tuple[Floats, Floats]:
    """Points (N, 3) (m) and unit normals (N, 3) of the surface at pixels (N, 2) (row, column), in the sensor frame.

    Normals point towards the sensor. Each point stays on its pixel's ray. Every pixel must have a reading.
    """
    if not len(pixels):
        return np.zeros((0, 3)), np.zeros((0, 3))
    fit = fit_patches(depth, pixels, radius_px=radius_px(camera), focal_px=camera.fx)
    return _on_rays(fit, camera, pixels, depth[pixels[:, 0], pixels[:, 1]])


def radius_px(camera: Camera) -> int:
    """The radius (px) of the window that a patch is fitted in.

    >>> radius_px(Camera(640, 480, 580.0, 580.0, 320.0, 240.0)), radius_px(Camera(80, 60, 70.0, 70.0, 40.0, 30.0))
    (7, 2)
    """
    return max(2, round(SMOOTHING_ANGLE * camera.fx))


def _on_rays(fit: Floats, camera: Camera, pixels: Pixels, z0: Image) -> tuple[Floats, Floats]:
    """Points and normals of patches at their pixels: z = z0 / (1 - a / z0), n from the gradient of 1 / z.

    On the plane n . P = h, P = z (x, y, 1), the inverse depth w = n . (x, y, 1) / h is linear in the ray slopes x, y,
    so n is along (dw/dx, dw/dy, w - x dw/dx - y dw/dy); its product with P is positive, so -n faces the sensor.
    """
    slopes = ray_slopes(camera)[pixels[:, 0], pixels[:, 1]].astype(np.float64)
    rays = np.column_stack([slopes, np.ones(len(slopes))])
    inverse = 1.0 - fit[:, 0] / z0
    by_pixel = fit[:, 1:3] / (radius_px(camera) * z0[:, None])
    by_row, by_column = by_pixel.T
    (xx, xy), (yx, yy) = _slope_changes(camera, pixels).transpose(1, 2, 0)
    along = np.column_stack([yy * by_row - xy * by_column, xx * by_column - yx * by_row])  # Cramer's rule
    along /= (xx * yy - xy * yx)[:, None]
    normals = np.column_stack([along, -inverse - (slopes * along).sum(axis=1)])
    return rays * (z0 / inverse)[:, None], normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _slope_changes(camera: Camera, pixels: Pixels) -> Floats:
    """Change of the ray slopes per pixel (N, 2, 2): entry (i, j) of slope j along the row (0), down the column (1)."""
    slopes = ray_slopes(camera)
    row, column = pixels[:, 0], pixels[:, 1]
    right, left = np.minimum(column + 1, camera.width - 1), np.maximum(column - 1, 0)
    down, up = np.minimum(row + 1, camera.height - 1), np.maximum(row - 1, 0)
    along_row = (slopes[row, right] - slopes[row, left]) / (right - left)[:, None]
    down_column = (slopes[down, column] - slopes[up, column]) / (down - up)[:, None]
    return np.stack([along_row, down_column], axis=1).astype(np.float64)
