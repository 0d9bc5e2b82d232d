"""How the source leg is posed into the skin: the statements that ``pose_bones`` solves.

First by joint centres and bony points alone, then once more with clearance beneath the skin, at last the toes.
"""

from __future__ import annotations

from dataclasses import replace
from math import radians

import numpy as np
from numpy.typing import NDArray

from adapt.template_builder.meshes import Mesh
from adapt.template_builder.pose_bones import (
    DepthTarget,
    Placement,
    PoseProblem,
    Target,
    Unknown,
    depth_beneath,
    fit_pose,
    placed_bodies,
)
from adapt.template_builder.sources_makehuman import SourceSkin
from adapt.template_builder.sources_myosim import Piece, SourceHinge, SourceSkeleton

Floats = NDArray[np.float64]

BODIES = ("pelvis", "femur_r", "patella_r", "tibia_r", "talus_r", "calcn_r", "toes_r")
# How the source's shank stands askew under its knee in this skin: the rig's leg is bowed, its foot points forward.
ALIGNMENT = (
    SourceHinge("shank_varus", np.array([1.0, 0.0, 0.0]), radians(-6.0), radians(6.0)),
    SourceHinge("shank_torsion", np.array([0.0, 1.0, 0.0]), radians(-15.0), radians(15.0)),
)

METATARSAL_HEADS = {  # m, in the source's frame of the foot
    1: (0.1739, 0.0037, -0.0282),
    2: (0.1694, 0.0027, -0.0007),
    3: (0.1591, 0.0010, 0.0142),
    4: (0.1493, 0.0038, 0.0291),
    5: (0.1346, 0.0041, 0.0404),
}
# The rig's first joint of a toe lies where the toe leaves the foot, so far before the metatarsal's head (m).
_TOE_ROOT = np.array([0.024, 0.0, 0.0])

# The rig's name of the joint, and the joint (m) in the source's frame of the toes.
_LAST_TOE_JOINTS = {
    "1-2": (0.049, -0.002, -0.018),
    "2-3": (0.063, -0.003, 0.012),
    "3-3": (0.042, -0.003, 0.025),
    "4-3": (0.0255, -0.003, 0.038),
    "5-3": (0.0105, -0.003, 0.049),
}


def _toe(number: int, low: float, high: float, base: tuple[float, float, float]) -> Piece:
    lift = SourceHinge(f"toe{number}_lift", np.array([0.0, 0.0, 1.0]), radians(-25.0), radians(25.0))
    yaw = SourceHinge(f"toe{number}_yaw", np.array([0.0, 1.0, 0.0]), radians(-20.0), radians(20.0))
    return Piece(f"toe{number}", "toes_r", 2, low, high, base, (lift, yaw))


# The source's toes are one body, the skin's spread otherwise: each is laid into its own. Bases in the toes' frame (m).
TOES = (
    _toe(1, -1.0, -0.005, (0.008, 0.000, -0.025)),
    _toe(2, -0.005, 0.0155, (0.004, -0.001, 0.001)),
    _toe(3, 0.0155, 0.028, (-0.010, 0.000, 0.015)),
    _toe(4, 0.028, 0.0405, (-0.024, 0.000, 0.029)),
    _toe(5, 0.0405, 1.0, (-0.036, 0.000, 0.041)),
)
# Heights (m) in the source's frame of the tibia, and how deep (m) its crest lies there: ``lower_limb_depths``.
_CREST = {-0.10: 0.0042, -0.20: 0.0034, -0.29: 0.0077}
_TOES_AS_THEY_ARE = {f"log_toe{k}_{way}": 0.0 for k in METATARSAL_HEADS for way in ("along", "across")}
_TOE_TIPS = {"toe1": "toe-1-3"} | {f"toe{k}": f"toe-{k}-4" for k in (2, 3, 4, 5)}
# The rig's first joint of a toe lies where the toe leaves the foot, so far before the metatarsal's head (m).
_TOE_ROOT = np.array([0.024, 0.0, 0.0])

