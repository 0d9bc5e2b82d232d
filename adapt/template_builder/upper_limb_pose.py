"""How the source arm is posed into the skin: the statements that ``pose_bones`` solves, in two stages.

First humerus, ulna and radius with the direction of the knuckles (which says how far the forearm is pronated), then
the hand with arm and forearm held: once by joint centres alone, once more with clearance beneath the skin.
"""

from __future__ import annotations

from dataclasses import replace
from math import log, radians

import numpy as np
from numpy.typing import NDArray

from adapt.template_builder.meshes import Mesh
from adapt.template_builder.pose_bones import (
    ROOT,
    DepthTarget,
    DirectionTarget,
    Placement,
    PoseProblem,
    Target,
    Unknown,
    depth_beneath,
    fit_pose,
    placed_bodies,
)
from adapt.template_builder.sources_makehuman import SourceSkin
from adapt.template_builder.sources_myosim import SourceBody, SourceSkeleton
from capture.rigid import log_so3

Floats = NDArray[np.float64]

FINGERS = {
    1: ("firstmc_r", "proximal_thumb_r", "distal_thumb_r"),
    2: ("secondmc_r", "2proxph_r", "midph2_r", "distph2_r"),
    3: ("thirdmc_r", "3proxph_r", "midph3_r", "distph3_r"),
    4: ("fourthmc_r", "4proxph_r", "midph4_r", "distph4_r"),
    5: ("fifthmc_r", "5proxph_r", "midph5_r", "distph5_r"),
}
CARPALS = (
    "lunate_r",
    "scaphoid_r",
    "pisiform_r",
    "triquetrum_r",
    "capitate_r",
    "trapezium_r",
    "trapezoid_r",
    "hamate_r",
)
ARM = ("humerus_r", "ulna_r", "radius_r")
_HAND = CARPALS + tuple(body for finger in FINGERS.values() for body in finger)
BODIES = ARM + _HAND

_ARM_SCALE = ("log_humerus", "log_forearm_across", "log_forearm_along")
_HAND_SCALE = (
    "log_palm_across",
    "log_palm_along",
    *(f"log_finger{k}_{way}" for k in FINGERS for way in ("across", "along")),
)
# MakeHuman's wrist lies this far above the middle of the carpus, its knuckles this far below the true ones (m).
_WRIST_LOWER, _KNUCKLE_HIGHER = 0.008, 0.013


def pose_upper_limb(
    skeleton: SourceSkeleton, rig: SourceSkin, skin: Mesh
) -> tuple[dict[str, float], dict[str, Placement]]:
    """Hinge angles (rad) and log scales by name, and every source body's placement inside the skin."""
    depth = depth_beneath(skin)
    goals = {name.removeprefix("r-"): point for name, point in rig.joints.items() if name.startswith("r-")}
    arm = _arm_problem(skeleton, goals)
    values = fit_pose(arm, depth)
    held = {name: values[name] for name in (*ROOT, *_ARM_SCALE, "elbow_flexion_r", "pro_sup_r")}
    hand = _hand_problem(skeleton, goals, held, values)
    first = fit_pose(replace(hand, clearance={}, targets=(*hand.targets, *_knuckle_targets(goals))), depth)
    started = tuple(replace(unknown, prior=first[unknown.name]) for unknown in hand.unknowns)
    values = fit_pose(replace(hand, unknowns=started), depth)
    return values, placed_bodies(replace(hand, skeleton=skeleton), values)


def _scales() -> dict[str, tuple[str, str, str]]:
    """Which scales, across (x and z) and along (y), each body has."""
    scale = {"humerus_r": _across_along("humerus", "humerus")}
    scale |= dict.fromkeys(("ulna_r", "radius_r"), _across_along("forearm_across", "forearm_along"))
    scale |= dict.fromkeys(CARPALS, _across_along("palm_across", "palm_along"))
    for k, (metacarpal, *phalanges) in FINGERS.items():
        scale[metacarpal] = _across_along("palm_across", "palm_along")
        scale |= dict.fromkeys(phalanges, _across_along(f"finger{k}_across", f"finger{k}_along"))
    return scale


def _across_along(across: str, along: str) -> tuple[str, str, str]:
    return f"log_{across}", f"log_{along}", f"log_{across}"


