"""What must hold of a template before it may ship."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import product

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Anatomy, Joint
from adapt.model.body import Body, make_body, pose_skin, posed_bones, rest_theta
from adapt.model.frames import frame_from_landmarks
from adapt.model.handles import deform, handle_positions
from adapt.model.kinematics import bone_motions
from adapt.model.pose_space import is_free
from adapt.model.shape.handle_space import AffineSet, affine_set
from adapt.template_builder.check import Check
from adapt.template_builder.depth_checks import depth_checks
from adapt.template_builder.meshes import Mesh
from adapt.template_builder.plan import LimbPlan
from adapt.template_builder.pose_bones import source_at
from adapt.template_builder.sources_myosim import SourceSkeleton
from adapt.template_builder.tetrahedra import TetMesh
from capture.rigid import rotation_angle

Floats = NDArray[np.float64]

REST_DEPTH = 0.001  # m, of every bone vertex beneath the skin at rest
OVERLAP = 0.002  # m, of one bone in another, or what the source skeleton has if that is more
# m, and of the source's: facets of a coarse source hide some of it, and it is smaller (the shank by a tenth).
OVERLAP_SLACK, OVERLAP_SHARE = 0.0006, 0.15
DRIFT = 0.0015  # m, between landmarks and the bones they stand for, under changed proportions
TURN = {"forearm": np.radians(130.0), "bend": np.radians(165.0)}  # between the two bones of a deformer
_STEPS = 5  # values of a coordinate over its range

# Tetrahedra differ a little between builds: at the wrist's limits the carpus may touch the skin from inside.
_MOVING_DEPTH_MM = -0.15


def all_checks(anatomy: Anatomy, plan: LimbPlan, skeleton: SourceSkeleton) -> list[Check]:
    """Every check of a freshly built anatomy."""
    body = make_body(anatomy)
    return [
        *surface_checks(anatomy),
        *depth_checks(anatomy, plan),
        *weight_checks(anatomy),
        *tetrahedra_checks(anatomy),
        *landmark_checks(anatomy),
        *turn_checks(body),
        *drift_checks(anatomy),
        *motion_checks(body),
        *overlap_checks(body, plan, skeleton),
    ]


def surface_checks(anatomy: Anatomy) -> list[Check]:
    """Closed surfaces that face outward; the skin moves nowhere at rest; bones lie beneath it."""
    skin = Mesh(anatomy.skin_vertices, anatomy.skin_faces)
    body = make_body(anatomy)
    moved = np.abs(pose_skin(body, rest_theta(body)) - anatomy.skin_vertices).max()
    checks = [
        Check("skin is closed", float(skin.is_closed()), 1.0, least=True),
        Check("skin volume", 1e3 * skin.volume(), 0.1, "l", least=True),
        Check("skin at rest moves", 1e3 * moved, 1e-3, "mm"),
    ]
    for bone in anatomy.bones:
        mesh = Mesh(bone.vertices, bone.faces)
        checks += [
            Check(f"{bone.name} is closed", float(mesh.is_closed()), 1.0, least=True),
            Check(f"{bone.name} volume", 1e6 * mesh.volume(), 1.0, "cm3", least=True),
            Check(
                f"{bone.name} beneath the skin at rest",
                1e3 * skin.depth(bone.vertices).min(),
                1e3 * REST_DEPTH,
                "mm",
                least=True,
            ),
        ]
    return checks


def weight_checks(anatomy: Anatomy) -> list[Check]:
    """Weights lie in [0, 1] and sum to one."""
    rows = {
        "landmark handle weights": anatomy.landmark_handle_weights,
        "skin handle weights": anatomy.skin_handle_weights,
        "deformer weights": anatomy.deformer_weights,
    } | {f"{bone.name} handle weights": bone.handle_weights for bone in anatomy.bones}
    checks = []
    for name, weights in rows.items():
        checks.append(Check(f"{name} least", float(weights.min()), 0.0, least=True))
        checks.append(Check(f"{name} sums off", float(np.abs(weights.sum(axis=1) - 1.0).max()), 1e-5))
    checks.append(Check("fit weight least", float(anatomy.fit_weight.min()), 0.0, least=True))
    checks.append(Check("fit weight most", float(anatomy.fit_weight.max()), 1.0))
    return checks


def tetrahedra_checks(anatomy: Anatomy) -> list[Check]:
    """Every tetrahedron has positive volume."""
    return [
        Check(f"{name} smallest tetrahedron", 1e9 * float(TetMesh(*parts).volumes().min()), 1e-6, "mm3", least=True)
        for name, parts in anatomy.tetrahedra.items()
    ]


def landmark_checks(anatomy: Anatomy) -> list[Check]:
    """Landmarks lie inside the skin; handles lie inside their bones' tetrahedra; rest values lie in range."""
    skin = Mesh(anatomy.skin_vertices, anatomy.skin_faces)
    checks = [Check("landmarks beneath the skin", 1e3 * skin.depth(anatomy.landmarks).min(), 0.0, "mm", least=True)]
    for handle in anatomy.handles:
        points, _ = anatomy.tetrahedra[handle.bone]
        off = np.linalg.norm(points - np.array(handle.position), axis=1).min()
        checks.append(Check(f"handle {handle.name} off its tetrahedra", 1e3 * off, 0.01, "mm"))
    for c in anatomy.coordinates:
        checks.append(Check(f"{c.name} at rest outside its range", max(c.low - c.rest, c.rest - c.high), 0.0, c.unit))
    return checks


