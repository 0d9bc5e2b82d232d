"""A closed surface's signed distance on a grid, looked up: true beneath folds, and quick in fits.

The nearest vertex's plane (``pose_bones.depth_beneath``) lies at ears, armpits and chins, where the nearest surface
faces elsewhere. Here exact distances stand at the corners of fine cells near the surface, of coarse cells elsewhere,
and are interpolated between them.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import igl
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates, zoom

from adapt.template_builder.meshes import Mesh

Floats = NDArray[np.float64]

_COARSER = 5  # times: the coarse cells, of which those near the surface are evaluated finely
_MARGIN = 0.04  # m around the surface


@dataclass(frozen=True)
class DepthGrid:
    """Depth (m, negative outside) at ``low + spacing * (i, j, k)``; of a surface with two like halves, the right."""

    low: Floats
    spacing: float
    depth: NDArray[np.float32] = field(repr=False)
    halved: bool

    def __call__(self, points: Floats) -> Floats:
        """How deep points (N, 3) m lie beneath the surface; beyond the grid, as at its border."""
        seen = np.abs(points) if self.halved else points
        seen = np.column_stack([points[:, :2], seen[:, 2]])
        at = (seen - self.low) / self.spacing
        return np.asarray(map_coordinates(self.depth, at.T, order=1, mode="nearest"), dtype=np.float64)


def depth_grid(
    mesh: Mesh, *, spacing: float = 0.004, band: float = 0.03, margin: float = _MARGIN, halved: bool = False
) -> DepthGrid:
    """The grid of a closed mesh; ``halved``: only z >= 0, of a mesh that is its own mirror image there.

    Cells within ``band`` (m) of the surface are evaluated at ``spacing`` (m), the others at five times that; the grid
    ends ``margin`` (m) around the surface.
    """
    low, high = mesh.vertices.min(axis=0) - margin, mesh.vertices.max(axis=0) + margin
    if halved:
        low[2] = -2.0 * spacing
    step = _COARSER * spacing
    shape = np.ceil((high - low) / step).astype(int) + 1
    coarse = mesh.depth(_corners(low, step, shape)).reshape(shape)
    fine_shape = (shape - 1) * _COARSER + 1
    depth = zoom(coarse, fine_shape / shape, order=1, grid_mode=False).astype(np.float32)
    near = np.flatnonzero(np.abs(depth) < band)
    points = low + spacing * np.stack(np.unravel_index(near, depth.shape), axis=1)
    depth.ravel()[near] = mesh.depth(points)
    return DepthGrid(low, spacing, depth, halved)


def smoothed(mesh: Mesh, *, spacing: float, blur: float) -> Mesh:
    """The closed surface of a mesh as ``meshes.level_set`` gives it of one, evaluated near the surface alone."""
    grid = depth_grid(mesh, spacing=spacing, band=3.0 * blur + 3.0 * spacing, margin=4.0 * spacing + 2.0 * blur)
    distance = gaussian_filter(-grid.depth.astype(np.float64), blur / spacing) if blur else -grid.depth
    corners = _corners(grid.low, spacing, np.array(distance.shape))
    # libigl counts the grid with x running fastest.
    order = np.arange(len(corners)).reshape(distance.shape).transpose(2, 1, 0).ravel()
    vertices, faces, *_ = igl.marching_cubes(
        np.asarray(distance, dtype=np.float64).ravel()[order], corners[order], *distance.shape, 0.0
    )
    surface = Mesh(np.asarray(vertices), np.asarray(faces, dtype=np.int64))
    return surface if surface.volume() > 0.0 else Mesh(surface.vertices, surface.faces[:, ::-1].copy())


def _corners(low: Floats, step: float, shape: NDArray[np.int64]) -> Floats:
    return np.asarray(low + step * np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), -1).reshape(-1, 3))