_SCALES = {
    "pelvis": ("log_pelvis", "log_pelvis", "log_pelvis"),
    # One scale: the knee's table is of the femur's size.
    "femur_r": ("log_femur", "log_femur", "log_femur"),
    "patella_r": ("log_femur", "log_femur", "log_femur"),
    "tibia_r": ("log_shank_across", "log_shank_along", "log_shank_across"),
    "talus_r": ("log_foot_length", "log_foot_height", "log_foot_width"),
    "calcn_r": ("log_foot_length", "log_foot_height", "log_foot_width"),
} | {f"toe{k}": (f"log_toe{k}_along", f"log_toe{k}_across", f"log_toe{k}_across") for k in METATARSAL_HEADS}


def pose_lower_limb(
    skeleton: SourceSkeleton, rig: SourceSkin, skin: Mesh
) -> tuple[dict[str, float], dict[str, Placement]]:
    """Hinge angles (rad) and log scales by name, and every source body's placement inside the skin."""
    depth = depth_beneath(skin)
    goals = {name.removeprefix("r-"): point for name, point in rig.joints.items() if name.startswith("r-")}
    problem = _problem(skeleton, goals)
    first = fit_pose(replace(problem, clearance={}), depth)
    leg = fit_pose(replace(problem, unknowns=_started(problem.unknowns, first)), depth)
    toes = _toes_problem(skeleton, goals, leg)
    first = fit_pose(replace(toes, clearance={}), depth)
    values = fit_pose(replace(toes, unknowns=_started(toes.unknowns, first)), depth)
    return values, placed_bodies(replace(toes, skeleton=skeleton), values)


def _started(unknowns: tuple[Unknown, ...], values: dict[str, float]) -> tuple[Unknown, ...]:
    """The same unknowns, started where another fit ended."""
    return tuple(replace(unknown, prior=values[unknown.name]) for unknown in unknowns)


def _problem(skeleton: SourceSkeleton, goals: dict[str, Floats]) -> PoseProblem:
    hip, knee, ankle = goals["upper-leg"], goals["knee"], goals["ankle"]
    unknowns = (
        # The hip bone stands upright and its symphysis in the body's middle: it may tilt, and move in that plane.
        Unknown("root_rz", 0.0, radians(3.0)),
        Unknown("root_tx", hip[0] + 0.056, 0.03),
        Unknown("root_ty", hip[1] + 0.078, 0.03),
        Unknown("log_pelvis", 0.02, 0.01),
        Unknown("log_femur", 0.036, 0.004),
        # Nearly as thick for its length as the source's: people's ankles are thicker than this skin's, which gives way.
        Unknown("log_shank_across", 0.0, 0.01),
        Unknown("log_shank_along", 0.08, 0.01),
        Unknown("log_foot_length", -0.05, 0.03),
        Unknown("log_foot_height", 0.0, 0.03),
        Unknown("log_foot_width", -0.15, 0.04),
        Unknown("hip_flexion_r", radians(5.0), radians(8.0), radians(-30.0), radians(60.0)),
        Unknown("hip_adduction_r", radians(-6.0), radians(8.0), radians(-50.0), radians(30.0)),
        Unknown("hip_rotation_r", 0.0, radians(4.0), radians(-40.0), radians(40.0)),
        Unknown("knee_angle_r", radians(6.0), radians(3.0), radians(1.0), radians(60.0)),
        *(Unknown(hinge.name, 0.0, radians(7.0), hinge.low, hinge.high) for hinge in ALIGNMENT),
        Unknown("ankle_angle_r", 0.0, radians(10.0), radians(-40.0), radians(30.0)),
        Unknown("subtalar_angle_r", 0.0, radians(2.0), radians(-20.0), radians(20.0)),
    )
    return PoseProblem(
        skeleton=_thinned(skeleton),
        root="pelvis",
        scale_of=_SCALES,
        unknowns=unknowns,
        fixed={"root_rx": 0.0, "root_ry": 0.0, "root_tz": 0.0} | _TOES_AS_THEY_ARE,
        # Tetrahedra and level sets take a little of it. The shank may stand out: the skin is moved afterwards.
        clearance={name: 0.004 for name in BODIES[:-1] if name != "tibia_r"} | {"calcn_r": 0.0030},
        targets=(
            Target("femur_r", np.zeros(3), hip - np.array([0.0, 0.0, 0.02]), 0.010),
            Target("femur_r", np.array([-0.008, -0.408, 0.0]), knee, 0.006),
            Target("talus_r", np.zeros(3), ankle, 0.006),
            *(
                Target("calcn_r", np.array(head), goals[f"toe-{toe}-1"] - _TOE_ROOT, 0.005)
                for toe, head in METATARSAL_HEADS.items()
            ),
        ),
        depths=_depths(skeleton),
        spread=0.0006,
    )


