"""How close one surface can be brought to another by a linear family of shapes and a rigid motion.

x' = R (base + basis q) with R in SO(3): the family holds its own translations. Iterated closest points, from the
family's surface to the other and back, so that neither may have a part that the other lacks.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path

import igl
import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.distance import pdist

from adapt.anatomy import Floats, Ints
from adapt.template_builder.meshes import Mesh
from capture._open3d import open3d
from capture.errors import AnatomyError
from capture.rigid import exp_so3, hat

_ROUNDS, _FIRST_ROUNDS = 60, 15
_PLANE_WEIGHT = 10.0  # of point to plane against point to point, as in the paper's fits
_DAMPING = 1e-6  # relative; keeps what the family expresses twice, such as a turn, from drifting
_STILL = 1e-6  # a step that changes q (m, and scales' 1) by less is the last
_FEWER = 5  # one sample in so many is used while the first turn is looked for


@dataclass(frozen=True, eq=False)
class Sample:
    """Points of a mesh's surface that move with it: faces (N,) and barycentric coordinates (N, 3)."""

    faces: Ints
    weights: Floats

    def of(self, values: Floats, faces: Ints) -> Floats:
        """What vertices have (V, ...), at the points: (N, ...)."""
        corners = values[faces[self.faces]]
        return np.asarray(np.einsum("nk,nk...->n...", self.weights, corners))


@dataclass(frozen=True, eq=False)
class Family:
    """Shapes of a mesh that are linear in q (Q,): base (V, 3) + basis (V, 3, Q) q; ``start`` is the mesh as it is."""

    base: Floats = field(repr=False)
    basis: Floats = field(repr=False)
    start: Floats

    def shape(self, q: Floats) -> Floats:
        """Vertices (V, 3)."""
        return np.asarray(self.base + self.basis @ q)


@dataclass(frozen=True, eq=False)
class SurfaceFit:
    """A fitted mesh's vertices (V, 3), and distances (m) of both surfaces' points to the other.

    ``freedom`` is how many numbers the fit was free in, each direction of change counted once.
    """

    vertices: Floats = field(repr=False)
    freedom: int
    distances: Floats = field(repr=False)


def read_mesh(path: Path) -> Mesh:
    """A surface from a PLY file. Raises AnatomyError where there is none."""
    mesh = open3d().io.read_triangle_mesh(str(path))
    if not len(mesh.triangles):
        raise AnatomyError("no triangles", where=path, remedy="is the folder of bone surfaces the right one?")
    return Mesh(np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.triangles, dtype=np.int64))


def rigid(mesh: Mesh) -> Family:
    """The mesh as it is."""
    return Family(mesh.vertices, _translations(mesh), np.zeros(3))


def uniform_scale(mesh: Mesh) -> Family:
    """One scale for the whole."""
    basis = np.concatenate([_translations(mesh), mesh.vertices[:, :, None]], axis=2)
    return Family(np.zeros_like(mesh.vertices), basis, np.array([0.0, 0.0, 0.0, 1.0]))


def affine(mesh: Mesh) -> Family:
    """Every affine map of the whole."""
    linear = np.einsum("ik,vl->vikl", np.eye(3), mesh.vertices).reshape(len(mesh.vertices), 3, 9)
    basis = np.concatenate([_translations(mesh), linear], axis=2)
    return Family(np.zeros_like(mesh.vertices), basis, np.concatenate([np.zeros(3), np.eye(3).ravel()]))


def _translations(mesh: Mesh) -> Floats:
    return np.tile(np.eye(3), (len(mesh.vertices), 1, 1))


def fit_family(mesh: Mesh, family: Family, target: Mesh, *, points: int = 3000, seed: int = 0) -> SurfaceFit:
    """The member of the family of ``mesh`` that lies closest to ``target``, wherever the target is and however turned.

    The first turn is the best of the four that bring the surfaces' principal axes together.
    """
    rng = np.random.default_rng(seed)
    own, there = sample_surface(mesh, points, rng), sample_surface(target, points, rng)
    few, few_there = (Sample(s.faces[::_FEWER], s.weights[::_FEWER]) for s in (own, there))
    starts = [
        _closest_points(mesh, rigid(mesh), target, few, few_there, turn, shift, _FIRST_ROUNDS)
        for turn, shift in _aligned_axes(mesh, target)
    ]
    turn, q, _ = min(starts, key=lambda found: float(np.mean(found[2])))
    turn, q, distances = _closest_points(
        mesh, family, target, own, there, turn, _moved(family, family.start, q), _ROUNDS
    )
    return SurfaceFit(family.shape(q) @ turn.T, _freedom(family), distances)


