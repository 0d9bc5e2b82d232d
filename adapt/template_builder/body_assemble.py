"""From the body's plan to the finished anatomy: built right and middle, then mirrored."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Anatomy, Bone, Coordinate, Handle, Joint
from adapt.mirror import mirrored_points
from adapt.template_builder import bones as bones_module
from adapt.template_builder import meshes, skin_depth, skinning, tetrahedra, weights
from adapt.template_builder.assemble import Say, at_rest, timed
from adapt.template_builder.body import BLADE, BODY, COUNT, FINER, SHOULDER, SPINE, TET_EDGE, TET_FINER
from adapt.template_builder.body_along import riding_along
from adapt.template_builder.body_bones import MIDDLE
from adapt.template_builder.body_rest import arc_at_rest, arm_at_rest, blade_at_rest
from adapt.template_builder.body_skin import other_side, stretched, unstretched
from adapt.template_builder.body_source import PosedBody, posed_body
from adapt.template_builder.bones import bone_surface
from adapt.template_builder.deformer_cores import convex_hull, core_weights, trunk_cores
from adapt.template_builder.depth_grid import smoothed
from adapt.template_builder.landmarks import landmarks_of
from adapt.template_builder.meshes import Mesh
from adapt.template_builder.skin_depth import at_depths
from adapt.template_builder.skinning import along_line, bone_weights, handles_of, heads_of, weights_of_handles
from adapt.template_builder.stages import Stages
from adapt.template_builder.tetrahedra import TetMesh, evaluate, on_grid
from adapt.template_builder.two_sides import (
    images,
    left_bone,
    left_name,
    named_deformer,
    named_frame,
    named_joint,
    right_name,
    with_left_coordinates,
    with_left_deformers,
    with_left_handles,
    with_left_joints,
)

Floats = NDArray[np.float64]

_LEAST_WEIGHT = 1e-3  # of a handle far off: zero, so that files stay small
name = right_name(MIDDLE)


@dataclass(frozen=True)
class Handles:
    """The handles of both sides, and where each has all the weight: (K, 3) m, its own position first."""

    all: tuple[Handle, ...]
    heads: list[Floats]


def build_body(say: Say, stages: Stages) -> tuple[Anatomy, PosedBody]:
    """Build the whole body; also the posed source, for the record and the checks.

    Raises:
        AnatomyError: a source is missing, or a step cannot be done as planned.
    """
    say = timed(say)
    body = posed_body(COUNT, FINER, stages)
    say("skeleton posed in the skin")
    surfaces, inside = stages.kept("bones", (BODY.bones, body.pose, bones_module, meshes), lambda: _surfaces(body))
    places, rests = _landmarks(body), _rests(body)
    skin = stages.kept(
        "depths",
        (body.skin, *surfaces.values(), BODY.spots, BODY.clearance, skin_depth, places),
        lambda: _at_depths(body, surfaces, places),
    )
    say(f"skin: {len(skin.vertices)} vertices; {len(surfaces)} bones")
    handles = _handles(body)
    bones = _bones(surfaces, inside, handles, stages)
    say("bones' weights")

    volume, by_handle = _influence(body, handles, stages)
    say(f"handles' weights in {len(volume.tets)} tetrahedra")
    names, landmarks = _both_sides(places)
    deformers = with_left_deformers(tuple(named_deformer(deformer, name) for deformer in BODY.deformers))
    cores = inside | trunk_cores(body)
    by_deformer = core_weights(volume, cores, dict(zip(names, landmarks, strict=True)), deformers, stages)
    say("deformers' weights")
    joints = with_left_joints(_in_order(_joints()))
    anatomy = Anatomy(
        name=BODY.name,
        side="both",
        bones=bones,
        joints=joints,
        coordinates=with_left_coordinates(_coordinates(body, rests), joints),
        handles=handles.all,
        deformers=deformers,
        landmark_names=names,
        landmarks=landmarks,
        landmark_handle_weights=_sparse(evaluate(volume, by_handle, landmarks)),
        skin_vertices=skin.vertices,
        skin_faces=skin.faces,
        skin_handle_weights=_alike(skin, volume, by_handle, [handle.name for handle in handles.all]),
        deformer_weights=_alike(skin, volume, by_deformer, [deformer.name for deformer in deformers]),
        fit_weight=_fit_weight(skin.vertices, dict(zip(names, landmarks, strict=True))),
        tetrahedra={"limb": (volume.points, volume.tets)},
    )
    return replace(anatomy, bones=riding_along(anatomy)), body


def _influence(body: PosedBody, handles: Handles, stages: Stages) -> tuple[TetMesh, Floats]:
    """The body's tetrahedra with corners at the handles, and the handles' weights (N, H) at all corners."""
    volume = stages.kept("tetrahedra", (body.skin, TET_EDGE, TET_FINER, tetrahedra), lambda: _filled(body))
    every = [*range(len(handles.heads))]
    return stages.kept(
        "handles",
        (volume.points, *handles.heads, skinning, weights),
        lambda: weights_of_handles(volume, handles.heads, every, within=TET_EDGE, exact=False),
    )


def _joints() -> tuple[Joint, ...]:
    """The joints of the right side and the middle; a knee's tables are met by landmarks that are placed elsewhere."""
    splines = (spline.joint(np.asarray)[0] for spline in BODY.splines)
    joints = (*(joint for joint in BODY.joints if joint.type != "spline"), *splines)
    return tuple(named_joint(joint, name) for joint in joints)