def _toes_problem(skeleton: SourceSkeleton, goals: dict[str, Floats], leg: dict[str, float]) -> PoseProblem:
    """Every toe's direction and size, with the leg held."""
    unknowns, targets = [], []
    for toe in TOES:
        unknowns += [Unknown(hinge.name, 0.0, radians(8.0), hinge.low, hinge.high) for hinge in toe.hinges]
        unknowns += [Unknown(f"log_{toe.name}_along", 0.0, 0.15), Unknown(f"log_{toe.name}_across", -0.1, 0.1)]
        tip = _farthest(skeleton.bodies[toe.name].vertices, (1.0, 0.0, 0.0))
        targets.append(Target(toe.name, tip, goals[_TOE_TIPS[toe.name]] - np.array([0.006, -0.003, 0.0]), 0.004))
    return PoseProblem(
        skeleton=skeleton,
        root="pelvis",
        scale_of=_SCALES,
        unknowns=tuple(unknowns),
        fixed=leg,
        clearance=dict.fromkeys((toe.name for toe in TOES), 0.0028),
        targets=tuple(targets),
        spread=0.0005,
    )


def _depths(skeleton: SourceSkeleton) -> tuple[DepthTarget, ...]:
    """Bony points and how deep they lie beneath the skin of a man of average build."""
    vertices = {name: body.vertices for name, body in skeleton.bodies.items()}
    knee = vertices["femur_r"][vertices["femur_r"][:, 1] < -0.36]
    trochanter = vertices["femur_r"][vertices["femur_r"][:, 1] > -0.06]
    calcaneus = vertices["calcn_r"][vertices["calcn_r"][:, 0] < 0.05]
    tibia = vertices["tibia_r"]
    shin = tibia[tibia[:, 1] > -0.10]
    crest = [_farthest(tibia[np.abs(tibia[:, 1] - height) < 0.02], (1.0, 0.0, -0.3)) for height in _CREST]
    return (
        DepthTarget("pelvis", _farthest(vertices["pelvis"], (1.0, 0.3, 0.5)), 0.012, 0.005),
        DepthTarget("pelvis", _farthest(vertices["pelvis"], (0.0, 0.5, 1.0)), 0.018, 0.006),
        DepthTarget("femur_r", _farthest(trochanter, (0.0, 0.0, 1.0)), 0.022, 0.006),
        DepthTarget("femur_r", _farthest(knee, (0.0, 0.0, -1.0)), 0.012, 0.006),
        DepthTarget("femur_r", _farthest(knee, (0.0, 0.0, 1.0)), 0.012, 0.006),
        DepthTarget("patella_r", _farthest(vertices["patella_r"], (1.0, 0.0, 0.0)), 0.006, 0.002),
        DepthTarget("tibia_r", _farthest(shin, (1.0, 0.0, 0.0)), 0.006, 0.003),
        DepthTarget("tibia_r", _farthest(tibia, (0.0, -0.5, -1.0)), 0.004, 0.004),
        DepthTarget("tibia_r", _farthest(tibia, (0.0, -0.5, 1.0)), 0.004, 0.004),
        *(DepthTarget("tibia_r", at, deep, 0.002) for at, deep in zip(crest, _CREST.values(), strict=True)),
        DepthTarget("calcn_r", _farthest(calcaneus, (-1.0, 0.0, 0.0)), 0.007, 0.003),
        DepthTarget("calcn_r", _farthest(calcaneus, (0.0, -1.0, 0.0)), 0.010, 0.0015),
    )


def _thinned(skeleton: SourceSkeleton) -> SourceSkeleton:
    """The same skeleton with every fourth vertex of the tarsal and metatarsal bones: enough to feel the skin."""
    bodies = {
        name: replace(body, vertices=body.vertices[::4]) if name == "calcn_r" else body
        for name, body in skeleton.bodies.items()
    }
    return replace(skeleton, bodies=bodies)


def _farthest(points: Floats, direction: tuple[float, float, float]) -> Floats:
    return np.asarray(points[np.argmax(points @ np.array(direction))])
