"""The bones of the lower limb: their parts, landmarks, axes and frames."""

from __future__ import annotations

from functools import partial

from adapt.anatomy import Frame
from adapt.template_builder.coupled_joint import child_in_parent
from adapt.template_builder.knee import PATELLOFEMORAL, PLATEAU, WALKER_KNEE
from adapt.template_builder.lower_limb_pose import ALIGNMENT, METATARSAL_HEADS, TOES
from adapt.template_builder.plan import (
    AxisPlan,
    BonePlan,
    PointPlan,
    SkinPlan,
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
    "tibia_r": Follow("knee_angle_r", partial(child_in_parent, WALKER_KNEE), (-0.006, -0.010, 0.003), ALIGNMENT),
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
    PointPlan("fibular_head", "tibia_r", "extreme", (-0.2, 0.3, 1.0), (1, -0.075, -0.045)),
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


HIP = tuple(axis.names for axis in AXES[:3])
ANKLE = AXES[3].names
EPICONDYLES, MALLEOLI, PLATEAUS = ("FME", "FLE"), ("MM", "LM"), ("plateau_medial", "plateau_lateral")

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
        frame=Frame(("HJC",), ("HJC",), ("above_hip",), *((name,) for name in HIP[0])),
    ),
    BonePlan(
        "femur",
        ("femur_r",),
        count=3000,
        spacing=0.0012,
        blur=0.0012,
        envelope=0.0,
        tet_edge=0.007,
        frame=Frame(("HJC",), EPICONDYLES, ("HJC",), ("FME",), ("FLE",)),
    ),
    BonePlan(
        "tibia",
        ("tibia_r",),
        count=3000,
        spacing=0.0010,
        blur=0.0010,
        envelope=0.0025,
        tet_edge=0.006,
        frame=Frame(MALLEOLI, MALLEOLI, PLATEAUS, ("MM",), ("LM",)),
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
