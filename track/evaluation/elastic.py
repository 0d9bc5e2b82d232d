"""A limb as one elastic solid around its bones: what the forearm deformer is held against (paper, figure 11).

    argmin_x  sum_t volume_t |F_t(x) - R_t|^2,   R_t the rotation nearest to F_t

over the tetrahedra t of the limb, with points inside a bone fixed to it: as rigid as possible (Sorkine & Alexa 2007),
on solids the same as corotated elasticity with Lame's first parameter zero. libigl minimises it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from adapt.anatomy import Anatomy, Floats, Ints
from adapt.model.body import Body, bone_transforms
from capture.rigid import apply
from track.evaluation.bones import depth_inside

_ITERATIONS = 20  # of local and global steps per move
_CANDIDATES = 24  # tetrahedra looked at for each skin vertex


@dataclass(eq=False)
class Elastic:
    """The solid (N, 3) where it is now. ``held`` are the indices (K,) of the points in each bone."""

    points: Floats = field(repr=False)
    rest: Floats = field(repr=False)
    held: dict[str, Ints] = field(repr=False)
    solver: Any = field(repr=False)
    corners: Ints = field(repr=False)  # (V, 4) of the tetrahedron that each skin vertex is in
    weights: Floats = field(repr=False)  # (V, 4)

    def move(self, body: Body, theta: Floats) -> None:
        """Let the bones of the template ``body`` go to a pose near the last one, and the flesh follow."""
        import igl

        transforms = bone_transforms(body, theta)
        goals = [apply(transforms[name], self.rest[index]) for name, index in self.held.items()]
        self.points = np.asarray(igl.arap_solve(np.concatenate(goals), self.solver, self.points))

    def skin(self) -> Floats:
        """The skin (V, 3) in metres that the solid carries."""
        return np.asarray(np.einsum("vk,vkj->vj", self.weights, self.points[self.corners]))


def make_elastic(anatomy: Anatomy) -> Elastic:
    """The template limb at rest."""
    import igl

    points, tets = anatomy.tetrahedra["limb"]
    depths = np.array([depth_inside(points, bone.vertices, bone.faces) for bone in anatomy.bones])
    deepest = np.where(depths.max(axis=0) > 0.0, depths.argmax(axis=0), -1)
    held = {bone.name: np.flatnonzero(deepest == k) for k, bone in enumerate(anatomy.bones)}
    solver = igl.ARAPData()
    solver.max_iter = _ITERATIONS
    fixed = np.concatenate(list(held.values())).astype(np.int32)
    igl.arap_precomputation(points, tets, 3, fixed, solver)
    return Elastic(points.copy(), points, held, solver, *inside(points, tets, anatomy.skin_vertices))


def inside(points: Floats, tets: Ints, where: Floats) -> tuple[Ints, Floats]:
    """The corners (V, 4) of the tetrahedron that each place (V, 3) is in, or nearly, and the barycentric weights.

    A place a little outside of all has a slightly negative weight: it is carried by linear extrapolation.
    """
    _, near = cKDTree(points[tets].mean(axis=1)).query(where, k=min(_CANDIDATES, len(tets)))
    near = near.reshape(len(where), -1)
    base = points[tets[near, 0]]  # (V, K, 3)
    edges = np.stack([points[tets[near, k]] - base for k in (1, 2, 3)], axis=3)
    rest = np.linalg.solve(edges, (where[:, None] - base)[..., None])[..., 0]
    weights = np.concatenate([1.0 - rest.sum(axis=2, keepdims=True), rest], axis=2)
    best = weights.min(axis=2).argmax(axis=1)
    rows = np.arange(len(where))
    return np.asarray(tets[near[rows, best]]), np.asarray(weights[rows, best])
