"""What must hold of the whole body before it may ship."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Anatomy, Joint
from adapt.model.body import Body, make_body, pose_skin, posed_bones, rest_theta
from adapt.model.derivatives import constant_points
from adapt.model.frames import frame_from_landmarks
from adapt.model.kinematics import bone_motions
from adapt.model.shape.handle_space import affine_set
from adapt.template_builder.body import BODY
from adapt.template_builder.body_bones import MIDDLE
from adapt.template_builder.check import Check
from adapt.template_builder.checks import drift_checks, tetrahedra_checks, weight_checks
from adapt.template_builder.meshes import Mesh
from adapt.template_builder.superficial import depth_at
from adapt.template_builder.two_sides import right_name
from capture.rigid import exp_so3, log_so3

Floats = NDArray[np.float64]

REST_SHARE, REST_OUT, MOVING_OUT = 0.002, 0.002, 0.003  # of vertices; m at rest; m over the ranges of motion
STRUT = 0.002  # m
_ITERATIONS, _STEP, _HELD = 40, 1e-4, 1e-5  # of finding where a collar bone fits: rad, m
_BESIDE_BONES = ("ellipsoid_", "_bend_", "SC_above", "SC_beside", "shoulder_")  # landmarks that tell planes and axes
_THIN = 3  # every third vertex of a bone is looked at in motion
# Elevations of the arm (degrees) in planes forward of the side (degrees), as an arm is raised.
_ELEVATIONS, _PLANES = (0.0, 60.0, 100.0), (0.0, 45.0, 90.0)


def body_checks(anatomy: Anatomy) -> list[Check]:
    """Every check of a freshly built body."""
    body = make_body(anatomy)
    return [
        *rest_checks(body),
        *depth_checks(anatomy),
        *weight_checks(anatomy),
        *tetrahedra_checks(anatomy),
        *place_checks(anatomy),
        *drift_checks(anatomy, random_shapes(anatomy)),
        *strut_checks(body),
        *motion_checks(body),
    ]


def rest_checks(body: Body) -> list[Check]:
    """Closed surfaces that face outward; the skin moves nowhere at rest; bones lie in it, its pockets filled."""
    anatomy = body.anatomy
    skin = Mesh(anatomy.skin_vertices, anatomy.skin_faces)
    moved = np.abs(pose_skin(body, rest_theta(body)) - anatomy.skin_vertices).max()
    checks = [
        Check("skin is closed", float(skin.is_closed()), 1.0, least=True),
        Check("skin volume", 1e3 * skin.volume(), 60.0, "l", least=True),
        Check("skin at rest moves", 1e3 * moved, 1e-3, "mm"),
    ]
    for bone in anatomy.bones:
        mesh, depth = Mesh(bone.vertices, bone.faces), skin.depth(bone.vertices)
        checks += [
            Check(f"{bone.name} is closed", float(mesh.is_closed()), 1.0, least=True),
            Check(f"{bone.name} volume", 1e6 * mesh.volume(), 1.0, "cm3", least=True),
            Check(
                f"{bone.name} outside the skin at rest", 100.0 * float((depth < 0.0).mean()), 100.0 * REST_SHARE, "%"
            ),
            Check(f"{bone.name} out of the skin at rest by", -1e3 * float(depth.min()), 1e3 * REST_OUT, "mm"),
        ]
    return checks


def depth_checks(anatomy: Anatomy) -> list[Check]:
    """Where bones lie just under people's skin, they do as in people; the left is the right's image."""
    skin, name = Mesh(anatomy.skin_vertices, anatomy.skin_faces), right_name(MIDDLE)
    bones = {bone.name: Mesh(bone.vertices, bone.faces) for bone in anatomy.bones}
    places = dict(zip(anatomy.landmark_names, anatomy.landmarks, strict=True))
    checks = []
    for spot in BODY.spots:
        named = replace(spot, bone=name(spot.bone), at=name(spot.at), to=name(spot.to) if spot.to else "")
        depth = 1e3 * depth_at(named, skin, bones, places)
        checks.append(Check(f"{spot.name} beneath the skin, no less", depth, 1e3 * spot.low, "mm", least=True))
        checks.append(Check(f"{spot.name} beneath the skin, no more", depth, 1e3 * spot.high, "mm"))
    return checks


def place_checks(anatomy: Anatomy) -> list[Check]:
    """Landmarks lie inside the skin; rest values lie in range; the left half is the right one's image."""
    skin = Mesh(anatomy.skin_vertices, anatomy.skin_faces)
    on_bones = [n for n in anatomy.landmark_names if not any(part in n for part in _BESIDE_BONES)]
    at = anatomy.landmarks[[anatomy.landmark_index(n) for n in on_bones]]
    checks = [Check("landmarks of bones beneath the skin", 1e3 * skin.depth(at).min(), 0.0, "mm", least=True)]
    for c in anatomy.coordinates:
        checks.append(Check(f"{c.name} at rest outside its range", max(c.low - c.rest, c.rest - c.high), 0.0, c.unit))
    return checks


def random_shapes(anatomy: Anatomy) -> list[Floats]:
    """100 shapes (4J,): the body up to 8 per cent larger or smaller along each axis, joints by up to 6 besides."""
    affine, rng = affine_set(anatomy), np.random.default_rng(2015)
    grown = rng.uniform(-0.08, 0.08, (100, 3))
    return [affine.shape(rng.uniform(0.94, 1.06, len(affine.groups)), affine.centres * by) for by in grown]


