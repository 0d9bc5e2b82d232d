"""Handles and weights of an anatomy: where handles stand, and how far their influence and the deformers' reach."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Handle
from adapt.template_builder.landmarks import point_on_body
from adapt.template_builder.meshes import Mesh
from adapt.template_builder.plan import AnatomyPlan
from adapt.template_builder.pose_bones import Placement
from adapt.template_builder.sources_myosim import SourceSkeleton
from adapt.template_builder.tetrahedra import TetMesh, evaluate, with_corners_at
from adapt.template_builder.weights import bounded_biharmonic, normalised

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_LEAST_WEIGHT = 1e-3  # of a deformer: it costs time wherever it has any
_BONE_REACH = 0.006  # m, how far a corner may be moved onto a handle


def handles_of(skeleton: SourceSkeleton, placements: dict[str, Placement], plan: AnatomyPlan) -> tuple[Handle, ...]:
    """The plan's handles where they stand."""
    made = []
    for handle in plan.handles:
        x, y, z = placements[handle.point.body].points(point_on_body(skeleton, handle.point))
        made.append(Handle(handle.name, handle.bone, handle.joint, (float(x), float(y), float(z))))
    return tuple(made)


def heads_of(skeleton: SourceSkeleton, placements: dict[str, Placement], plan: AnatomyPlan) -> list[Floats]:
    """For each handle the points (K, 3) at which it has all the weight, its own position first."""
    return [
        np.array([placements[p.body].points(point_on_body(skeleton, p)) for p in (handle.point, *handle.also)])
        for handle in plan.handles
    ]


def bone_weights(
    name: str,
    surface: Mesh,
    mesh: TetMesh,
    handles: tuple[Handle, ...],
    heads: list[Floats],
    *,
    within: float = _BONE_REACH,
    exact: bool = True,
) -> tuple[TetMesh, Floats]:
    """The tetrahedra of a bone with corners at its own handles, and these handles' weights (N, H) at its vertices."""
    own = [index for index, handle in enumerate(handles) if handle.bone == name]
    mesh, weights = weights_of_handles(mesh, heads, own, within=within, exact=exact)
    return mesh, evaluate(mesh, weights, surface.vertices)


def weights_of_handles(
    mesh: TetMesh, heads: list[Floats], own: list[int], *, within: float, exact: bool = True
) -> tuple[TetMesh, Floats]:
    """Weights (N, H) of the handles ``own`` at the corners of a mesh; the others have no part in it."""
    mesh, corners = with_corners_at(mesh, np.concatenate([heads[index] for index in own]), within=within, exact=exact)
    ends = np.cumsum([len(heads[index]) for index in own])[:-1]
    weights = np.zeros((len(mesh.points), len(heads)))
    weights[:, own] = bounded_biharmonic(mesh, np.split(corners, ends))
    return mesh, weights


def weights_of_deformers(
    mesh: TetMesh, plan: AnatomyPlan, inside: dict[str, Mesh], landmarks: dict[str, Floats]
) -> Floats:
    """Weights (N, D) of the deformers inside the limb; what a deformer holds belongs to it alone."""
    owner = holders(mesh.points, plan, inside, landmarks)
    weights = bounded_biharmonic(mesh, [np.flatnonzero(owner == index) for index in range(len(plan.deformers))])
    return normalised(np.where(weights < _LEAST_WEIGHT, 0.0, weights))


def holders(points: Floats, plan: AnatomyPlan, inside: dict[str, Mesh], landmarks: dict[str, Floats]) -> Ints:
    """Which deformer (N,) holds points (N, 3) of the limb, by its bones ``inside`` or a cushion; -1: none does."""
    inside_bone = {name: surface.depth(points) for name, surface in inside.items()}
    depth = {(deformer.name, bone): inside_bone[bone] for deformer in plan.deformers for bone in deformer.bones}
    for held in plan.held:
        along = along_line(points, landmarks[held.start], landmarks[held.end])
        key = held.deformer, held.bone
        depth[key] = np.where(along > held.beyond, depth[key], -np.inf)
    deepest = np.stack([np.max([depth[d.name, bone] for bone in d.bones], axis=0) for d in plan.deformers])
    owner = np.where(deepest.max(axis=0) > 0.0, np.argmax(deepest, axis=0), -1)
    numbers = {deformer.name: number for number, deformer in enumerate(plan.deformers)}
    for held in plan.held:
        around = depth[held.deformer, held.bone] > -held.around
        owner = np.where(around & (owner == -1), numbers[held.deformer], owner)
    for cushion in plan.cushions:
        near = np.linalg.norm(points - landmarks[cushion.landmark], axis=1) < cushion.radius
        carrier = next(k for k, deformer in enumerate(plan.deformers) if cushion.bone in deformer.bones)
        owner = np.where(near & (owner == -1), carrier, owner)
    return np.asarray(owner)


def along_line(points: Floats, start: Floats, end: Floats) -> Floats:
    """Distance (N,) m of points from ``start`` in the direction of ``end``."""
    return np.asarray((points - start) @ (end - start) / np.linalg.norm(end - start))
