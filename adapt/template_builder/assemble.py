"""From a limb's plan to the finished anatomy: the order of the build, one step a function."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Anatomy, Bone, Coordinate, Handle
from adapt.template_builder.bones import bone_surface, envelope
from adapt.template_builder.landmarks import landmarks_of, point_on_body
from adapt.template_builder.meshes import Mesh
from adapt.template_builder.plan import LimbPlan
from adapt.template_builder.pose_bones import Placement
from adapt.template_builder.skin import evened, height_in, smooth_limb
from adapt.template_builder.skin_depth import at_depths
from adapt.template_builder.sources_makehuman import load_skin
from adapt.template_builder.sources_myosim import SourceSkeleton, in_pieces, load_skeleton, restated, shifted
from adapt.template_builder.tetrahedra import TetMesh, evaluate, tetrahedralised, with_corners_at
from adapt.template_builder.weights import bounded_biharmonic, normalised

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Say = Callable[[str], None]

_LIMB_EPSILON = 0.001  # m
_BONE_EPSILON = 0.0006  # m
_LEAST_WEIGHT = 1e-3  # of a deformer: it costs time wherever it has any
_BONE_REACH = 0.006  # m, how far a corner may be moved onto a handle


def build_anatomy(plan: LimbPlan, say: Say) -> tuple[Anatomy, dict[str, float]]:
    """Build a limb; also the pose's hinge angles (rad) and log scales, for the record.

    Raises:
        AnatomyError: a source is missing, or a step cannot be done as planned.
    """
    say = _timed(say)
    rig = load_skin(plan.skin.targets, stature=plan.skin.stature)
    tip = rig.joints[plan.skin.tip]
    smooth = smooth_limb(rig.vertices, rig.quads, plan.skin.cuts[0], tip)
    drawn, is_cap = evened(smooth, plan.skin.cuts, tip, count=plan.skin.count)

    skeleton = shifted(source_of(plan), plan.shifts)
    pose, placements = plan.pose(skeleton, rig, smooth)
    say("bones posed")
    surfaces = {bone.name: bone_surface(skeleton, placements, bone) for bone in plan.bones}
    names, landmarks = landmarks_of(skeleton, placements, plan, pose)
    handles, heads = _handles(skeleton, placements, plan), _heads(skeleton, placements, plan)
    places = dict(zip(names, landmarks, strict=True))
    skin, field = at_depths(drawn, is_cap, surfaces, places, plan.spots, plan.clearance)
    say(f"skin: {len(skin.vertices)} vertices, moved by {1e3 * field.min():.1f} to {1e3 * field.max():.1f} mm")

    inside = {bone.name: envelope(surfaces[bone.name], bone) for bone in plan.bones}
    tets = _tetrahedra(plan, inside, skin)
    say("tetrahedra: " + ", ".join(f"{name} {len(mesh.tets)}" for name, mesh in tets.items()))

    bones = _bones(plan, surfaces, tets, handles, heads)
    tets["limb"], handle_weights = _handle_weights(tets["limb"], heads, [*range(len(heads))], within=plan.skin.tet_edge)
    deformer_weights = _deformer_weights(tets["limb"], plan, inside, places)
    say("weights")

    anatomy = Anatomy(
        name=plan.name,
        side=plan.side,
        bones=bones,
        joints=plan.joints,
        coordinates=tuple(_at_rest(coordinate, plan, pose) for coordinate in plan.coordinates),
        handles=handles,
        deformers=plan.deformers,
        landmark_names=names,
        landmarks=landmarks,
        landmark_handle_weights=evaluate(tets["limb"], handle_weights, landmarks),
        skin_vertices=skin.vertices,
        skin_faces=skin.faces,
        skin_handle_weights=evaluate(tets["limb"], handle_weights, skin.vertices),
        deformer_weights=evaluate(tets["limb"], deformer_weights, skin.vertices),
        fit_weight=_fit_weight(plan, skin.vertices, is_cap, places),
        tetrahedra={name: (mesh.points, mesh.tets) for name, mesh in tets.items()},
    )
    return anatomy, pose


def _tetrahedra(plan: LimbPlan, inside: dict[str, Mesh], skin: Mesh) -> dict[str, TetMesh]:
    """Every bone's envelope and the whole limb, filled with tetrahedra."""
    tets = {
        bone.name: tetrahedralised(inside[bone.name], edge=bone.tet_edge, epsilon=_BONE_EPSILON) for bone in plan.bones
    }
    tets["limb"] = tetrahedralised(skin, edge=plan.skin.tet_edge, epsilon=_LIMB_EPSILON)
    return tets