def _arm_problem(skeleton: SourceSkeleton, goals: dict[str, Floats]) -> PoseProblem:
    elbow, wrist = goals["elbow"], goals["hand"]
    knuckles = np.mean([goals[f"finger-{k}-1"] for k in (2, 3, 4, 5)], axis=0)
    # The rig's shoulder lies in the arm; the head of the humerus lies higher and nearer to the trunk.
    head = goals["shoulder"] + np.array([0.0, 0.020, -0.012])
    rotation, position = log_so3(_upright(head, elbow, wrist)), head
    unknowns = (
        *(Unknown(name, float(start), 0.5) for name, start in zip(ROOT[:3], rotation, strict=True)),
        *(Unknown(name, float(start), 0.02) for name, start in zip(ROOT[3:], position, strict=True)),
        Unknown("log_humerus", 0.01, 0.03),
        Unknown("log_forearm_along", 0.02, 0.03),
        # Nearly as thick for their length as the source's: the skin gives way.
        Unknown("log_forearm_across", -0.03, 0.02),
        Unknown("elbow_flexion_r", radians(45.0), 0.3, 0.0, 2.0),
        Unknown("pro_sup_r", radians(35.0), 2.0, -1.5, 1.5),
        Unknown("deviation_r", 0.0, 0.2, radians(-10.0), radians(25.0)),
        Unknown("flexion_r", 0.0, 0.2, -0.7, 0.7),
    )
    vertices = {name: skeleton.bodies[name].vertices for name in ARM}
    distal = vertices["humerus_r"][vertices["humerus_r"][:, 1] < -0.25]
    proximal = vertices["ulna_r"][vertices["ulna_r"][:, 1] > -0.05]
    return PoseProblem(
        skeleton=skeleton,
        root="humerus_r",
        scale_of=_scales(),
        unknowns=unknowns,
        fixed=dict.fromkeys(_HAND_SCALE, log(1.1)),
        clearance={"humerus_r": 0.0045, "ulna_r": 0.0030, "radius_r": 0.0030},
        targets=(
            Target("lunate_r", np.zeros(3), wrist + _WRIST_LOWER * _unit(knuckles - wrist), 0.004),
            Target("ulna_r", np.zeros(3), elbow, 0.006),
        ),
        depths=(
            DepthTarget("humerus_r", _farthest(distal, (0.0, 0.3, -1.0)), 0.006, 0.003),
            DepthTarget("humerus_r", _farthest(distal, (0.0, 0.3, 1.0)), 0.006, 0.003),
            DepthTarget("ulna_r", _farthest(proximal, (-1.0, 0.6, 0.0)), 0.004, 0.003),
            DepthTarget("ulna_r", _farthest(vertices["ulna_r"], (0.0, -1.0, 0.0)), 0.005, 0.001),
            DepthTarget("radius_r", _farthest(vertices["radius_r"], (0.0, -1.0, 0.0)), 0.005, 0.002),
        ),
        directions=(DirectionTarget("2proxph_r", "5proxph_r", _unit(goals["finger-5-1"] - goals["finger-2-1"]), 0.05),),
    )


def _hand_problem(
    skeleton: SourceSkeleton, goals: dict[str, Floats], held: dict[str, float], start: dict[str, float]
) -> PoseProblem:
    unknowns = [
        Unknown("deviation_r", start["deviation_r"], 0.15, radians(-10.0), radians(25.0)),
        Unknown("flexion_r", start["flexion_r"], 0.2, -0.7, 0.7),
        Unknown("log_palm_across", -0.04, 0.03),
        Unknown("log_palm_along", 0.13, 0.02),
    ]
    for k, bodies in FINGERS.items():
        unknowns += [Unknown(f"log_finger{k}_across", 0.0, 0.04), Unknown(f"log_finger{k}_along", 0.13, 0.02)]
        for hinge in (hinge for body in bodies for hinge in skeleton.bodies[body].hinges):
            bends = "flexion" in hinge.name and k > 1
            spread = 0.15 if "abduction" in hinge.name else 0.3
            unknowns.append(Unknown(hinge.name, 0.2 if bends else 0.0, spread, hinge.low - 0.35, hinge.high + 0.2))
    return PoseProblem(
        skeleton=_thinned(skeleton),
        root="humerus_r",
        scale_of=_scales(),
        unknowns=tuple(unknowns),
        fixed=held,
        clearance=dict.fromkeys(_HAND, 0.0033),
        targets=_finger_targets(skeleton, goals),
        spread=0.0007,
    )


def _finger_targets(skeleton: SourceSkeleton, goals: dict[str, Floats]) -> tuple[Target, ...]:
    """Finger joints at the rig's, finger tips a little beneath the skin's."""
    targets = []
    for k, bodies in FINGERS.items():
        last = skeleton.bodies[bodies[-1]]
        before, tip = goals[f"finger-{k}-3"], goals[f"finger-{k}-4"]
        away = (0.5, -0.8, -0.3) if k == 1 else (0.0, -1.0, 0.0)
        targets.append(Target(last.name, _farthest(last.vertices, away), tip + 0.004 * _unit(before - tip), 0.003))
        targets.append(Target(last.name, np.zeros(3), before, 0.005))
        targets.append(Target(bodies[-2], np.zeros(3), goals[f"finger-{k}-2"], 0.008 if k == 1 else 0.006))
    return tuple(targets)


def _knuckle_targets(goals: dict[str, Floats]) -> tuple[Target, ...]:
    """The knuckles, which lie nearer to the wrist than the rig's joints of that name."""
    wrist = goals["hand"]
    return tuple(
        Target(FINGERS[k][1], np.zeros(3), knuckle + _KNUCKLE_HIGHER * _unit(wrist - knuckle), 0.006)
        for k in (2, 3, 4, 5)
        for knuckle in (goals[f"finger-{k}-1"],)
    )


def _thinned(skeleton: SourceSkeleton) -> SourceSkeleton:
    """The same skeleton with every twelfth vertex of the hand's fine bones: enough to feel the skin."""
    bodies: dict[str, SourceBody] = {
        name: replace(body, vertices=body.vertices[::12]) if name in _HAND else body
        for name, body in skeleton.bodies.items()
    }
    return replace(skeleton, bodies=bodies)


def _upright(head: Floats, elbow: Floats, wrist: Floats) -> Floats:
    """The humerus's axes (3, 3) for a flexed arm: y up the bone, z the axis of flexion, pointing right."""
    y, forearm = _unit(head - elbow), _unit(wrist - elbow)
    z = _unit(np.cross(forearm, y))
    return np.stack([np.cross(y, z), y, z], axis=1)


def _farthest(points: Floats, direction: tuple[float, float, float]) -> Floats:
    return np.asarray(points[np.argmax(points @ np.array(direction))])


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.linalg.norm(vector))
