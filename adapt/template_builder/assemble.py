"""From a limb's plan to the finished anatomy: the order of the build, one step a function."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Anatomy, Bone, Coordinate, Handle
from adapt.template_builder.bones import bone_surface, envelope
from adapt.template_builder.landmarks import landmarks_of
from adapt.template_builder.meshes import Mesh
from adapt.template_builder.plan import AnatomyPlan, LimbPlan
from adapt.template_builder.skin import evened, height_in, smooth_limb
from adapt.template_builder.skin_depth import at_depths
from adapt.template_builder.skinning import (
    along_line,
    bone_weights,
    handles_of,
    heads_of,
    weights_of_deformers,
    weights_of_handles,
)
from adapt.template_builder.sources_makehuman import load_skin
from adapt.template_builder.sources_myosim import SourceSkeleton, in_pieces, load_skeleton, restated, shifted
from adapt.template_builder.tetrahedra import TetMesh, evaluate, tetrahedralised

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Say = Callable[[str], None]

_LIMB_EPSILON = 0.001  # m
_BONE_EPSILON = 0.0006  # m


def build_anatomy(plan: LimbPlan, say: Say) -> tuple[Anatomy, dict[str, float]]:
    """Build a limb; also the pose's hinge angles (rad) and log scales, for the record.

    Raises:
        AnatomyError: a source is missing, or a step cannot be done as planned.
    """
    say = timed(say)
    rig = load_skin(plan.skin.targets, stature=plan.skin.stature)
    tip = rig.joints[plan.skin.tip]
    smooth = smooth_limb(rig.vertices, rig.quads, plan.skin.cuts[0], tip)
    drawn, is_cap = evened(smooth, plan.skin.cuts, tip, count=plan.skin.count)

    skeleton = shifted(source_of(plan), plan.shifts)
    pose, placements = plan.pose(skeleton, rig, smooth)
    say("bones posed")
    surfaces = {bone.name: bone_surface(skeleton, placements, bone) for bone in plan.bones}
    names, landmarks = landmarks_of(skeleton, placements, plan, pose)
    handles, heads = handles_of(skeleton, placements, plan), heads_of(skeleton, placements, plan)
    places = dict(zip(names, landmarks, strict=True))
    skin, field = at_depths(drawn, is_cap, surfaces, places, plan.spots, plan.clearance)
    say(f"skin: {len(skin.vertices)} vertices, moved by {1e3 * field.min():.1f} to {1e3 * field.max():.1f} mm")

    inside = {bone.name: envelope(surfaces[bone.name], bone) for bone in plan.bones}
    tets = _tetrahedra(plan, inside, skin)
    say("tetrahedra: " + ", ".join(f"{name} {len(mesh.tets)}" for name, mesh in tets.items()))

    bones = _bones(plan, surfaces, tets, handles, heads)
    tets["limb"], by_handle = weights_of_handles(tets["limb"], heads, [*range(len(heads))], within=plan.skin.tet_edge)
    deformer_weights = weights_of_deformers(tets["limb"], plan, inside, places)
    say("weights")

    anatomy = Anatomy(
        name=plan.name,
        side=plan.side,
        bones=bones,
        joints=plan.joints,
        coordinates=tuple(at_rest(coordinate, plan, pose) for coordinate in plan.coordinates),
        handles=handles,
        deformers=plan.deformers,
        landmark_names=names,
        landmarks=landmarks,
        landmark_handle_weights=evaluate(tets["limb"], by_handle, landmarks),
        skin_vertices=skin.vertices,
        skin_faces=skin.faces,
        skin_handle_weights=evaluate(tets["limb"], by_handle, skin.vertices),
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
        tets[bone.name], weights = bone_weights(bone.name, surfaces[bone.name], tets[bone.name], handles, heads)
        bones.append(Bone(bone.name, bone.frame, surfaces[bone.name].vertices, surfaces[bone.name].faces, weights))
    return tuple(bones)


def source_of(plan: LimbPlan) -> SourceSkeleton:
    """The source skeleton as a plan wants it, at its own size."""
    skeleton = load_skeleton(plan.bodies, without=plan.without, follows=plan.follows)
    return in_pieces(restated(skeleton, plan.stated), plan.pieces)


def at_rest(coordinate: Coordinate, plan: AnatomyPlan, pose: dict[str, float]) -> Coordinate:
    """The coordinate with its rest value, where the pose's angles (rad) by name have it."""
    if coordinate.name not in plan.rest_from:
        return coordinate
    hinge, sign = plan.rest_from[coordinate.name]
    return replace(coordinate, rest=sign * pose[hinge])


def _fit_weight(plan: LimbPlan, skin: Floats, is_cap: NDArray[np.bool_], landmarks: dict[str, Floats]) -> Floats:
    """How much skin vertices (V,) count in fitting: less near the cut and along the ramps, nothing on the cap."""
    weight = np.interp(height_in(plan.skin.cuts, skin), *plan.fit_near_cut)
    for ramp in plan.fit_ramps:
        distance = along_line(skin, landmarks[ramp.start], landmarks[ramp.end])
        weight = weight * np.interp(distance, ramp.at, ramp.values)
    return np.where(is_cap, 0.0, weight)


def timed(say: Say) -> Say:
    """The same, with the seconds since now before every message."""
    start = time.monotonic()
    return lambda message: say(f"[{time.monotonic() - start:5.0f} s] {message}")