def _bones(
    plan: LimbPlan,
    surfaces: dict[str, Mesh],
    tets: dict[str, TetMesh],
    handles: tuple[Handle, ...],
    heads: list[Floats],
) -> tuple[Bone, ...]:
    """The bones with their own handles' weights; their tetrahedra get corners at these handles."""
    bones = []
    for bone in plan.bones:
        own = [index for index, handle in enumerate(handles) if handle.bone == bone.name]
        tets[bone.name], weights = _handle_weights(tets[bone.name], heads, own, within=_BONE_REACH)
        surface = surfaces[bone.name]
        at_vertices = evaluate(tets[bone.name], weights, surface.vertices)
        bones.append(Bone(bone.name, bone.frame, surface.vertices, surface.faces, at_vertices))
    return tuple(bones)


def source_of(plan: LimbPlan) -> SourceSkeleton:
    """The source skeleton as a plan wants it, at its own size."""
    skeleton = load_skeleton(plan.bodies, without=plan.without, follows=plan.follows)
    return in_pieces(restated(skeleton, plan.stated), plan.pieces)


def _handles(skeleton: SourceSkeleton, placements: dict[str, Placement], plan: LimbPlan) -> tuple[Handle, ...]:
    made = []
    for handle in plan.handles:
        x, y, z = placements[handle.point.body].points(point_on_body(skeleton, handle.point))
        made.append(Handle(handle.name, handle.bone, handle.joint, (float(x), float(y), float(z))))
    return tuple(made)


def _heads(skeleton: SourceSkeleton, placements: dict[str, Placement], plan: LimbPlan) -> list[Floats]:
    """For each handle the points (K, 3) at which it has all the weight, its own position first."""
    return [
        np.array([placements[p.body].points(point_on_body(skeleton, p)) for p in (handle.point, *handle.also)])
        for handle in plan.handles
    ]


def _handle_weights(mesh: TetMesh, heads: list[Floats], own: list[int], *, within: float) -> tuple[TetMesh, Floats]:
    """Weights (N, H) of the handles ``own`` at the corners of a mesh; the others have no part in it."""
    mesh, corners = with_corners_at(mesh, np.concatenate([heads[index] for index in own]), within=within)
    ends = np.cumsum([len(heads[index]) for index in own])[:-1]
    weights = np.zeros((len(mesh.points), len(heads)))
    weights[:, own] = bounded_biharmonic(mesh, np.split(corners, ends))
    return mesh, weights


def _deformer_weights(mesh: TetMesh, plan: LimbPlan, inside: dict[str, Mesh], landmarks: dict[str, Floats]) -> Floats:
    """Weights (N, D) of the deformers inside the limb; what a deformer holds belongs to it alone."""
    owner = holders(mesh.points, plan, inside, landmarks)
    weights = bounded_biharmonic(mesh, [np.flatnonzero(owner == index) for index in range(len(plan.deformers))])
    return normalised(np.where(weights < _LEAST_WEIGHT, 0.0, weights))


def holders(points: Floats, plan: LimbPlan, inside: dict[str, Mesh], landmarks: dict[str, Floats]) -> Ints:
    """Which deformer (N,) holds points (N, 3) of the limb, by its bones ``inside`` or a cushion; -1: none does."""
    inside_bone = {name: surface.depth(points) for name, surface in inside.items()}
    depth = {(deformer.name, bone): inside_bone[bone] for deformer in plan.deformers for bone in deformer.bones}
    for held in plan.held:
        along = _along(points, landmarks[held.start], landmarks[held.end])
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


def _along(points: Floats, start: Floats, end: Floats) -> Floats:
    """Distance (N,) m of points from ``start`` in the direction of ``end``."""
    return np.asarray((points - start) @ (end - start) / np.linalg.norm(end - start))


def _at_rest(coordinate: Coordinate, plan: LimbPlan, pose: dict[str, float]) -> Coordinate:
    if coordinate.name not in plan.rest_from:
        return coordinate
    hinge, sign = plan.rest_from[coordinate.name]
    return replace(coordinate, rest=sign * pose[hinge])


def _fit_weight(plan: LimbPlan, skin: Floats, is_cap: NDArray[np.bool_], landmarks: dict[str, Floats]) -> Floats:
    """How much skin vertices (V,) count in fitting: less near the cut and along the ramps, nothing on the cap."""
    weight = np.interp(height_in(plan.skin.cuts, skin), *plan.fit_near_cut)
    for ramp in plan.fit_ramps:
        distance = _along(skin, landmarks[ramp.start], landmarks[ramp.end])
        weight = weight * np.interp(distance, ramp.at, ramp.values)
    return np.where(is_cap, 0.0, weight)


def _timed(say: Say) -> Say:
    start = time.monotonic()
    return lambda message: say(f"[{time.monotonic() - start:5.0f} s] {message}")
