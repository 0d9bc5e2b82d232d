"""What the build needs to know about the whole body, and nothing about how to build.

Arms and legs have landmarks, axes, splines, handles and depths from the plans of the limbs (``upper_limb``,
``lower_limb``). The tree of joints, names, signs and ranges of the coordinates are those of OpenSim's
CompleteHumanModel (Rajagopal's legs, Holzbaur's arm, Seth's shoulder blade, spine of constant curvature), with a collar
bone besides, which it has not. Names without a side are the right side's (``body_bones``); the left is its image.
"""

from __future__ import annotations

from dataclasses import replace
from math import pi, radians

from adapt.anatomy import Coordinate, Deformer, Frame, Joint
from adapt.template_builder import lower_limb as leg
from adapt.template_builder import upper_limb as arm
from adapt.template_builder.body_bones import AXES, BONES, MTP, POINTS, SUBTALAR
from adapt.template_builder.body_skin import Finer
from adapt.template_builder.lower_limb_bones import ANKLE
from adapt.template_builder.lower_limb_pose import METATARSAL_HEADS
from adapt.template_builder.plan import AnatomyPlan, HandlePlan, HeldPart, PointPlan, RampPlan

COUNT, TET_EDGE = 14000, 0.030
FINER = (
    Finer("r-hand", "r-finger-3-1", 1.9, (-0.02, 0.03)),
    Finer("r-ankle", "r-foot-1", 1.6, (-0.03, 0.03)),
    Finer("neck", "head-2", 1.35, (0.0, 0.06)),
)
# Tetrahedra, too, are smaller there: with longer fades, which leave them all positive.
TET_FINER = (
    Finer("r-hand", "r-finger-3-1", 1.8, (-0.05, 0.07)),
    Finer("r-ankle", "r-foot-1", 1.8, (-0.08, 0.05)),
)


def _at(body: str, point: tuple[float, float, float]) -> PointPlan:
    return PointPlan("", body, "at", point)


def _each(body: str, *points: tuple[float, float, float]) -> tuple[PointPlan, ...]:
    return tuple(_at(body, point) for point in points)


_LEG = {handle.name: handle for handle in leg.HANDLES}
_ARM = {handle.name: handle for handle in arm.HANDLES}

HANDLES = (
    HandlePlan("pelvis_lumbar", "pelvis", "lumbosacral", _at("sacrum", (-0.098, 0.045, 0.0))),
    replace(_LEG["pelvis_distal"], name="pelvis_hip_r", joint="hip_r"),
    HandlePlan("lumbar_low", "lumbar", "lumbosacral", PointPlan("", "lumbar5", "middle", within=(0, -0.015, 0.1))),
    HandlePlan("lumbar_high", "lumbar", "thoracolumbar", PointPlan("", "lumbar1", "middle", within=(0, -0.015, 0.1))),
    HandlePlan("thorax_low", "thorax", "thoracolumbar", _at("thorax", (-0.008, 0.018, 0.0))),
    HandlePlan("thorax_high", "thorax", "cervicothoracic", _at("thorax", (-0.014, 0.270, 0.0))),
    HandlePlan("thorax_SC_r", "thorax", "SC_r", _at("thorax", (0.0410, 0.2400, 0.0100))),
    HandlePlan("head_low", "head", "cervicothoracic", PointPlan("", "c7", "middle", within=(0, -0.015, 0.1))),
    HandlePlan("head_high", "head", "skull", _at("head", (-0.01, 0.0, 0.0)), also=_each("head", (0.0, 0.14, 0.0))),
    HandlePlan("clavicle_proximal", "clavicle", "SC", PointPlan("", "clavicle_r", "middle", within=(2, -0.01, 0.02))),
    HandlePlan(
        "clavicle_distal", "clavicle", "shoulder", PointPlan("", "clavicle_r", "middle", within=(2, 0.105, 0.2))
    ),
    # Around the socket, at the acromion and at the lower angle: the blade is as large as its shoulder.
    HandlePlan(
        "scapula_lateral",
        "scapula",
        "shoulder",
        _at("scapula_r", (-0.0350, -0.0371, -0.0162)),
        also=_each("scapula_r", (-0.0205, -0.0031, -0.0004), (-0.1004, -0.1047, -0.0740), (-0.0795, -0.0303, -0.0852)),
    ),
    *(_ARM[name] for name in ("humerus_proximal", "humerus_distal", "ulna_proximal", "ulna_distal")),
    *(_ARM[name] for name in ("radius_proximal", "radius_distal", "hand_proximal", "hand_distal")),
    *(_LEG[name] for name in ("femur_proximal", "femur_distal", "tibia_proximal")),
    *(_LEG[name] for name in ("patella_proximal", "patella_distal", "tibia_distal")),
    HandlePlan("talus_middle", "talus", "ankle", _at("talus_r", (0.0076, 0.0014, 0.0054))),
    HandlePlan("calcn_proximal", "calcn", "ankle", _at("calcn_r", (0.0400, 0.0180, -0.0030))),
    HandlePlan(
        "calcn_distal",
        "calcn",
        "mtp",
        _at("calcn_r", METATARSAL_HEADS[2]),
        also=_each("calcn_r", *(METATARSAL_HEADS[k] for k in (1, 3, 4, 5))),
    ),
    HandlePlan("toes_proximal", "toes", "mtp", PointPlan("", "toe2", "middle")),
)

