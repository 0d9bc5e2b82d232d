"""Flat regions of one organised cloud: walls, floors, the faces of a box.

A region grows from the middle of the widest flat area left: from there outwards, pixel by neighbouring pixel, as
long as points lie on its plane and local normals agree with it. No random sampling, so the same image always gives
the same planes.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from capture.rigid import Floats

Mask = NDArray[np.bool_]

_WINDOW_PX = 15  # side of the square over which local normals are fitted
_FLAT_FLOOR_M = 5e-4  # rounding to millimetres alone makes a window this rough
_FLAT_FACTOR = 1.5  # a window this much rougher than the smoothest quarter of the image is no plane
_SEED_RADIUS_PX = 4  # no region starts where the flat area is narrower
_NORMAL_TOLERANCE = np.cos(np.deg2rad(25.0))
_TOLERANCE_FACTOR, _TOLERANCE_FLOOR_M = 3.0, 0.003  # points this many times the roughness off are not on the plane
_GROWTH_ROUNDS = 6


@dataclass(frozen=True, eq=False)
class Plane:
    """``normal . x = offset`` (m, sensor frame) with the unit normal (3,) towards the sensor, and its points (N, 3)."""

    normal: Floats
    offset: float
    points: Floats


@dataclass(frozen=True, eq=False)
class _Surface:
    points: Floats  # (H, W, 3), 0 where there is none
    valid: Mask  # (H, W)
    normals: Floats  # (H, W, 3)
    tolerance: Floats  # (H, W) m


def find_planes(points: Floats, *, smallest: int = 300, most: int = 30) -> list[Plane]:
    """Flat connected regions of organised ``points`` (H, W, 3) (m, sensor frame, NaN for none), wide ones first.

    Args:
        points: of one depth image.
        smallest: regions of fewer points are left out.
        most: stop after so many.

    >>> x, y = np.meshgrid(np.linspace(-0.5, 0.5, 60), np.linspace(-0.4, 0.4, 50))
    >>> [wall] = find_planes(np.stack([x, y, np.full_like(x, 2.0)], axis=-1))
    >>> (wall.normal.round(6) + 0.0).tolist(), round(wall.offset, 6), wall.points.shape
    ([0.0, 0.0, -1.0], -2.0, (3000, 3))
    """
    valid = np.isfinite(points[..., 2])
    if np.count_nonzero(valid) < smallest:
        return []
    filled = np.where(valid[..., None], points, 0.0)
    normals, roughness = _local_planes(filled, valid)
    depth_squared = np.maximum(filled[..., 2] ** 2, 1e-6)  # the noise of structured light grows with it
    level = float(np.quantile(roughness[valid] / depth_squared[valid], 0.25))
    flat = valid & (roughness < np.maximum(_FLAT_FACTOR * level * depth_squared, _FLAT_FLOOR_M))
    tolerance = np.maximum(_TOLERANCE_FACTOR * level * depth_squared, _TOLERANCE_FLOOR_M)
    surface = _Surface(filled, valid, normals, tolerance)
    planes: list[Plane] = []
    while len(planes) < most:
        reach = cv2.distanceTransform(np.pad(flat, 1).astype(np.uint8), cv2.DIST_C, 3)[1:-1, 1:-1]
        row, column = np.unravel_index(int(reach.argmax()), reach.shape)
        radius = int(reach[row, column])
        if radius < _SEED_RADIUS_PX:
            break
        region = _grown(surface, int(row), int(column), radius)
        if np.count_nonzero(region) >= smallest:
            planes.append(_with_margin(surface, region))
        flat &= ~region
        flat[_square(int(row), int(column), radius)] = False  # progress even where nothing grew
    return planes


def _square(row: int, column: int, radius: int) -> tuple[slice, slice]:
    return slice(max(row - radius + 1, 0), row + radius), slice(max(column - radius + 1, 0), column + radius)


def _grown(surface: _Surface, row: int, column: int, radius: int) -> Mask:
    """The connected region (H, W) around a seed whose points and normals agree with one plane."""
    region = np.zeros(surface.valid.shape, dtype=bool)
    region[_square(row, column, radius)] = True
    region &= surface.valid
    for _ in range(_GROWTH_ROUNDS):
        if np.count_nonzero(region) < 3:
            break
        normal, offset = _fitted(surface.points[region])
        near = np.abs(surface.points @ normal - offset) < surface.tolerance
        alike = near & surface.valid & (np.abs(surface.normals @ normal) > _NORMAL_TOLERANCE)
        labels = cv2.connectedComponents(alike.astype(np.uint8), connectivity=4)[1]
        counts = np.bincount(labels[region & alike], minlength=1)
        counts[0] = 0
        if not counts.any():
            return np.zeros_like(region)
        region = labels == counts.argmax()
    return region


def _with_margin(surface: _Surface, region: Mask) -> Plane:
    """The plane of a region, and its points up to the very edge.

    Near an edge the windows of local normals reach over it, so regions stop short; there the distance decides alone.
    """
    normal, offset = _fitted(surface.points[region])
    around = cv2.dilate(region.astype(np.uint8), np.ones((_WINDOW_PX, _WINDOW_PX), np.uint8)) > 0
    near = np.abs(surface.points @ normal - offset) < surface.tolerance
    return Plane(normal, offset, surface.points[around & near & surface.valid])


def _fitted(points: Floats) -> tuple[Floats, float]:
    """Least-squares plane of points (N, 3): unit normal (3,) towards the origin, and offset (m)."""
    centre = points.mean(axis=0)
    normal = np.linalg.eigh((points - centre).T @ (points - centre))[1][:, 0]
    normal = -normal if normal @ centre > 0.0 else normal
    return normal, float(normal @ centre)


def _local_planes(points: Floats, valid: Mask) -> tuple[Floats, Floats]:
    """Normals (H, W, 3) and root mean square distances (H, W) m of planes fitted in a window around each pixel."""
    origin = points[valid].mean(axis=0)
    centred = np.where(valid[..., None], points - origin, 0.0)
    first = _window_sums(centred)
    second = _window_sums((centred[..., :, None] * centred[..., None, :]).reshape(*valid.shape, 9))
    count = _window_sums(valid[..., None].astype(np.float64))[valid]
    mean = first[valid] / count
    covariance = (second[valid] / count).reshape(-1, 3, 3) - mean[:, :, None] * mean[:, None, :]
    values, vectors = np.linalg.eigh(covariance)
    normals, roughness = np.zeros_like(points), np.full(valid.shape, np.inf)
    normals[valid] = vectors[:, :, 0]
    sparse = count[:, 0] < 0.3 * _WINDOW_PX**2
    roughness[valid] = np.where(sparse, np.inf, np.sqrt(np.maximum(values[:, 0], 0.0)))
    return normals, roughness


def _window_sums(images: Floats) -> Floats:
    """Sums (H, W, K) over the window around each pixel, image by image."""
    size = (_WINDOW_PX, _WINDOW_PX)
    sums = [
        cv2.boxFilter(
            np.ascontiguousarray(images[..., k]), cv2.CV_64F, size, normalize=False, borderType=cv2.BORDER_CONSTANT
        )
        for k in range(images.shape[-1])
    ]
    return np.stack(sums, axis=-1)