def turn_checks(body: Body) -> list[Check]:
    """The two bones of a twist or a bend never come near half a turn apart, where SLERP would flip."""
    checks = []
    for deformer in body.anatomy.deformers:
        if deformer.type not in TURN:
            continue
        # A twist starts from its own two frames, a bend from rest.
        own = deformer.frames if deformer.type == "forearm" else deformer.frames[-1:] * 2
        rest = [frame_from_landmarks(body.anatomy, frame, body.p).rotation for frame in own]
        worst = 0.0
        for theta in motions(body):
            moved = bone_motions(body.anatomy, theta, body.p)
            turns = [moved[bone].rotation @ frame for bone, frame in zip(deformer.bones, rest, strict=True)]
            worst = max(worst, rotation_angle(turns[0].T @ turns[1]))
        limit = TURN[deformer.type]
        checks.append(Check(f"turn of {deformer.name}", np.degrees(worst), np.degrees(limit), "deg"))
    return checks


def drift_checks(anatomy: Anatomy, shapes: list[Floats] | None = None) -> list[Check]:
    """Bone heads and the landmarks at a joint move together when proportions change.

    All bone vertices within 2 cm of a joint's centre and all landmarks of its motion are deformed by 100 random
    shapes (lengths by up to 8 per cent, scales by up to 6), or by ``shapes``, and compared with the joint's own
    similarity.
    """
    affine, positions, rng = affine_set(anatomy), handle_positions(anatomy), np.random.default_rng(2015)
    shapes = [_random_shape(affine, rng) for _ in range(100)] if shapes is None else shapes
    checks = []
    for joint in anatomy.joints:
        group = next((h.joint for h in anatomy.handles if h.joint == joint.name), None)
        if group is None:
            continue
        index = affine.groups.index(group)
        rows = [anatomy.landmark_index(name) for name in joint.landmarks()]
        centre = anatomy.landmarks[[anatomy.landmark_index(name) for name in joint.centre]].mean(axis=0)
        parts = [(anatomy.landmarks[rows], anatomy.landmark_handle_weights[rows])]
        for bone in (anatomy.bone(name) for name in (joint.parent, joint.child) if name is not None):
            near = np.linalg.norm(bone.vertices - centre, axis=1) < 0.02
            parts.append((bone.vertices[near], bone.handle_weights[near]))
        points, weights = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
        worst = 0.0
        for shape in shapes:
            scale, shift = affine.scales(shape)[index], affine.shifts(shape)[index]
            rigid = scale * (points - affine.centres[index]) + affine.centres[index] + shift
            moved = deform(points, weights, positions, affine.handle_parameters(shape))
            worst = max(worst, float(np.linalg.norm(moved - rigid, axis=1).max()))
        checks.append(Check(f"drift at the {joint.name}", 1e3 * worst, 1e3 * DRIFT, "mm"))
    return checks


def _random_shape(affine: AffineSet, rng: np.random.Generator) -> Floats:
    """A shape (4J,): every stretch between neighbouring joints up to 8 per cent longer or shorter."""
    steps = np.diff(affine.centres, axis=0) * rng.uniform(-0.08, 0.08, (len(affine.centres) - 1, 1))
    shifts = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    return affine.shape(rng.uniform(0.94, 1.06, len(shifts)), shifts)