_TURN, _REACH = 2.0 * pi, 10.0


def _of(names: tuple[str, ...], ranges: tuple[tuple[float, float], ...]) -> tuple[Coordinate, ...]:
    return tuple(Coordinate(name, "rad", low, high, 0.0) for name, (low, high) in zip(names, ranges, strict=True))


PELVIS = tuple(f"pelvis_{way}" for way in ("rx", "ry", "rz", "tx", "ty", "tz"))
SPINE = {
    joint: tuple(f"{part}_{way}" for way in ("bending", "extension", "twist"))
    for joint, part in (("lumbar", "lumbar"), ("thoracic_spine", "thorax"), ("neck", "head"))
}
BLADE = ("scapula_abduction", "scapula_elevation", "scapula_upward_rot")
SHOULDER = ("shoulder_rx", "shoulder_ry", "shoulder_rz")

# Of the spine's extensions the ranges are about how it stands at rest; zero is a straight stretch.
COORDINATES = (
    *(Coordinate(name, "rad", -_TURN, _TURN, 0.0) for name in PELVIS[:3]),
    *(Coordinate(name, "m", -_REACH, _REACH, 0.0) for name in PELVIS[3:]),
    *_of(SPINE["lumbar"], ((-1.13, 1.13), (-1.13, 0.524), (-0.26, 0.26))),
    *_of(SPINE["thoracic_spine"], ((-0.52, 0.52), (-0.45, 0.36), (-0.82, 0.82))),
    *_of(SPINE["neck"], ((-1.01, 1.01), (-1.09, 1.09), (-1.44, 1.44))),
    *_of(BLADE, ((-1.5, -0.9), (-0.2, 0.1), (-0.3, 1.0))),
    *_of(SHOULDER, ((-pi, pi),) * 3),
    *_of(("elbow_flexion", "pro_sup"), ((0.0, radians(130.0)), (radians(-90.0), radians(90.0)))),
    *_of(("wrist_deviation", "wrist_flexion"), ((radians(-25.0), radians(35.0)), (radians(-70.0), radians(70.0)))),
    *leg.COORDINATES[6:],
    *_of(("subtalar_angle", "mtp_angle"), ((radians(-20.0), radians(20.0)), (radians(-30.0), radians(30.0)))),
)


def _curve(name: str, parent: str, child: str, base: str, top: str) -> Joint:
    frame = Frame((base,), (base,), (top,), ("HJC_l",), ("HJC_r",))
    return Joint(name, "curve", parent, child, SPINE[name], (), (base,), frames=(frame,))


_ARM_JOINTS = {joint.name: joint for joint in arm.JOINTS}
_WRIST_NAMES = ("wrist_deviation", "wrist_flexion")
_ELLIPSOID = ("ellipsoid_centre", "ellipsoid_front", "ellipsoid_top", "ellipsoid_side")

JOINTS = (
    Joint("pelvis", "free", None, "pelvis", PELVIS, (), ("HJC_r", "HJC_l")),
    _curve("lumbar", "pelvis", "lumbar", "lumbar_base", "lumbar_top"),
    _curve("thoracic_spine", "lumbar", "thorax", "lumbar_top", "thorax_top"),
    _curve("neck", "thorax", "head", "thorax_top", "neck_top"),
    Joint(
        "scapulothoracic",
        "ellipsoid",
        "thorax",
        "scapula",
        BLADE,
        tuple((_ELLIPSOID[0], end) for end in _ELLIPSOID[1:]),
        ("TS", "AI", "AA"),
        frames=(Frame(_ELLIPSOID[:1], _ELLIPSOID[:1], _ELLIPSOID[2:3], _ELLIPSOID[:1], _ELLIPSOID[3:]),),
    ),
    Joint(
        "sternoclavicular",
        "strut",
        "thorax",
        "clavicle",
        (),
        (("SC", "AC"),),
        ("SC",),
        frames=(Frame(("SC",), ("SC",), ("SC_above",), ("SC",), ("SC_beside",)),),
        other="scapula",
    ),
    Joint(
        "shoulder",
        "socket",
        "scapula",
        "humerus",
        SHOULDER,
        (),
        ("GH",),
        frames=(Frame(("GH",), ("shoulder_low",), ("shoulder_high",), ("shoulder_inner",), ("shoulder_outer",)),),
    ),
    _ARM_JOINTS["elbow"],
    _ARM_JOINTS["radioulnar"],
    replace(_ARM_JOINTS["wrist"], coordinates=_WRIST_NAMES),
    *(joint for joint in leg.JOINTS[1:] if joint.name in ("hip", "knee", "patellofemoral")),
    Joint("ankle", "hinge", "tibia", "talus", ("ankle_angle_r",), (ANKLE,), ("talus",)),
    Joint("subtalar", "hinge", "talus", "calcn", ("subtalar_angle",), (SUBTALAR,), SUBTALAR),
    Joint("mtp", "hinge", "calcn", "toes", ("mtp_angle",), (MTP,), MTP),
)

