"""Where the surface is at a pixel, and its normal, from the smooth patch fitted to the readings around."""

from __future__ import annotations

import numpy as np

from capture.camera import Camera, ray_slopes
from capture.cloud.patches import SMOOTHING_ANGLE, Pixels, fit_patches
from capture.cloud.preprocess import Image
from capture.compiled import compiled
from capture.rigid import Floats


def surface_at(depth: Image, camera: Camera, pixels: Pixels) -> tuple[Floats, Floats]:
    """Points (N, 3) (m) and unit normals (N, 3) of the surface at pixels (N, 2) (row, column), in the sensor frame.

    Normals point towards the sensor. Each point stays on its pixel's ray. Every pixel must have a reading.
    """
    if not len(pixels):
        return np.zeros((0, 3)), np.zeros((0, 3))
    fit = fit_patches(depth, pixels, radius_px=radius_px(camera), focal_px=camera.fx)
    points, normals = np.zeros((len(pixels), 3)), np.zeros((len(pixels), 3))
    _on_rays(fit, ray_slopes(camera), pixels, depth, float(radius_px(camera)), points, normals)
    return points, normals


def radius_px(camera: Camera) -> int:
    """The radius (px) of the window that a patch is fitted in.

    >>> radius_px(Camera(640, 480, 580.0, 580.0, 320.0, 240.0)), radius_px(Camera(80, 60, 70.0, 70.0, 40.0, 30.0))
    (7, 2)
    """
    return max(2, round(SMOOTHING_ANGLE * camera.fx))


@compiled
def _on_rays(
    fit: Floats, slopes: Image, pixels: Pixels, depth: Image, radius_px: float, points: Floats, normals: Floats
) -> None:
    """Fills points and normals (N, 3) of patches at their pixels: z = z0 / (1 - a / z0), n from the gradient of 1 / z.

    On the plane n . P = h, P = z (x, y, 1), the inverse depth w = n . (x, y, 1) / h is linear in the ray slopes x, y,
    so n is along (dw/dx, dw/dy, w - x dw/dx - y dw/dy); its product with P is positive, so -n faces the sensor.
    """
    last_row, last_column = slopes.shape[0] - 1, slopes.shape[1] - 1
    for m in range(len(pixels)):
        row, column = pixels[m]
        z0, inverse = float(depth[row, column]), 1.0 - fit[m, 0] / depth[row, column]
        right, left = min(column + 1, last_column), max(column - 1, 0)
        down, up = min(row + 1, last_row), max(row - 1, 0)
        across, along = slopes[row, right] - slopes[row, left], slopes[down, column] - slopes[up, column]
        xx, xy = float(across[0]) / (right - left), float(across[1]) / (right - left)
        yx, yy = float(along[0]) / (down - up), float(along[1]) / (down - up)
        by_column, by_row = fit[m, 1] / (radius_px * z0), fit[m, 2] / (radius_px * z0)
        apart = xx * yy - xy * yx  # Cramer's rule
        x, y = float(slopes[row, column, 0]), float(slopes[row, column, 1])
        a, b = (yy * by_column - xy * by_row) / apart, (xx * by_row - yx * by_column) / apart
        c = -inverse - (x * a + y * b)
        z, length = z0 / inverse, np.sqrt(a * a + b * b + c * c)
        points[m, 0], points[m, 1], points[m, 2] = x * z, y * z, z
        normals[m, 0], normals[m, 1], normals[m, 2] = a / length, b / length, c / length