def _freedom(family: Family) -> int:
    jacobian = np.concatenate([-hat(family.shape(family.start)), family.basis], axis=2)
    return int(np.linalg.matrix_rank(jacobian.reshape(-1, jacobian.shape[2])))


def greatest_length(mesh: Mesh) -> float:
    """The distance (m) of the two points farthest apart."""
    return float(pdist(mesh.vertices[ConvexHull(mesh.vertices).vertices]).max())


def sample_surface(mesh: Mesh, count: int, rng: np.random.Generator) -> Sample:
    """Points spread evenly over a mesh."""
    area = igl.doublearea(mesh.vertices, mesh.faces)
    faces = rng.choice(len(mesh.faces), count, p=area / area.sum())
    return Sample(faces.astype(np.int64), rng.dirichlet(np.ones(3), count))


def _aligned_axes(mesh: Mesh, target: Mesh) -> Iterator[tuple[Floats, Floats]]:
    """Turns (3, 3) that bring principal axes together, and the shift (3,) before each."""
    (middle, axes), (there, other) = _principal(mesh), _principal(target)
    for first, second in product((1.0, -1.0), repeat=2):
        signed = other * np.array([first, second, first * second * np.linalg.det(other) * np.linalg.det(axes)])
        turn = signed @ axes.T
        yield turn, turn.T @ there - middle


def _principal(mesh: Mesh) -> tuple[Floats, Floats]:
    """Middle (3,) and principal axes (columns of (3, 3)) of a surface."""
    points = sample_surface(mesh, 2000, np.random.default_rng(0)).of(mesh.vertices, mesh.faces)
    middle = points.mean(axis=0)
    return middle, np.linalg.eigh(np.cov((points - middle).T))[1]


def _moved(family: Family, q: Floats, shift: Floats) -> Floats:
    """q so changed that the whole mesh moves by ``shift`` (3,)."""
    flat = family.basis.reshape(-1, len(q))
    return np.asarray(q + np.linalg.lstsq(flat, np.tile(shift, len(family.base)), rcond=None)[0])


def _closest_points(
    mesh: Mesh, family: Family, target: Mesh, own: Sample, there: Sample, turn: Floats, q: Floats, rounds: int
) -> tuple[Floats, Floats, Floats]:
    """Turn (3, 3), q and distances (N + M,) after so many Gauss-Newton steps, each with new closest points."""
    goals = there.of(target.vertices, target.faces)
    normals = igl.per_face_normals(target.vertices, target.faces, np.array([0.0, 0.0, 1.0]))
    for step in range(rounds + 1):
        vertices = family.shape(q) @ turn.T
        points = own.of(vertices, mesh.faces)
        squared, faces, nearest = igl.point_mesh_squared_distance(points, target.vertices, target.faces)
        back, own_faces, own_nearest = igl.point_mesh_squared_distance(goals, vertices, mesh.faces)
        distances = np.sqrt(np.concatenate([squared, back]))
        if step == rounds:
            break
        bary = igl.barycentric_coordinates(own_nearest, *(vertices[mesh.faces[own_faces, k]] for k in range(3)))
        both = Sample(np.concatenate([own.faces, own_faces]), np.concatenate([own.weights, bary]))
        residual = np.concatenate([points - nearest, own_nearest - goals])
        normal = np.concatenate([normals[faces], normals[there.faces]])
        before, (turn, q) = q, _step(mesh, family, both, turn, q, residual, normal)
        if np.abs(q - before).max() < _STILL:
            break
    return turn, q, distances


def _step(
    mesh: Mesh, family: Family, points: Sample, turn: Floats, q: Floats, residual: Floats, normals: Floats
) -> tuple[Floats, Floats]:
    """One Gauss-Newton step on residuals (N, 3), weighed up along the normals (N, 3) of the target."""
    at = points.of(family.shape(q), mesh.faces) @ turn.T
    jacobian = np.concatenate([-hat(at), turn @ points.of(family.basis, mesh.faces)], axis=2)
    along = np.einsum("ni,nik->nk", normals, jacobian)
    matrix = np.einsum("nik,nil->kl", jacobian, jacobian, optimize=True) + _PLANE_WEIGHT * along.T @ along
    right = np.einsum("nik,ni->k", jacobian, residual)
    right += _PLANE_WEIGHT * along.T @ np.einsum("ni,ni->n", normals, residual)
    matrix += _DAMPING * np.diag(np.diag(matrix))
    change = -np.linalg.solve(matrix, right)
    return exp_so3(change[:3]) @ turn, q + change[3:]