def _surfaces(body: PosedBody) -> tuple[dict[str, Mesh], dict[str, Mesh]]:
    """Surfaces of right and middle bones by their names in the anatomy; the same, or hulls of those in parts."""
    whole = body.with_both_hips()
    surfaces = {
        name(bone.name): bone_surface(
            whole, body.placements, bone, lambda mesh, plan: smoothed(mesh, spacing=plan.spacing, blur=plan.blur)
        )
        for bone in BODY.bones
    }
    hulls = {
        name(bone.name): convex_hull(surfaces[name(bone.name)].vertices) if bone.envelope else surfaces[name(bone.name)]
        for bone in BODY.bones
    }
    return surfaces, hulls


def _landmarks(body: PosedBody) -> dict[str, Floats]:
    """The landmarks of the right side and the middle, which lie in it."""
    names, points = landmarks_of(body.skeleton, body.placements, BODY, body.pose)
    _, ellipsoid = blade_at_rest(body.placements["thorax"], body.placements["scapula_r"])
    found = dict(zip(names, points, strict=True)) | ellipsoid
    return {name(n): at * [1.0, 1.0, 0.0] if n in MIDDLE else at for n, at in found.items()}


def _both_sides(right: dict[str, Floats]) -> tuple[tuple[str, ...], Floats]:
    left = {left_name(n): mirrored_points(at) for n, at in right.items() if left_name(n) != n}
    both = right | left
    return tuple(both), np.array(list(both.values()))


def _rests(body: PosedBody) -> dict[str, float]:
    """The rest values (rad) that the pose's hinges do not have, by coordinates' names without a side."""
    placed = body.placements
    blade, _ = blade_at_rest(placed["thorax"], placed["scapula_r"])
    arm = arm_at_rest(placed["scapula_r"], placed["humerus_r"])
    ends = {"lumbar": ("lumbar5", "lumbar3", "thorax"), "neck": ("c7", "c4", "head")}
    arcs = {joint: arc_at_rest(*(placed[b].translation for b in bodies)) for joint, bodies in ends.items()}
    thorax = placed["thorax"]
    arcs["thoracic_spine"] = arc_at_rest(
        thorax.translation, thorax.points(np.array([-0.040, 0.142, 0.0])), placed["c7"].translation
    )
    return dict(zip((*BLADE, *SHOULDER), map(float, (*blade, *arm)), strict=True)) | {
        SPINE[joint][1]: angle for joint, angle in arcs.items()
    }


def _coordinates(body: PosedBody, rests: dict[str, float]) -> tuple[Coordinate, ...]:
    """The coordinates of the right side and the middle with their rest values; a spine's range is about its rest."""
    extensions = {names[1] for names in SPINE.values()}
    made = []
    for coordinate in BODY.coordinates:
        c = at_rest(coordinate, BODY, body.pose)
        rest = rests.get(c.name, c.rest)
        shift = rest if c.name in extensions else 0.0
        made.append(replace(c, name=name(c.name), rest=rest, low=c.low + shift, high=c.high + shift))
    return tuple(made)


def _handles(body: PosedBody) -> Handles:
    plan = replace(
        BODY, handles=tuple(replace(h, name=name(h.name), bone=name(h.bone), joint=name(h.joint)) for h in BODY.handles)
    )
    right, heads = handles_of(body.skeleton, body.placements, plan), heads_of(body.skeleton, body.placements, plan)
    middle = [left_name(h.name) == h.name for h in right]
    right = tuple(
        replace(h, position=(h.position[0], h.position[1], 0.0)) if m else h for h, m in zip(right, middle, strict=True)
    )
    heads = [points * [1.0, 1.0, 0.0] if m else points for points, m in zip(heads, middle, strict=True)]
    left = [mirrored_points(points) for points, m in zip(heads, middle, strict=True) if not m]
    return Handles(with_left_handles(right), [*heads, *left])


