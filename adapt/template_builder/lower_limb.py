"""What the build needs to know about the right lower limb, and nothing about how to build.

Names of bodies and hinges are myo-sim's, names of joint centres MakeHuman's, names, signs and ranges of coordinates
OpenSim's (Rajagopal et al. 2016), landmarks and bone frames in the spirit of the ISB (Wu et al. 2002). In the frame
of every source body X points forward, Y up and Z to the right, for a standing leg (the zero of all hinges).

The limb is the right half of the pelvis and the leg: cut at the waist and along the body's middle, so that the hip
bone has skin of its own (buttock, flank, groin) by which it can be followed. It is the root and moves freely.
"""

from __future__ import annotations

from functools import partial
from math import pi, radians

import numpy as np

from adapt.anatomy import Coordinate, Deformer, Frame, Joint
from adapt.template_builder.coupled_joint import child_in_parent
from adapt.template_builder.knee import KNEE_KNOTS, PATELLA_KNOTS, PATELLAR_FACETS, PATELLOFEMORAL, PLATEAU, WALKER_KNEE
from adapt.template_builder.lower_limb_pose import ALIGNMENT, BODIES, METATARSAL_HEADS, TOES, pose_lower_limb
from adapt.template_builder.plan import (
    AxisPlan,
    BonePlan,
    HandlePlan,
    HeldPart,
    LimbPlan,
    PointPlan,
    RampPlan,
    SkinPlan,
    SplinePlan,
)
from adapt.template_builder.skin import Cut
from adapt.template_builder.sources_myosim import Follow
from adapt.template_builder.upper_limb import SKIN as UPPER_LIMB_SKIN

SKIN = SkinPlan(
    # One body for all limbs, but for its knees: MakeHuman's shank is long and its thigh short. With these two targets
    # stature and hip stay and the knee comes down 29 mm, to where Drillis & Contini (1966) have it.
    targets=UPPER_LIMB_SKIN.targets
    | {"legs/measure-upperleg-height-incr": 0.30, "legs/measure-lowerleg-height-decr": 0.45},
    stature=UPPER_LIMB_SKIN.stature,
    # Above the crest of the hip bone, and 4 mm to the left of the middle, where both hip bones meet.
    cuts=(Cut(point=(0.0, 0.30, 0.0), normal=(0.0, -1.0, 0.0)), Cut(point=(0.0, 0.0, -0.004), normal=(0.0, 0.0, 1.0))),
    tip="r-foot-2",
    count=8000,
    tet_edge=0.016,
)

FOLLOWS = {
    "tibia_r": Follow("knee_angle_r", partial(child_in_parent, WALKER_KNEE), (-0.006, -0.018, 0.003), ALIGNMENT),
    "patella_r": Follow("knee_angle_r", partial(child_in_parent, PATELLOFEMORAL), (-0.008, 0.027, 0.0)),
}

