"""Pose the source skeleton inside the skin: hinge angles, one root pose and a scale per group of bodies.

What is minimised, by least squares over the parameters q = (root rotation and position, hinge angles, log scales):

    sum over bone vertices   (max(0, c - depth) / s)^2        every bone keeps a clearance c beneath the skin
    sum over landmarks       ((depth - d) / s)^2              bony points lie just beneath it
    sum over joint centres   |x(q) - x_skin|^2 / s^2          joints lie where the skin's rig has them
    sum over directions      |u(q) - u_skin|^2 / s^2          the hand faces the way the skin's hand does
    sum over parameters      ((q - q0) / s)^2                 prior knowledge

Bones stay rigid but for one scale per group: uniform, or others along the shaft (y) than across it (x and z).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import igl
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial import cKDTree

from adapt.template_builder.meshes import Mesh
from adapt.template_builder.sources_myosim import SourceSkeleton
from capture.rigid import exp_so3

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Placement:
    """Where a body goes: x' = rotation @ (scale * x) + translation."""

    rotation: Floats  # (3, 3)
    translation: Floats  # (3,) m
    scale: Floats  # (3,)

    def points(self, points: Floats) -> Floats:
        """Place points (N, 3) or (3,) of the body's frame."""
        return np.asarray((points * self.scale) @ self.rotation.T + self.translation)

    def inverse(self, points: Floats) -> Floats:
        """The points (N, 3) or (3,) of the body's frame that go there."""
        return np.asarray(((points - self.translation) @ self.rotation) / self.scale)

    def direction(self, direction: Floats) -> Floats:
        """Place a unit direction (3,) of the body's frame, stretched as the body is."""
        placed = self.rotation @ (self.scale * direction)
        return np.asarray(placed / np.linalg.norm(placed))


@dataclass(frozen=True)
class Unknown:
    """One parameter: its prior, how sure we are of it, its bounds and where the search starts."""

    name: str
    prior: float
    spread: float
    low: float = -np.inf
    high: float = np.inf


@dataclass(frozen=True)
class Target:
    """A point of a body (m, in its frame) and the point it should come to, within ``spread`` (m)."""

    body: str
    point: Floats
    goal: Floats
    spread: float


@dataclass(frozen=True)
class DepthTarget:
    """A point of a body (m, in its frame) that should lie ``depth`` (m) beneath the skin, within ``spread`` (m)."""

    body: str
    point: Floats
    depth: float
    spread: float


@dataclass(frozen=True)
class DirectionTarget:
    """The direction from one body's origin to another's, and the unit direction it should take."""

    first: str
    second: str
    goal: Floats
    spread: float


@dataclass(frozen=True)
class PoseProblem:
    """Everything the fit needs. ``scale_of`` names each body's scale unknowns along its x, y and z."""

    skeleton: SourceSkeleton
    root: str
    scale_of: dict[str, tuple[str, str, str]]
    unknowns: tuple[Unknown, ...]
    fixed: dict[str, float]
    clearance: dict[str, float]  # bodies whose vertices must stay this far (m) beneath the skin
    targets: tuple[Target, ...] = ()
    depths: tuple[DepthTarget, ...] = ()
    directions: tuple[DirectionTarget, ...] = ()
    spread: float = field(default=0.002)  # m, of the clearance


ROOT = ("root_rx", "root_ry", "root_rz", "root_tx", "root_ty", "root_tz")


def placed_bodies(problem: PoseProblem, values: dict[str, float]) -> dict[str, Placement]:
    """Forward kinematics: every body's placement for parameter values by name (rad, m, log scale)."""
    placements: dict[str, Placement] = {}
    for name, body in problem.skeleton.bodies.items():
        scale = np.exp([values[unknown] for unknown in problem.scale_of[name]])
        if name == problem.root:
            rotation = exp_so3(np.array([values[key] for key in ROOT[:3]]))
            translation = np.array([values[key] for key in ROOT[3:]])
        else:
            parent = placements[body.parent]
            turned, position = body.in_parent(values)
            rotation, anchor = parent.rotation @ turned, body.anchor()
            translation = parent.points(position + turned @ anchor) - rotation @ (scale * anchor)
        placements[name] = Placement(rotation, translation, scale)
    return placements