def _bones(surfaces: dict[str, Mesh], inside: dict[str, Mesh], handles: Handles, stages: Stages) -> tuple[Bone, ...]:
    """All bones with their own handles' weights, the left ones images of the right ones."""
    swap = images(tuple(h.name for h in handles.all))
    made: list[Bone] = []
    for plan in BODY.bones:
        own = name(plan.name)
        surface = surfaces[own]
        heads = [points for points, handle in zip(handles.heads, handles.all, strict=True) if handle.bone == own]
        tets = on_grid(inside[own], edge=plan.tet_edge)
        shares = stages.kept(
            f"weights-{own}",
            (surface, tets.points, *heads, skinning, weights),
            partial(_weights_of, plan.tet_edge, own, surface, tets, handles),
        )
        made.append(Bone(own, named_frame(plan.frame, name), surface.vertices, surface.faces, _sparse(shares)))
    return (*made, *(left_bone(bone, swap) for bone in made if left_name(bone.name) != bone.name))


def _weights_of(edge: float, bone: str, surface: Mesh, tets: TetMesh, handles: Handles) -> Floats:
    return bone_weights(bone, surface, tets, handles.all, handles.heads, within=edge, exact=False)[1]


def _at_depths(body: PosedBody, surfaces: dict[str, Mesh], places: dict[str, Floats]) -> Mesh:
    """The skin moved until the right bones lie as deep as people's; the left half is the right one's image again."""
    spots = tuple(
        replace(spot, bone=name(spot.bone), at=name(spot.at), to=name(spot.to) if spot.to else "")
        for spot in BODY.spots
    )
    clearance = {name(bone): depth for bone, depth in BODY.clearance.items()}
    right = {
        bone: Mesh(surface.vertices[surface.vertices[:, 2] > -0.012], surface.faces[:0])
        for bone, surface in surfaces.items()
    }
    held = np.zeros(len(body.skin.vertices), dtype=bool)
    moved, _ = at_depths(body.skin, held, right, places, spots, clearance)
    other, z = other_side(body.skin.vertices), body.skin.vertices[:, 2]
    vertices = np.where(z[:, None] < 0.0, mirrored_points(moved.vertices[other]), moved.vertices)
    vertices[z == 0.0, 2] = 0.0
    return Mesh(vertices, moved.faces)


def _filled(body: PosedBody) -> TetMesh:
    """Tetrahedra around the skin as drawn: in a space where hands and feet are large, so that theirs are small."""
    large = Mesh(stretched(body.skin.vertices, body.rig, TET_FINER), body.skin.faces)
    filled = on_grid(large, edge=TET_EDGE)
    return TetMesh(unstretched(filled.points, body.rig, TET_FINER), filled.tets)


def _alike(skin: Mesh, volume: TetMesh, shares: Floats, names: list[str]) -> Floats:
    """Weights (V, K) of the skin by names, from (N, K) at corners, alike on both sides: means of each and its image."""
    at_skin = evaluate(volume, shares, skin.vertices)
    return _sparse(0.5 * (at_skin + at_skin[other_side(skin.vertices)][:, images(tuple(names))]))


def _sparse(shares: Floats) -> Floats:
    """Weights (N, K) without the least ones, summing to one."""
    left = np.where(shares < _LEAST_WEIGHT, 0.0, shares)
    return np.asarray(left / left.sum(axis=1, keepdims=True))


def _fit_weight(skin: Floats, landmarks: dict[str, Floats]) -> Floats:
    """How much skin vertices (V,) count in fitting: little at fingers and toes, which the model holds still."""
    weight = np.ones(len(skin))
    for ramp in BODY.fit_ramps:
        ends = (name(ramp.start), name(ramp.end))
        for first, last in (ends, map(left_name, ends)):
            start, end = landmarks[first], landmarks[last]
            near = np.linalg.norm(skin - start, axis=1) < 0.35
            weight = weight * np.where(near, np.interp(along_line(skin, start, end), ramp.at, ramp.values), 1.0)
    return weight


def _in_order(joints: tuple[Joint, ...]) -> tuple[Joint, ...]:
    """Parents before their children."""
    placed: set[str | None] = {None}
    ordered: list[Joint] = []
    left = list(joints)
    while left:
        joint = next(j for j in left if j.parent in placed and (j.other is None or j.other in placed))
        left.remove(joint)
        ordered.append(joint)
        placed.add(joint.child)
    return tuple(ordered)