POINTS = (
    PointPlan("HJC", "femur_r", "at"),
    PointPlan("ASIS", "pelvis", "extreme", (1.0, 0.3, 0.5)),
    PointPlan("iliac_crest", "pelvis", "extreme", (0.0, 1.0, 0.2)),
    PointPlan("PSIS", "pelvis", "extreme", (-1.0, 0.3, 0.0)),
    PointPlan("ischium", "pelvis", "extreme", (-0.3, -1.0, 0.2)),
    PointPlan("above_hip", "pelvis", "at", (-0.0563, 0.0300, 0.0773)),
    PointPlan("pubis", "pelvis", "extreme", (1.0, -0.5, -1.0)),
    PointPlan("trochanter", "femur_r", "extreme", (0.0, 0.0, 1.0), (1, -0.06, 0.1)),
    PointPlan("FME", "femur_r", "extreme", (0.0, 0.0, -1.0), (1, -0.45, -0.36)),
    PointPlan("FLE", "femur_r", "extreme", (0.0, 0.0, 1.0), (1, -0.45, -0.36)),
    PointPlan("knee", "femur_r", "at", WALKER_KNEE.location_in_parent),
    PointPlan("patella_base", "patella_r", "extreme", (0.0, 1.0, 0.0)),
    PointPlan("patella_apex", "patella_r", "extreme", (0.0, -1.0, 0.0)),
    PointPlan("patella_medial", "patella_r", "extreme", (0.0, 0.0, -1.0)),
    PointPlan("patella_lateral", "patella_r", "extreme", (0.0, 0.0, 1.0)),
    PointPlan("plateau_medial", "tibia_r", "at", PLATEAU.medial),
    PointPlan("plateau_lateral", "tibia_r", "at", PLATEAU.lateral),
    PointPlan("tibial_tuberosity", "tibia_r", "extreme", (1.0, 0.0, 0.0), (1, -0.10, -0.045)),
    PointPlan("MM", "tibia_r", "extreme", (0.0, -0.5, -1.0)),
    PointPlan("LM", "tibia_r", "extreme", (0.0, -0.5, 1.0)),
    PointPlan("talus", "talus_r", "at"),
    PointPlan("heel", "calcn_r", "extreme", (-1.0, 0.0, 0.0)),
    PointPlan("sole", "calcn_r", "extreme", (-0.3, -1.0, 0.0), (0, -0.1, 0.06)),
    PointPlan("MT1_head", "calcn_r", "at", METATARSAL_HEADS[1]),
    PointPlan("MT2_head", "calcn_r", "at", METATARSAL_HEADS[2]),
    PointPlan("MT5_head", "calcn_r", "at", METATARSAL_HEADS[5]),
    PointPlan("toe1_tip", "toe1", "extreme", (1.0, 0.0, 0.0)),
    PointPlan("toe5_tip", "toe5", "extreme", (1.0, 0.0, 0.0)),
    # Where skin starts and stops to bend with a joint: a point of each plane and one beside it along its normal.
    PointPlan("hip_bend_start", "pelvis", "at", (-0.0583, -0.0577, 0.0773)),
    PointPlan("hip_bend_start_normal", "pelvis", "at", (-0.0519, -0.0743, 0.0862)),
    PointPlan("hip_bend_end", "femur_r", "at", (-0.0066, -0.1167, -0.0222)),
    PointPlan("hip_bend_end_normal", "femur_r", "at", (-0.0093, -0.1355, -0.0160)),
    PointPlan("knee_bend_start", "femur_r", "at", (-0.0053, -0.3601, 0.0091)),
    PointPlan("knee_bend_start_normal", "femur_r", "at", (-0.0123, -0.3787, 0.0063)),
    PointPlan("knee_bend_end", "tibia_r", "at", (-0.0093, -0.0492, -0.0073)),
    PointPlan("knee_bend_end_normal", "tibia_r", "at", (-0.0031, -0.0656, -0.0097)),
    PointPlan("ankle_bend_start", "tibia_r", "at", (-0.0088, -0.3616, 0.0053)),
    PointPlan("ankle_bend_start_normal", "tibia_r", "at", (-0.0071, -0.3786, 0.0029)),
    PointPlan("ankle_bend_end", "talus_r", "at", (-0.0005, -0.0082, -0.0010)),
    PointPlan("ankle_bend_end_normal", "talus_r", "at", (0.0049, -0.0280, -0.0037)),
)

# A positive turn is right-handed about first -> second. The hip's axes ride on each other in this order.
AXES = (
    AxisPlan(
        ("hip_flexion_axis_medial", "hip_flexion_axis_lateral"), "femur_r", "pelvis", (0.0, 0.0, 1.0), (-0.012, 0.012)
    ),
    AxisPlan(
        ("hip_adduction_axis_back", "hip_adduction_axis_front"),
        "femur_r",
        "pelvis",
        (1.0, 0.0, 0.0),
        (-0.012, 0.012),
        after=("hip_flexion_r",),
    ),
    AxisPlan(
        ("hip_rotation_axis_low", "hip_rotation_axis_high"), "femur_r", "femur_r", (0.0, 1.0, 0.0), (-0.012, 0.012)
    ),
    AxisPlan(
        ("ankle_axis_medial", "ankle_axis_lateral"),
        "talus_r",
        "tibia_r",
        (-0.105014, -0.174022, 0.979126),
        (-0.012, 0.012),
    ),
)

_HIP = tuple(axis.names for axis in AXES[:3])
_ANKLE = AXES[3].names
_EPICONDYLES, _MALLEOLI, _PLATEAUS = ("FME", "FLE"), ("MM", "LM"), ("plateau_medial", "plateau_lateral")

