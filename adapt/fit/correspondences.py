"""find_corres (paper, section 3.3): for each skin vertex a target in the cloud, or none.

A vertex gets no target when the nearest point that an eligible sensor saw is farther than the gate, when the
normals disagree, when the target lies on the scan's boundary, or when no sensor can see the vertex.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Floats, Ints
from adapt.fit.nearest import PointGrid
from adapt.fit.sight import see
from capture.cloud.fuse import Cloud, View
from capture.projection import project
from capture.rigid import apply, inverse

GATE_M = 0.04  # the paper's 4 cm
_FACING = 0.2  # cosine between normal and line of sight below which a sensor sees a vertex too obliquely
_OCCLUDED_M = 0.03  # something measured this much nearer than the vertex hides it


@dataclass(frozen=True)
class Correspondences:
    """M matches in the cloud's frame.

    Vertex index (M,), target point (M, 3), the vertex's own normal (M, 3), and how far (m) the vertex stood from its
    target along it when they were matched (M,). The plane of point-to-plane is the model's, not the cloud's: normals
    of a cloud are noisy, and lean where its surface ends (docs/accuracy.md tells what that costs).
    """

    vertex: Ints
    target: Floats
    normal: Floats
    distance: Floats

    def __len__(self) -> int:
        return len(self.vertex)


@dataclass(frozen=True)
class Target:
    """A cloud prepared for many searches: one grid per sensor."""

    cloud: Cloud

    @cached_property
    def parts(self) -> list[tuple[View, Ints, PointGrid]]:
        """View, indices of its points in the cloud, and their grid; sensors that saw nothing are left out."""
        parts = []
        for number, view in enumerate(self.cloud.views):
            index: Ints = np.flatnonzero(self.cloud.sensor == number)
            if len(index):
                parts.append((view, index, PointGrid(self.cloud.points[index])))
        return parts


def visible_from(view: View, vertices: Floats, normals: Floats) -> NDArray[np.bool_]:
    """Which vertices (N, 3) with unit normals the view's sensor can see.

    The vertex must face the sensor, lie inside its image, and not be hidden by something measured nearer.
    """
    if not view.camera.distortion:
        return see(view, vertices, normals, facing=_FACING, occluded_m=_OCCLUDED_M)
    sight = view.world_from_sensor[:3, 3] - vertices
    visible = np.einsum("ij,ij->i", normals, sight) > _FACING * np.linalg.norm(sight, axis=1)
    measured, z, inside = depth_at(view, vertices[visible])
    hidden = (measured > 0.0) & (measured < z - _OCCLUDED_M)
    visible[visible] = inside & ~hidden
    return np.asarray(visible)


def depth_at(view: View, points: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Where points (N, 3) fall in a view's image: the depth measured there, their own depth (N,) m, whether inside.

    Nothing measured, or outside the image, is 0.
    """
    row, column, inside = pixel_of(view, points)
    z = (points - view.world_from_sensor[:3, 3]) @ view.world_from_sensor[:3, 2]
    return np.where(inside, view.depth[row, column], 0.0), z, inside


def pixel_of(view: View, points: Floats) -> tuple[Ints, Ints, NDArray[np.bool_]]:
    """Row and column (N,) of the pixels that points (N, 3) fall on, and whether they fall inside the image.

    Outside, row and column are 0.
    """
    uv, z = project(view.camera, apply(inverse(view.world_from_sensor), points))
    pixel = np.rint(np.nan_to_num(uv, nan=-1.0)).astype(np.int64)
    height, width = view.depth.shape
    inside = (z > 0.0) & (pixel >= 0).all(axis=1) & (pixel[:, 0] < width) & (pixel[:, 1] < height)
    return np.where(inside, pixel[:, 1], 0), np.where(inside, pixel[:, 0], 0), inside


def in_an_image(views: Sequence[View], points: Floats) -> NDArray[np.bool_]:
    """Which points (N, 3) fall inside the image of any of the views: of the others nothing can be known."""
    return np.asarray(np.any([pixel_of(view, points)[2] for view in views], axis=0))


def find_corres(
    target: Target, vertices: Floats, normals: Floats, eligible: Ints, *, gate_m: float = GATE_M
) -> Correspondences:
    """Targets for the posed skin ``vertices`` (V, 3) with unit ``normals``; only ``eligible`` vertices (indices).

    Each vertex takes the nearest point among the sensors that can see it.
    """
    best = np.full(len(eligible), np.inf)
    match = np.full(len(eligible), -1, dtype=np.int64)
    points, facing = vertices[eligible], normals[eligible]
    for view, index, grid in target.parts:
        seen = np.flatnonzero(visible_from(view, points, facing))
        distance, nearest = grid.query(points[seen], distance_upper_bound=gate_m)
        closer = distance < best[seen]
        best[seen[closer]] = distance[closer]
        match[seen[closer]] = index[nearest[closer]]
    cloud = target.cloud
    kept = match >= 0
    kept[kept] = ~cloud.boundary[match[kept]]
    kept[kept] = np.einsum("ij,ij->i", facing[kept], cloud.normals[match[kept]]) > 0.0
    points, match = points[kept], match[kept]
    normal, matched = facing[kept], cloud.points[match]
    apart = np.einsum("ij,ij->i", normal, points - matched)
    return Correspondences(eligible[kept], matched, normal, apart)