_LEG_BENDS = {deformer.name: deformer for deformer in leg.DEFORMERS}
_ARM_SKIN = {deformer.name: deformer for deformer in arm.DEFORMERS}


def _plane(name: str) -> Frame:
    return Frame((name,), (name,), (f"{name}_normal",), ("shoulder_inner",), ("shoulder_outer",))


def _curved(name: str, bones: tuple[str, str], part: str) -> Deformer:
    """Skin along a curve, between two planes across it."""
    ends = (f"{part}_bend_{end}" for end in ("start", "end"))
    frames = tuple(Frame((end,), (end,), (f"{end}_normal",), ("HJC_l",), ("HJC_r",)) for end in ends)
    return Deformer(name, "curve", bones, frames)


DEFORMERS = (
    Deformer("skull", "rigid", ("head",)),
    _curved("lumbar_curve", ("pelvis", "lumbar"), "lumbar"),
    _curved("thoracic_curve", ("lumbar", "thorax"), "thorax"),
    _curved("neck_curve", ("thorax", "head"), "neck"),
    Deformer(
        "shoulder",
        "bend",
        ("scapula", "humerus"),
        (
            _plane("shoulder_bend_start"),
            _plane("shoulder_bend_end"),
            Frame(("GH",), ("GH",), ("EM", "EL"), ("shoulder_inner",), ("shoulder_outer",)),
        ),
    ),
    _ARM_SKIN["forearm"],
    _ARM_SKIN["hand"],
    _LEG_BENDS["hip"],
    _LEG_BENDS["knee"],
    replace(_LEG_BENDS["ankle"], bones=("tibia", "calcn")),
    Deformer("toes", "rigid", ("toes",)),
)

BODY = AnatomyPlan(
    name="body",
    side="both",
    upstream=tuple(dict.fromkeys((*arm.UPPER_LIMB_RIGHT.upstream, *leg.LOWER_LIMB_RIGHT.upstream))),
    facts=(
        (
            "tree of joints; names, signs and ranges of coordinates; the blade's ellipsoid",
            "CompleteHumanModel (BSD-2-Clause) after Rajagopal et al. (2016) and Seth et al. (2016)",
        ),
        *arm.UPPER_LIMB_RIGHT.facts[:-1],
        *leg.LOWER_LIMB_RIGHT.facts,
        ("landmarks, bone frames", "after Wu et al. (2002, 2005), ISB"),
        ("heights of C7 and breastbone over stature", "ANSUR, 1,774 men (Gordon et al. 1989)"),
    ),
    notes="",
    bones=BONES,
    points=POINTS,
    axes=AXES,
    splines=leg.SPLINES,
    handles=HANDLES,
    joints=JOINTS,
    coordinates=COORDINATES,
    rest_from={
        "elbow_flexion": ("elbow_flexion_r", 1.0),
        "pro_sup": ("pro_sup_r", 1.0),
        "wrist_deviation": ("deviation_r", -1.0),
        "wrist_flexion": ("flexion_r", 1.0),
        "subtalar_angle": ("subtalar_angle_r", 1.0),
    }
    | leg.LOWER_LIMB_RIGHT.rest_from,
    deformers=DEFORMERS,
    held=(
        *leg.LOWER_LIMB_RIGHT.held[:3],
        HeldPart("ankle", "tibia", "knee", "talus", 0.265),
        *arm.UPPER_LIMB_RIGHT.held,
    ),
    cushions=arm.UPPER_LIMB_RIGHT.cushions,
    fit_ramps=(*arm.UPPER_LIMB_RIGHT.fit_ramps, RampPlan("talus", "toe1_tip", (0.13, 0.16, 0.20), (1.0, 0.7, 0.3))),
    spots=(*arm.UPPER_LIMB_RIGHT.spots, *leg.LOWER_LIMB_RIGHT.spots),
    clearance=arm.UPPER_LIMB_RIGHT.clearance
    | {name: depth for name, depth in leg.LOWER_LIMB_RIGHT.clearance.items() if name != "foot"}
    | dict.fromkeys(("talus", "calcn", "toes"), leg.LOWER_LIMB_RIGHT.clearance["foot"])
    | {"lumbar": 0.004, "thorax": 0.004, "head": 0.002, "clavicle": 0.003, "scapula": 0.004},
)