BONES = (
    BonePlan(
        "pelvis",
        ("pelvis",),
        count=2000,
        spacing=0.0012,
        blur=0.0012,
        envelope=0.0,
        tet_edge=0.007,
        # The source's axes, about the hip.
        frame=Frame(("HJC",), ("HJC",), ("above_hip",), *((name,) for name in _HIP[0])),
    ),
    BonePlan(
        "femur",
        ("femur_r",),
        count=3000,
        spacing=0.0012,
        blur=0.0012,
        envelope=0.0,
        tet_edge=0.007,
        frame=Frame(("HJC",), _EPICONDYLES, ("HJC",), ("FME",), ("FLE",)),
    ),
    BonePlan(
        "tibia",
        ("tibia_r",),
        count=3000,
        spacing=0.0010,
        blur=0.0010,
        envelope=0.0025,
        tet_edge=0.006,
        frame=Frame(_MALLEOLI, _MALLEOLI, _PLATEAUS, ("MM",), ("LM",)),
    ),
    BonePlan(
        "patella",
        ("patella_r",),
        count=1500,
        spacing=0.0008,
        blur=0.0008,
        envelope=0.0,
        tet_edge=0.004,
        frame=Frame(
            ("patella_base", "patella_apex"),
            ("patella_apex",),
            ("patella_base",),
            ("patella_medial",),
            ("patella_lateral",),
        ),
    ),
    BonePlan(
        "foot",
        ("talus_r", "calcn_r", *(toe.name for toe in TOES)),
        count=7000,
        spacing=0.0005,
        blur=0.0004,
        envelope=0.0045,
        tet_edge=0.006,
        frame=Frame(("talus",), ("sole",), ("talus",), ("MT1_head",), ("MT5_head",)),
    ),
)

HANDLES = (
    HandlePlan("pelvis_proximal", "pelvis", "crest", PointPlan("", "pelvis", "at", (-0.1144, 0.0258, 0.0480))),
    # Around the socket: above, behind and before it.
    HandlePlan(
        "pelvis_distal",
        "pelvis",
        "hip",
        PointPlan("", "pelvis", "at", (-0.0605, -0.0351, 0.0765)),
        also=(
            PointPlan("", "pelvis", "at", (-0.0807, -0.0806, 0.0563)),
            PointPlan("", "pelvis", "at", (-0.0309, -0.0757, 0.0512)),
        ),
    ),
    # The head, and the trochanter.
    HandlePlan(
        "femur_proximal",
        "femur",
        "hip",
        PointPlan("", "femur_r", "at"),
        also=(PointPlan("", "femur_r", "at", (-0.0080, -0.0120, 0.0420)),),
    ),
    HandlePlan("femur_distal", "femur", "knee", PointPlan("", "femur_r", "at", (0.0, -0.4000, 0.0020))),
    HandlePlan("tibia_proximal", "tibia", "knee", PointPlan("", "tibia_r", "at", (-0.0022, -0.0402, 0.0100))),
    HandlePlan("patella_proximal", "patella", "knee", PointPlan("", "patella_r", "at", (0.0020, 0.0400, 0.0))),
    HandlePlan("patella_distal", "patella", "knee", PointPlan("", "patella_r", "at", (0.0024, 0.0120, 0.0))),
    HandlePlan(
        "tibia_distal",
        "tibia",
        "ankle",
        PointPlan("", "tibia_r", "at", (-0.0067, -0.3750, -0.0070)),
        also=(PointPlan("", "tibia_r", "at", (-0.0165, -0.3847, 0.0234)),),
    ),
    HandlePlan(
        "foot_proximal",
        "foot",
        "ankle",
        PointPlan("", "talus_r", "at", (0.0076, 0.0014, 0.0054)),
        also=(
            PointPlan("", "talus_r", "at", (0.0180, 0.0000, -0.0040)),
            PointPlan("", "calcn_r", "at", (0.0400, 0.0180, -0.0030)),
        ),
    ),
    # The heads of all metatarsals: toes are held still, so beyond them the foot scales and shifts as one.
    HandlePlan(
        "foot_distal",
        "foot",
        "toes",
        PointPlan("", "calcn_r", "at", METATARSAL_HEADS[2]),
        also=tuple(PointPlan("", "calcn_r", "at", METATARSAL_HEADS[k]) for k in (1, 3, 4, 5)),
    ),
)

_TURN, _REACH = 2.0 * pi, 10.0

# The root's are a rotation vector and the hip's centre, not OpenSim's pelvis_tilt to pelvis_tz.
COORDINATES = (
    Coordinate("hip_rx", "rad", -_TURN, _TURN, 0.0),
    Coordinate("hip_ry", "rad", -_TURN, _TURN, 0.0),
    Coordinate("hip_rz", "rad", -_TURN, _TURN, 0.0),
    Coordinate("hip_tx", "m", -_REACH, _REACH, 0.0),
    Coordinate("hip_ty", "m", -_REACH, _REACH, 0.0),
    Coordinate("hip_tz", "m", -_REACH, _REACH, 0.0),
    Coordinate("hip_flexion_r", "rad", radians(-30.0), radians(120.0), 0.0),
    Coordinate("hip_adduction_r", "rad", radians(-50.0), radians(30.0), 0.0),
    Coordinate("hip_rotation_r", "rad", radians(-40.0), radians(40.0), 0.0),
    Coordinate("knee_angle_r", "rad", 0.0, radians(120.0), 0.0),
    Coordinate("ankle_angle_r", "rad", radians(-40.0), radians(30.0), 0.0),
)