def strut_checks(body: Body) -> list[Check]:
    """From anywhere in the blade's range the collar bone can be held: the nearest such pose keeps its length.

    Within the blade's range: where the collar bone cannot be as long as at rest there, that is what is measured.
    """
    index = _blade(body.anatomy)
    ranges = [np.linspace(body.anatomy.coordinates[i].low, body.anatomy.coordinates[i].high, 3) for i in index]
    off = 0.0
    for values in product(*ranges):
        theta = rest_theta(body)
        theta[index] = values
        off = max(off, abs(longer(body, body.anatomy.joint("sternoclavicular_r"), held_blade(body, theta))))
    return [Check("collar bone longer or shorter where it is held", 1e3 * off, 1e3 * STRUT, "mm")]


def _blade(anatomy: Anatomy) -> list[int]:
    return [anatomy.coordinate_index(f"scapula_{way}_r") for way in ("abduction", "elevation", "upward_rot")]


def longer(body: Body, joint: Joint, theta: Floats) -> float:
    """By how much (m) a strut's ends are farther apart than at rest."""
    p = constant_points(body.p.value, len(theta))
    first, second = (body.anatomy.landmark_index(name) for name in joint.axes[0])
    moved = bone_motions(body.anatomy, theta, p)
    ends = (
        moved[str(bone)].rotation @ p.value[at] + moved[str(bone)].translation
        for bone, at in ((joint.parent, first), (joint.other, second))
    )
    start, end = ends
    return float(np.linalg.norm(end - start) - np.linalg.norm(p.value[second] - p.value[first]))


def held_blade(body: Body, theta: Floats) -> Floats:
    """The pose with the right blade moved, within its range and by the least turns, to where its collar bone fits."""
    joint, index, posed = body.anatomy.joint("sternoclavicular_r"), _blade(body.anatomy), theta.copy()
    low, high = (np.array([getattr(body.anatomy.coordinates[i], end) for i in index]) for end in ("low", "high"))
    for _ in range(_ITERATIONS):
        off = longer(body, joint, posed)
        slope = np.zeros(3)
        for k, i in enumerate(index):
            beside = posed.copy()
            beside[i] += _STEP
            slope[k] = (longer(body, joint, beside) - off) / _STEP
        stuck = (posed[index] <= low) & (off * slope > 0.0) | (posed[index] >= high) & (off * slope < 0.0)
        slope = np.where(stuck, 0.0, slope)
        if abs(off) < _HELD or not slope.any():
            break
        posed[index] = np.clip(posed[index] - off * slope / (slope @ slope), low, high)
    return posed


def raised_arm(body: Body, elevation: float, plane: float, turn: float = 0.0) -> Floats:
    """A pose with the right arm raised by degrees from hanging, in a plane forward of the side, turned about itself.

    A third of it is the blade's upward rotation, as in people; it moves as the collar bone asks.
    """
    anatomy, theta = body.anatomy, rest_theta(body)
    up, out = np.radians(elevation), np.radians(plane)
    upward = _blade(anatomy)[2]
    c = anatomy.coordinates[upward]
    theta[upward] = min(c.rest + max(0.0, up - np.radians(45.0)) / 3.0, c.high)
    theta = held_blade(body, theta)
    way = np.array([np.sin(up) * np.sin(out), -np.cos(up), np.sin(up) * np.cos(out)])
    humerus = _pointing(way) @ exp_so3(np.array([0.0, np.radians(turn), 0.0]))
    p = constant_points(body.p.value, len(theta))
    moved = bone_motions(anatomy, theta, p)["scapula_r"].rotation
    joint = anatomy.joint("shoulder_r")
    frame = frame_from_landmarks(anatomy, joint.frames[0], p).rotation
    index = [anatomy.coordinate_index(name) for name in joint.coordinates]
    theta[index] = log_so3((moved @ frame).T @ humerus)
    return theta


def _pointing(way: Floats) -> Floats:
    """The shortest turn (3, 3) that takes a hanging arm's direction, straight down, to ``way``."""
    down = np.array([0.0, -1.0, 0.0])
    axis = np.cross(down, way)
    sine = float(np.linalg.norm(axis))
    return np.asarray(exp_so3(axis / max(sine, 1e-9) * np.arctan2(sine, down @ way)))


def motions(body: Body) -> Iterator[tuple[str, Floats]]:
    """Poses over the ranges of the right side and the middle: each coordinate's ends, the arm raised all over."""
    anatomy = body.anatomy
    own = ("scapula_", "shoulder_", "pelvis_")
    for k, c in enumerate(anatomy.coordinates):
        if c.name.endswith("_l") or c.name.startswith(own):
            continue
        for value in (c.low, 0.5 * (c.low + c.high), c.high):
            theta = rest_theta(body)
            theta[k] = value
            yield f"{c.name} {np.degrees(value):.0f}", theta
    for elevation, plane in product(_ELEVATIONS, _PLANES):
        yield f"arm raised by {elevation:.0f} at {plane:.0f}", raised_arm(body, elevation, plane)


def motion_checks(body: Body) -> list[Check]:
    """No bone of the right side and the middle comes out of the skin over the ranges of motion."""
    worst: dict[str, tuple[float, str]] = {}
    for label, theta in motions(body):
        skin = Mesh(pose_skin(body, theta), body.anatomy.skin_faces)
        for name, vertices in posed_bones(body, theta).items():
            if not name.endswith("_l"):
                out = -float(skin.depth(vertices[::_THIN]).min())
                worst[name] = max(worst.get(name, (-np.inf, "")), (out, label))
    return [
        Check(f"{name} out of the skin, moving (at {label})", 1e3 * out, 1e3 * MOVING_OUT, "mm")
        for name, (out, label) in worst.items()
    ]