def motions(body: Body, joints: tuple[Joint, ...] | None = None) -> Iterator[Floats]:
    """Poses over the range of motion: each joint over a grid of its coordinates, the others at rest."""
    moving = [joint for joint in (body.anatomy.joints if joints is None else joints) if not is_free(joint)]
    for coordinates in dict.fromkeys(joint.coordinates for joint in moving):  # once where joints share them
        yield from _grid(body, coordinates)


def _grid(body: Body, coordinates: tuple[str, ...]) -> Iterator[Floats]:
    indices = [body.anatomy.coordinate_index(name) for name in coordinates]
    ranges = [np.linspace(body.anatomy.coordinates[i].low, body.anatomy.coordinates[i].high, _STEPS) for i in indices]
    for values in product(*ranges):
        theta = rest_theta(body)
        theta[indices] = values
        yield theta


def motion_checks(body: Body) -> list[Check]:
    """No bone comes out of the skin over the range of motion."""
    least = dict.fromkeys((bone.name for bone in body.anatomy.bones), np.inf)
    for theta in motions(body):
        skin = Mesh(pose_skin(body, theta), body.anatomy.skin_faces)
        for name, vertices in posed_bones(body, theta).items():
            least[name] = min(least[name], float(skin.depth(vertices).min()))
    return [
        Check(f"{name} beneath the skin, moving", 1e3 * d, _MOVING_DEPTH_MM, "mm", least=True)
        for name, d in least.items()
    ]


def overlap_checks(body: Body, plan: LimbPlan, skeleton: SourceSkeleton) -> list[Check]:
    """No bone lies deeper in another than in the source skeleton in the same pose, or than OVERLAP."""
    checks = []
    for first, second, between in _neighbours(body.anatomy):
        ours, theirs = -np.inf, -np.inf
        for theta in motions(body, between):
            posed = posed_bones(body, theta)
            ours = max(ours, _overlap(*(Mesh(posed[n], body.anatomy.bone(n).faces) for n in (first, second))))
            pose = {c.name: float(value) for c, value in zip(body.anatomy.coordinates, theta, strict=True)}
            theirs = max(theirs, _overlap(*(source_bone(plan, skeleton, n, pose) for n in (first, second))))
        if ours == -np.inf:  # they never come near each other
            continue
        limit = max(OVERLAP, theirs + max(OVERLAP_SLACK, OVERLAP_SHARE * theirs))
        checks.append(Check(f"{first} in {second} (source {1e3 * theirs:.1f} mm)", 1e3 * ours, 1e3 * limit, "mm"))
    return checks


def _neighbours(anatomy: Anatomy) -> list[tuple[str, str, tuple[Joint, ...]]]:
    """Pairs of bones that may touch, across one joint or two, with the joints between them."""
    above = {joint.child: joint for joint in anatomy.joints if joint.parent is not None}
    pairs: list[tuple[str, str, tuple[Joint, ...]]] = []
    for child, joint in above.items():
        pairs.append((str(joint.parent), child, (joint,)))
        if joint.parent in above:
            upper = above[joint.parent]
            pairs.append((str(upper.parent), child, (upper, joint)))
    return pairs


def _overlap(first: Mesh, second: Mesh) -> float:
    """How deep two meshes lie in each other, m; negative when they are apart. Middles of coarse faces count too."""
    deepest = -np.inf
    for mesh, other in ((first, second), (second, first)):
        low, high = mesh.vertices.min(axis=0) - 0.005, mesh.vertices.max(axis=0) + 0.005
        points = np.concatenate([other.vertices, other.vertices[other.faces].mean(axis=1)])
        near = points[np.all((points > low) & (points < high), axis=1)]
        if len(near):
            deepest = max(deepest, float(mesh.depth(near).max()))
    return deepest


def source_bone(plan: LimbPlan, skeleton: SourceSkeleton, bone: str, coordinates: Mapping[str, float]) -> Mesh:
    """The source's bone, at the source's size, with its hinges at coordinates by name (rad; missing ones are 0)."""
    angles = {hinge: sign * coordinates[name] for name, (hinge, sign) in plan.rest_from.items() if name in coordinates}
    placements = source_at(skeleton, angles)
    bodies = next(part.bodies for part in plan.bones if part.name == bone)
    starts = np.cumsum([0, *(len(skeleton.bodies[name].vertices) for name in bodies)])
    vertices = [placements[name].points(skeleton.bodies[name].vertices) for name in bodies]
    faces = [skeleton.bodies[name].faces + start for name, start in zip(bodies, starts, strict=False)]
    return Mesh(np.concatenate(vertices), np.concatenate(faces))