SPLINES = (
    SplinePlan("knee", WALKER_KNEE, PLATEAU, KNEE_KNOTS, "femur", "tibia", "femur_r", "knee_angle_r", ("knee",)),
    SplinePlan(
        "patellofemoral",
        PATELLOFEMORAL,
        PATELLAR_FACETS,
        PATELLA_KNOTS,
        "femur",
        "patella",
        "femur_r",
        "knee_angle_r",
        ("patella_medial", "patella_lateral"),
    ),
)

JOINTS = (
    Joint("pelvis", "free", None, "pelvis", tuple(c.name for c in COORDINATES[:6]), (), ("HJC",)),
    Joint("hip", "ball", "pelvis", "femur", tuple(c.name for c in COORDINATES[6:9]), _HIP, ("HJC",)),
    *(spline.joint(np.asarray)[0] for spline in SPLINES),
    Joint("ankle", "hinge", "tibia", "foot", ("ankle_angle_r",), (_ANKLE,), ("talus",)),
)


def _plane(name: str, across: tuple[str, str]) -> Frame:
    return Frame((name,), (name,), (f"{name}_normal",), (across[0],), (across[1],))


def _bend(
    name: str, bones: tuple[str, str], centre: str, towards: tuple[str, ...], across: tuple[str, str]
) -> Deformer:
    start, end = (_plane(f"{name}_bend_{end}", across) for end in ("start", "end"))
    return Deformer(name, "bend", bones, (start, end, Frame((centre,), (centre,), towards, (across[0],), (across[1],))))


DEFORMERS = (
    _bend("hip", ("pelvis", "femur"), "HJC", _EPICONDYLES, _HIP[0]),
    _bend("knee", ("femur", "tibia"), "knee", _MALLEOLI, _EPICONDYLES),
    _bend("ankle", ("tibia", "foot"), "talus", ("sole",), _ANKLE),
)

LOWER_LIMB_RIGHT = LimbPlan(
    name="lower-limb-right",
    side="right",
    facts=(
        (
            "knee and kneecap over flexion; joint axes, ranges, signs and names of coordinates",
            "Rajagopal et al. (2016)",
        ),
        ("landmarks, bone frames", "after Wu et al. (2002), ISB"),
    ),
    notes="""\
## Choices

- The limb is cut at the waist and along the body's middle, so that the right hip bone has skin of its own. It is the
  root (free, six coordinates); the hip is a ball of three. The sacrum and the left hip bone are left out.
- Tibia and fibula are one bone, and so are talus, calcaneus, metatarsals and toes: no subtalar joint, since the talus
  has no skin of its own.
- The shank stands askew under the knee (varus and torsion below): MakeHuman's leg is bowed and its foot points forward,
  where the source's are straight and turned out. Every toe is laid into its own.
""",
    skin=SKIN,
    bodies=BODIES,
    without=("l_pelvis",),
    pieces=TOES,
    follows=FOLLOWS,
    # A little out of the socket, which in the source is coarse and shallow: the femur stands in it by 10 mm.
    shifts={"femur_r": (0.0030, -0.0025, 0.0030)},
    bones=BONES,
    points=POINTS,
    axes=AXES,
    splines=SPLINES,
    handles=HANDLES,
    joints=JOINTS,
    coordinates=COORDINATES,
    rest_from={name: (name, 1.0) for name in (c.name for c in COORDINATES[6:])},
    deformers=DEFORMERS,
    # Between a bend's end and the next one's start skin rides on one bone, whichever of the two carries it.
    held=(
        HeldPart("hip", "femur", "knee", "HJC", 0.26),
        HeldPart("knee", "femur", "HJC", "knee", 0.285),
        HeldPart("knee", "tibia", "talus", "knee", 0.265),
        HeldPart("ankle", "tibia", "knee", "talus", 0.265),
    ),
    cushions=(),
    # The skin near the cuts also follows the trunk and the other leg; the toes are held still by the model.
    fit_near_cut=((0.0, 0.05), (0.04, 1.0)),
    fit_ramps=(RampPlan("talus", "toe1_tip", (0.13, 0.16, 0.20), (1.0, 0.7, 0.3)),),
    pose=pose_lower_limb,
)
