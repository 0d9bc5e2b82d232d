"""Tetrahedra inside a closed surface, and values at their corners evaluated anywhere."""

from __future__ import annotations

from contextlib import chdir
from dataclasses import dataclass, field
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from adapt.template_builder.meshes import Mesh
from capture.errors import AnatomyError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_SMALLEST = 0.02  # of the tetrahedra that were there: what one may shrink to when a corner is moved
_NEIGHBOURS = 24  # tetrahedra with the nearest middles, among which a point's own is looked for


@dataclass(frozen=True)
class TetMesh:
    """Points (N, 3) m and tetrahedra (T, 4) of positive volume."""

    points: Floats = field(repr=False)
    tets: Ints = field(repr=False)

    def volumes(self) -> Floats:
        """Signed volume (T,) of every tetrahedron, m^3."""
        a, b, c, d = self.points[self.tets].transpose(1, 0, 2)
        return np.asarray(np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6.0)


def tetrahedralised(surface: Mesh, *, edge: float, epsilon: float = 2e-4) -> TetMesh:
    """Fill a closed surface with tetrahedra of about ``edge`` (m); it may move by up to ``epsilon`` (m)."""
    import pyvista  # noqa: F401  (pytetwild needs it at import and does not say so)
    from pytetwild import tetrahedralize

    diagonal = float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))
    faces = surface.faces.astype(np.int32)
    with TemporaryDirectory() as scratch, chdir(scratch):  # pytetwild leaves a file where it runs
        points, tets = tetrahedralize(
            surface.vertices, faces, edge_length_abs=edge, epsilon=epsilon / diagonal, num_threads=1
        )
    tets = np.asarray(tets, dtype=np.int64)
    mesh = TetMesh(np.asarray(points, dtype=np.float64), tets)
    if np.median(mesh.volumes()) < 0.0:  # pytetwild 0.4 orders the corners the other way round
        mesh = TetMesh(mesh.points, tets[:, [0, 1, 3, 2]])
    return mesh


def on_grid(surface: Mesh, *, edge: float) -> TetMesh:
    """The cells of a cubic grid of ``edge`` (m) in which a closed surface lies, as tetrahedra: six each (Kuhn 1960).

    They reach a little beyond the surface, so that its own points lie in them, and come out the same every time.
    A cell belongs to it that has a corner inside, or the surface within 0.3 edges of its middle.
    """
    low = np.floor(surface.vertices.min(axis=0) / edge).astype(int) - 1
    shape = np.ceil(surface.vertices.max(axis=0) / edge).astype(int) + 2 - low
    corners = edge * (low + np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1))
    inside = (surface.depth(corners.reshape(-1, 3)) > 0.0).reshape(shape)
    cells = np.argwhere(np.ones(shape - 1, dtype=bool))
    at = np.array([[0, 0, 0], [0, 0, 1], [0, 1, 0], [0, 1, 1], [1, 0, 0], [1, 0, 1], [1, 1, 0], [1, 1, 1]])
    of_cell = cells[:, None] + at
    has_inside = inside[tuple(of_cell.transpose(2, 0, 1))].any(axis=1)
    middles = corners[tuple(cells.T)] + 0.5 * edge
    near = cKDTree(surface.vertices).query(middles)[0] < edge
    near[near] = surface.depth(middles[near]) > -0.3 * edge
    of_cell = of_cell[has_inside | near]
    index = np.ravel_multi_index(tuple(of_cell.transpose(2, 0, 1)), tuple(shape))
    ways = np.array([[0, 4, 6, 7], [0, 6, 2, 7], [0, 2, 3, 7], [0, 3, 1, 7], [0, 1, 5, 7], [0, 5, 4, 7]])
    tets = index[:, ways].reshape(-1, 4)
    used, tets = np.unique(tets, return_inverse=True)
    mesh = TetMesh(corners.reshape(-1, 3)[used], tets.reshape(-1, 4))
    turned = mesh.volumes() < 0.0
    return TetMesh(mesh.points, np.where(turned[:, None], mesh.tets[:, [0, 1, 3, 2]], mesh.tets))


def with_corners_at(mesh: TetMesh, points: Floats, *, within: float, exact: bool = True) -> tuple[TetMesh, Ints]:
    """Move one corner onto each of ``points`` (K, 3) and say which (K,); every tetrahedron stays positive.

    Unless ``exact``, the nearest corner stays where it is when none can be moved. Raises AnatomyError when no corner
    within ``within`` (m) of a point will do.
    """
    moved, chosen = mesh.points.copy(), []
    for point in points:
        off = np.linalg.norm(moved - point, axis=1)
        free = [int(corner) for corner in np.argsort(off)[:30] if int(corner) not in chosen and off[corner] <= within]
        for corner in free:
            before = moved[corner].copy()
            moved[corner] = point
            around = mesh.tets[np.any(mesh.tets == corner, axis=1)]
            usual = float(np.median(TetMesh(mesh.points, around).volumes()))
            if TetMesh(moved, around).volumes().min() > _SMALLEST * usual:
                chosen.append(corner)
                break
            moved[corner] = before
        else:
            if free and not exact:
                chosen.append(free[0])
                continue
            raise AnatomyError(f"no tetrahedron corner can be moved to {np.round(point, 4)}", remedy="use smaller tets")
    return TetMesh(moved, mesh.tets), np.array(chosen, dtype=np.int64)


def evaluate(mesh: TetMesh, values: Floats, points: Floats) -> Floats:
    """Values (N, K) at the corners, interpolated at points (M, 3) -> (M, K); outside, at the nearest tet."""
    corners = mesh.points[mesh.tets]
    count = min(_NEIGHBOURS, len(corners))
    _, near = cKDTree(corners.mean(axis=1)).query(points, k=count)
    near = near.reshape(len(points), count)
    edges = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)
    local = np.linalg.solve(edges[near], (points[:, None] - corners[near, 0])[..., None])[..., 0]
    shares = np.concatenate([1.0 - local.sum(axis=-1, keepdims=True), local], axis=-1)
    clamped = np.clip(shares, 0.0, None)
    clamped /= clamped.sum(axis=-1, keepdims=True)
    reached = np.einsum("mkc,mkcx->mkx", clamped, corners[near])
    best = np.argmin(np.linalg.norm(reached - points[:, None], axis=2), axis=1)
    rows = np.arange(len(points))
    return np.asarray(np.einsum("mc,mck->mk", clamped[rows, best], values[mesh.tets[near[rows, best]]]))