def fit_pose(
    problem: PoseProblem, depth: Callable[[Floats], Floats], *, start: dict[str, float] | None = None
) -> dict[str, float]:
    """Solve the least-squares problem from ``start`` (by name; else from the priors).

    Returns:
        The values of all parameters by name, fixed ones included.
    """
    names = [unknown.name for unknown in problem.unknowns]
    prior = np.array([unknown.prior for unknown in problem.unknowns])
    spread = np.array([unknown.spread for unknown in problem.unknowns])

    def residuals(q: Floats) -> Floats:
        placed = placed_bodies(problem, problem.fixed | dict(zip(names, q, strict=True)))
        return np.concatenate([_geometry(problem, placed, depth), (q - prior) / spread])

    bounds = ([unknown.low for unknown in problem.unknowns], [unknown.high for unknown in problem.unknowns])
    first = prior if start is None else np.array([start[name] for name in names])
    found = least_squares(residuals, first, bounds=bounds, x_scale=np.minimum(spread, 0.2), diff_step=1e-4)
    return problem.fixed | dict(zip(names, map(float, found.x), strict=True))


def _geometry(problem: PoseProblem, placed: dict[str, Placement], depth: Callable[[Floats], Floats]) -> Floats:
    vertices = [placed[name].points(problem.skeleton.bodies[name].vertices) for name in problem.clearance]
    clearance = np.repeat(list(problem.clearance.values()), [len(points) for points in vertices])
    marks = [placed[mark.body].points(mark.point)[None] for mark in problem.depths]
    depths = depth(np.concatenate([np.zeros((0, 3)), *vertices, *marks]))
    bone, mark = np.split(depths, [len(depths) - len(marks)])
    wanted = np.array([mark.depth for mark in problem.depths])
    sure = np.array([mark.spread for mark in problem.depths])
    parts = [np.maximum(0.0, clearance - bone) / problem.spread, (mark - wanted) / sure]
    parts += [(placed[t.body].points(t.point) - t.goal) / t.spread for t in problem.targets]
    for d in problem.directions:
        along = placed[d.second].translation - placed[d.first].translation
        parts.append((along / np.linalg.norm(along) - d.goal) / d.spread)
    return np.concatenate(parts)


def depth_beneath(skin: Mesh) -> Callable[[Floats], Floats]:
    """A quick depth (m) beneath a finely triangulated closed skin: distance to the nearest vertex's plane.

    Exact enough (about 0.2 mm at 2 mm edges) for thousands of evaluations in a fit; checks use the exact distance.
    """
    tree = cKDTree(skin.vertices)
    normals = np.asarray(igl.per_vertex_normals(skin.vertices, skin.faces))
    half_edge = 0.5 * skin.mean_edge()

    def depth(points: Floats) -> Floats:
        distance, nearest = tree.query(points)
        along = np.einsum("ij,ij->i", skin.vertices[nearest] - points, normals[nearest])
        beyond = np.sqrt(np.maximum(distance**2 - half_edge**2, along**2))
        return np.asarray(np.where(along < 0.0, -beyond, beyond))

    return depth


def source_at(skeleton: SourceSkeleton, angles: dict[str, float]) -> dict[str, Placement]:
    """The source skeleton at its own size, root at the origin, with hinge angles by name (rad; others 0)."""
    root = next(iter(skeleton.bodies))
    values = dict.fromkeys(ROOT, 0.0) | {"log_one": 0.0} | angles
    scale_of = dict.fromkeys(skeleton.bodies, ("log_one", "log_one", "log_one"))
    return placed_bodies(PoseProblem(skeleton, root, scale_of, (), {}, {}), values)
