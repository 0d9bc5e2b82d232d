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


def with_corners_at(mesh: TetMesh, points: Floats, *, within: float) -> tuple[TetMesh, Ints]:
    """Move one corner onto each of ``points`` (K, 3) and say which (K,); every tetrahedron stays positive.

    Raises AnatomyError when no corner within ``within`` (m) of a point can be moved there.
    """
    moved, chosen = mesh.points.copy(), []
    for point in points:
        order = np.argsort(np.linalg.norm(moved - point, axis=1))[:30]
        for corner in order:
            if int(corner) in chosen or np.linalg.norm(moved[corner] - point) > within:
                continue
            before = moved[corner].copy()
            moved[corner] = point
            around = mesh.tets[np.any(mesh.tets == corner, axis=1)]
            usual = float(np.median(TetMesh(mesh.points, around).volumes()))
            if TetMesh(moved, around).volumes().min() > _SMALLEST * usual:
                chosen.append(int(corner))
                break
            moved[corner] = before
        else:
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
