"""What the build needs to know about the right lower limb, and nothing about how to build.

Names of bodies and hinges are myo-sim's, names of joint centres MakeHuman's, names, signs and ranges of coordinates
OpenSim's (Rajagopal et al. 2016), landmarks and bone frames in the spirit of the ISB (Wu et al. 2002). In the frame
of every source body X points forward, Y up and Z to the right, for a standing leg (the zero of all hinges).

The limb is the right half of the pelvis and the leg: cut at the waist and along the body's middle, so that the hip
bone has skin of its own (buttock, flank, groin) by which it can be followed. It is the root and moves freely.
"""

from __future__ import annotations

from math import pi, radians

import numpy as np

from adapt.anatomy import Coordinate, Deformer, Frame, Joint
from adapt.template_builder.knee import KNEE_KNOTS, PATELLA_KNOTS, PATELLAR_FACETS, PATELLOFEMORAL, PLATEAU, WALKER_KNEE
from adapt.template_builder.lower_limb_bones import (
    ANKLE,
    AXES,
    BONES,
    EPICONDYLES,
    FOLLOWS,
    HIP,
    MALLEOLI,
    POINTS,
    SKIN,
)
from adapt.template_builder.lower_limb_depths import CLEARANCE, SPOTS
from adapt.template_builder.lower_limb_pose import BODIES, METATARSAL_HEADS, TOES, pose_lower_limb
from adapt.template_builder.plan import (
    HandlePlan,
    HeldPart,
    LimbPlan,
    PointPlan,
    RampPlan,
    SplinePlan,
)
from adapt.template_builder.sources_myosim import BONE_GEOMETRY

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
    Joint("hip", "ball", "pelvis", "femur", tuple(c.name for c in COORDINATES[6:9]), HIP, ("HJC",)),
    *(spline.joint(np.asarray)[0] for spline in SPLINES),
    Joint("ankle", "hinge", "tibia", "foot", ("ankle_angle_r",), (ANKLE,), ("talus",)),
)


def _plane(name: str, across: tuple[str, str]) -> Frame:
    return Frame((name,), (name,), (f"{name}_normal",), (across[0],), (across[1],))


def _bend(
    name: str, bones: tuple[str, str], centre: str, towards: tuple[str, ...], across: tuple[str, str]
) -> Deformer:
    start, end = (_plane(f"{name}_bend_{end}", across) for end in ("start", "end"))
    return Deformer(name, "bend", bones, (start, end, Frame((centre,), (centre,), towards, (across[0],), (across[1],))))


DEFORMERS = (
    _bend("hip", ("pelvis", "femur"), "HJC", EPICONDYLES, HIP[0]),
    _bend("knee", ("femur", "tibia"), "knee", MALLEOLI, EPICONDYLES),
    _bend("ankle", ("tibia", "foot"), "talus", ("sole",), ANKLE),
)

LOWER_LIMB_RIGHT = LimbPlan(
    name="lower-limb-right",
    side="right",
    upstream=(
        BONE_GEOMETRY,
        ("that leg's joints before that", "the full body gait model of Rajagopal et al. (2016)", "MIT"),
    ),
    facts=(
        (
            "knee and kneecap over flexion; joint axes, ranges, signs and names of coordinates",
            "Rajagopal et al. (2016)",
        ),
        ("landmarks, bone frames", "after Wu et al. (2002), ISB"),
        (
            "how the skin beside the hip moves",
            "weights of MakeHuman's `default` and `mixamo` rigs; Fiorentino et al. (2017), Gait & Posture; Rouhandeh & "
            "Joslin (2018), SciTePress; Fukui et al. (2016), Skin Research and Technology 22(2)",
        ),
    ),
    notes="""\
## Choices

- The limb is cut at the waist and along the body's middle, so that the right hip bone has skin of its own. It is the
  root (free, six coordinates); the hip is a ball of three. The sacrum and the left hip bone are left out.
- Tibia and fibula are one bone, and so are talus, calcaneus, metatarsals and toes: no subtalar joint, since the talus
  has no skin of its own.
- The shank stands askew under the knee (varus and torsion below): MakeHuman's leg is bowed and its foot points forward,
  where the source's are straight and turned out. Every toe is laid into its own.
- The shank's bones are nearly as thick for their length as the source's. MakeHuman's skin is too narrow for them at
  the ankle (its malleoli stand 63 mm apart; those of the 4,082 men of ANSUR II 75 mm, standard deviation 4), too
  thick in front of and beside the shank's upper end and over the iliac crest, and gives way: see the depths below.
- The hip's bend zone is still the former one, chosen by eye, and known to lie low: the thigh's share of the skin
  between hip and iliac crest is 0.06, in two riggings of this body made by two hands (MakeHuman's `default` and
  `mixamo`) 0.23 and 0.25; at the trochanter 0.49 (0.74, 0.89); over the ASIS 0 (0.18, 0.16). Planes that fit the mean
  of the two give 0.23, 0.74 and 0.26. But the skin then turns about the hip over ASIS and crest, where people's
  slides over the bone, and the hip bone comes out of it by 5 to 15 mm where the hip is flexed, spread and turned at
  once: this deformer cannot have both. People's skin says which way the zone should go, not how far. Markers on the
  skin of pelvis and thigh move by 3 to 54 mm against the bones in walking and as the hip spreads and turns
  (Fiorentino et al. 2017, by dual fluoroscopy); by more the nearer they sit to the hip, and not in proportion to the
  angle (Rouhandeh and Joslin 2018, by ultrasound); the skin on the thigh's front goes up and on its back down as the
  pelvis sways forward (Fukui et al. 2016). These are the papers' abstracts; a table of the skin over crest, ASIS and
  trochanter at known hip flexion was not found.
""",
    skin=SKIN,
    bodies=BODIES,
    without=("l_pelvis",),
    pieces=TOES,
    follows=FOLLOWS,
    stated={},
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
    spots=SPOTS,
    clearance=CLEARANCE,
    pose=pose_lower_limb,
)
