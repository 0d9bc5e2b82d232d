"""Move a limb's skin so that bones lie as deep beneath it as people's do: a smooth field along its normals.

An artist drew the skin without bones in it. Bones are posed into it as they are; what is then still too deep or too
shallow is the skin's fault, and the skin gives way: a vertex x with the normal n moves by f(x) n. Of all fields that
bring every spot between its two depths, and leave every other vertex of a bone its clearance, f is the smoothest: it
has the least norm that belongs to the covariance

    k(x, y) = S^2 exp(-|x - y|^2 / (2 L^2)) ((1 + n(x) . n(y)) / 2)^2

The second factor keeps the two sides of a thin part, a hand or a foot, apart. The depth of a bone's vertex changes by f
at the point of the skin nearest to it, A f for all of them; with bounds b, A f >= b, that is f = K A^T m with

    m = argmin over m >= 0 of  m^T (A K A^T + N^2) m / 2 - b . m

Depths are no linear functions of the skin, so that this is done a few times.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import igl
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from adapt.template_builder.meshes import Mesh
from adapt.template_builder.superficial import Spot, filled_in

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_SIZE, _LENGTH, _NOISE = 0.008, 0.020, 0.0001  # m: S, L and N
_ROUNDS = 8
_INSIDE = 0.15  # share of a spot's interval by which its bounds are drawn in
_NEAR = 0.006  # m beyond its bound within which a vertex is watched
_CELL = 0.006  # m: of the vertices of a bone in one cell the shallowest is watched


@dataclass(frozen=True)
class _Bounds:
    """Vertices of bones (K, 3), and what must hold of each one's depth d (K,) m: sign (d - bound) >= 0."""

    vertices: Floats
    bound: Floats
    sign: Floats


def at_depths(
    skin: Mesh,
    held: NDArray[np.bool_],
    bones: Mapping[str, Mesh],
    landmarks: Mapping[str, Floats],
    spots: tuple[Spot, ...],
    clearance: Mapping[str, float],
) -> tuple[Mesh, Floats]:
    """The closed skin moved so that ``spots`` lie at their depths and bones keep their ``clearance`` (m, by name).

    ``held`` (V,) vertices, those of the caps, stay. Also the field (V,) m, positive outward.
    """
    normals = _smooth_normals(skin)
    field, moved = np.zeros(len(skin.vertices)), skin
    dense = filled_in(spots, landmarks)
    for _ in range(_ROUNDS):
        bounds = _joined([*_of_spots(moved, bones, landmarks, dense), *_of_bones(moved, bones, clearance)])
        corners, shares = _nearest(moved, bounds.vertices)
        lack = bounds.bound - moved.depth(bounds.vertices) + np.einsum("kc,kc->k", shares, field[corners])
        field = _smoothest(skin.vertices, normals, corners, shares * bounds.sign[:, None], bounds.sign * lack)
        field = np.where(held, 0.0, field)
        moved = Mesh(skin.vertices + field[:, None] * normals, skin.faces)
    return moved, field


def _of_spots(
    skin: Mesh, bones: Mapping[str, Mesh], landmarks: Mapping[str, Floats], spots: list[Spot]
) -> list[_Bounds]:
    """No vertex of a spot shallower than its lesser depth, the shallowest no deeper than its greater one."""
    bounds = []
    for spot in spots:
        inside = _INSIDE * (spot.high - spot.low)
        near = spot.vertices(bones[spot.bone].vertices, landmarks)
        depth = skin.depth(near)
        low = _shallowest_of_cells(near, depth, spot.low + _NEAR)
        bounds.append(_Bounds(low, np.full(len(low), spot.low + inside), np.ones(len(low))))
        bounds.append(_Bounds(near[[np.argmin(depth)]], np.array([spot.high - inside]), -np.ones(1)))
    return bounds


def _of_bones(skin: Mesh, bones: Mapping[str, Mesh], clearance: Mapping[str, float]) -> list[_Bounds]:
    bounds = []
    for name, least in clearance.items():
        vertices = bones[name].vertices
        low = _shallowest_of_cells(vertices, skin.depth(vertices), least + _NEAR)
        bounds.append(_Bounds(low, np.full(len(low), least), np.ones(len(low))))
    return bounds


def _shallowest_of_cells(vertices: Floats, depth: Floats, below: float) -> Floats:
    """Of the vertices (N, 3) less deep than ``below`` (m), the shallowest one of every cell."""
    near = np.flatnonzero(depth < below)
    order = near[np.argsort(depth[near])]
    _, first = np.unique(np.floor(vertices[order] / _CELL).astype(int), axis=0, return_index=True)
    return np.asarray(vertices[order[first]])


def _joined(bounds: list[_Bounds]) -> _Bounds:
    return _Bounds(*(np.concatenate([getattr(b, name) for b in bounds]) for name in ("vertices", "bound", "sign")))


def _nearest(skin: Mesh, points: Floats) -> tuple[Ints, Floats]:
    """The triangle nearest to each point (K, 3): its corners (K, 3), and their shares (K, 3) in the nearest point."""
    _, face, nearest = igl.point_mesh_squared_distance(points, skin.vertices, skin.faces)
    corners = skin.faces[face]
    a, b, c = skin.vertices[corners].transpose(1, 0, 2)
    shares = np.asarray(igl.barycentric_coordinates(np.asarray(nearest), a, b, c))
    return corners, shares


def _smoothest(points: Floats, normals: Floats, corners: Ints, shares: Floats, least: Floats) -> Floats:
    """The field (V,) of least norm whose weighted sums over ``corners`` (K, 3) are not below ``least`` (K,)."""
    used, where = np.unique(corners, return_inverse=True)
    matrix = np.zeros((len(corners), len(used)))
    np.add.at(matrix, (np.arange(len(corners))[:, None], where.reshape(corners.shape)), shares)
    among = _covariance(points[used], normals[used], points[used], normals[used])
    root = np.linalg.cholesky(matrix @ among @ matrix.T + _NOISE**2 * np.eye(len(corners)))
    multipliers, _ = nnls(root.T, np.linalg.solve(root, least), maxiter=100 * len(corners))
    return np.asarray(_covariance(points, normals, points[used], normals[used]) @ (matrix.T @ multipliers))


def _covariance(x: Floats, nx: Floats, y: Floats, ny: Floats) -> Floats:
    apart = np.sum(x**2, axis=1)[:, None] + np.sum(y**2, axis=1) - 2.0 * x @ y.T
    return np.asarray(_SIZE**2 * np.exp(-apart / (2.0 * _LENGTH**2)) * ((1.0 + nx @ ny.T) / 2.0) ** 2)


def _smooth_normals(skin: Mesh) -> Floats:
    normals = np.asarray(igl.per_vertex_normals(skin.vertices, skin.faces))
    neighbours = igl.adjacency_list(skin.faces)
    for _ in range(3):
        normals = np.array([normals[[k, *near]].mean(axis=0) for k, near in enumerate(neighbours)])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(normals)
