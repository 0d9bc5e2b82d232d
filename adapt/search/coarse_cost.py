"""How well many placements of a few skin vertices explain a cloud: the coarse half of the first search.

A placement is a rigid motion of the same N vertices. What it costs (m) is the mean distance of vertices that face the
sensors from the cloud, plus that of some points from the vertices, both truncated, plus what an outline on other
surface and skin in free space cost in ``adapt.search.pose_score``. Compiled loops do this; ``costs_by_arrays`` is their
twin in plain NumPy.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from adapt.anatomy import Floats
from adapt.match.point_grid import PointGrid
from adapt.match.visibility import in_an_image, is_on_outline, is_past, nearest_around
from adapt.search.pose_score import (
    BESIDE_M,
    FAR_M,
    FREE_SPACE_M,
    MERGED_M,
    SAME_SURFACE_M,
    free_space_share,
    merged_share,
)
from capture.cloud.fuse import Cloud
from capture.cloud.preprocess import Image
from capture.compiled import compiled
from capture.projection import Lens, lens_of, pixel_within

_FEW_POINTS = 60


@dataclass(frozen=True)
class Placements:
    """R placements of N vertices: where they are (R, N, 3) m, their unit normals (R, N, 3), and what each counts.

    ``facing`` (R, N) counts only those that face the sensors, ``weights`` (N,) all.
    """

    points: Floats
    normals: Floats
    facing: Floats
    weights: Floats


@dataclass(frozen=True)
class Scene:
    """A cloud, or a part of one, prepared for many placements."""

    cloud: Cloud

    @cached_property
    def few(self) -> Image:
        """Some of the points (K, 3)."""
        points = self.cloud.points
        return points[:: max(1, len(points) // _FEW_POINTS)].astype(np.float32)

    @cached_property
    def grid(self) -> PointGrid:
        """The points, to be searched."""
        return PointGrid(self.cloud.points)

    @cached_property
    def nearest(self) -> list[Image]:
        """Of each view the smallest depth (H, W) m around each pixel, as ``looked_past`` asks for it."""
        return [nearest_around(view.depth) for view in self.cloud.views]


def costs(scene: Scene, placed: Placements) -> Floats:
    """What each of R placements costs (R,) m."""
    shape = placed.points.shape[:2]
    inside, free_space = np.zeros(shape, dtype=np.bool_), np.zeros(shape, dtype=np.bool_)
    outline, merged = np.zeros(shape[0]), np.zeros(shape[0])
    for view, nearest in zip(scene.cloud.views, scene.nearest, strict=True):
        images = (view.world_from_sensor, lens_of(view.camera), view.depth, nearest)
        _look(*images, placed.points, placed.normals, placed.weights, inside, free_space, outline, merged)
    counted = placed.facing * inside
    asked, distance = counted > 0.0, np.zeros(shape)
    distance[asked] = np.minimum(scene.grid.query(placed.points[asked], distance_upper_bound=FAR_M)[0], FAR_M)
    apart = np.zeros(shape[0])
    _explain(placed.points.astype(np.float32), scene.few, np.zeros(len(scene.few), dtype=np.float32), apart)
    return _sum(counted, distance, apart, merged / np.maximum(outline, 1e-9), free_space.mean(axis=1))


def costs_by_arrays(scene: Scene, placed: Placements) -> Floats:
    """``costs`` in plain NumPy."""
    cloud, flat = scene.cloud, placed.points.reshape(-1, 3)
    counted = placed.facing * in_an_image(cloud.views, flat).reshape(placed.facing.shape)
    distance = np.minimum(cKDTree(cloud.points).query(flat, distance_upper_bound=FAR_M)[0], FAR_M)
    square = np.array([((points[:, None] - scene.few) ** 2).sum(axis=2).min(axis=0) for points in placed.points])
    apart = np.minimum(np.sqrt(square), 2.0 * FAR_M).mean(axis=1)
    merged = merged_share(cloud, placed.points, placed.normals, placed.weights)
    free_space = free_space_share(cloud, placed.points, np.ones(len(placed.weights)))
    return _sum(counted, distance.reshape(counted.shape), apart, merged, free_space)


def _sum(counted: Floats, distance: Floats, apart: Floats, merged: Floats, free_space: Floats) -> Floats:
    skin = (counted * distance).sum(axis=1) / np.maximum(counted.sum(axis=1), 1e-9)
    return np.asarray(skin + apart + MERGED_M * merged + FREE_SPACE_M * free_space)


@compiled
def _look(
    world_from_sensor: Floats,
    lens: Lens,
    depth: Image,
    nearest: Image,
    points: Floats,
    normals: Floats,
    weights: Floats,
    inside: NDArray[np.bool_],
    free_space: NDArray[np.bool_],
    outline: Floats,
    merged: Floats,
) -> None:
    """What one view says: marks vertices ``inside`` its image and in ``free_space`` (R, N), adds up outlines (R,)."""
    t = world_from_sensor
    for r in range(points.shape[0]):
        for i in range(points.shape[1]):
            a, b, c = points[r, i, 0] - t[0, 3], points[r, i, 1] - t[1, 3], points[r, i, 2] - t[2, 3]
            e, f, g = normals[r, i, 0], normals[r, i, 1], normals[r, i, 2]
            z = a * t[0, 2] + b * t[1, 2] + c * t[2, 2]
            row, column = _pixel(t, lens, depth.shape, a, b, c)
            if row >= 0:
                inside[r, i] = True
                free_space[r, i] = free_space[r, i] or is_past(nearest[row, column], z)
            if not is_on_outline(t, e, f, g):
                continue
            outline[r] += weights[i]
            row, column = _pixel(t, lens, depth.shape, a + BESIDE_M * e, b + BESIDE_M * f, c + BESIDE_M * g)
            if row >= 0 and depth[row, column] > 0.0 and abs(depth[row, column] - z) < SAME_SURFACE_M:
                merged[r] += weights[i]


@compiled
def _pixel(t: Floats, lens: Lens, shape: tuple[int, int], a: float, b: float, c: float) -> tuple[int, int]:
    """Row and column of the pixel that a point at (a, b, c) from the sensor falls on; -1 outside the image."""
    x = a * t[0, 0] + b * t[1, 0] + c * t[2, 0]
    y = a * t[0, 1] + b * t[1, 1] + c * t[2, 1]
    z = a * t[0, 2] + b * t[1, 2] + c * t[2, 2]
    return pixel_within(lens, shape, x, y, z)


@compiled
def _explain(points: Image, few: Image, square: Image, apart: Floats) -> None:
    """Truncated mean distance (R,) from a ``few`` points (K, 3) to each of R placed sets of vertices (R, N, 3)."""
    for r in range(points.shape[0]):
        square[:] = np.float32(4.0 * FAR_M * FAR_M)
        for i in range(points.shape[1]):
            a, b, c = points[r, i, 0], points[r, i, 1], points[r, i, 2]
            for k in range(len(square)):
                e, f, g = few[k, 0] - a, few[k, 1] - b, few[k, 2] - c
                square[k] = min(square[k], e * e + f * f + g * g)
        total = 0.0
        for k in range(len(square)):
            total += np.sqrt(square[k])
        apart[r] = total / len(square)
