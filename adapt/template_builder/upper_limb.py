"""What the build needs to know about the right upper limb, and nothing about how to build.

Names of bodies and hinges are myo-sim's, names of joint centres MakeHuman's, names, signs and ranges of coordinates
OpenSim's (Holzbaur, Murray & Delp 2005), landmarks and bone frames those of the ISB (Wu et al. 2005). In the frame
of every source body X points forward, Y along the bone to the trunk and Z to the right, for a hanging arm with the
thumb forward (the zero of all hinges).
"""

from __future__ import annotations

from math import pi, radians

from adapt.anatomy import Coordinate, Deformer, Frame, Joint
from adapt.template_builder.plan import (
    BonePlan,
    Cushion,
    HandlePlan,
    HeldPart,
    LimbPlan,
    PointPlan,
    RampPlan,
    SkinPlan,
)
from adapt.template_builder.skin import Cut
from adapt.template_builder.sources_myosim import BONE_GEOMETRY
from adapt.template_builder.upper_limb_depths import CLEARANCE, SPOTS
from adapt.template_builder.upper_limb_joints import AXES, REST_FROM, STATED
from adapt.template_builder.upper_limb_pose import BODIES, CARPALS, FINGERS, pose_upper_limb

_HAND = CARPALS + tuple(body for finger in FINGERS.values() for body in finger)

SKIN = SkinPlan(
    # MakeHuman's neutral young man: its three ancestries in equal parts, average muscle and weight.
    targets={
        "macrodetails/universal-male-young-averagemuscle-averageweight": 1.0,
        "macrodetails/african-male-young": 1.0 / 3.0,
        "macrodetails/asian-male-young": 1.0 / 3.0,
        "macrodetails/caucasian-male-young": 1.0 / 3.0,
    },
    stature=1.76,
    # From the armpit's apex over the acromion to the trapezius.
    cuts=(Cut(point=(0.0, 0.490, 0.195), normal=(0.0, 0.46, 0.89)),),
    tip="r-finger-3-4",
    count=8000,
    tet_edge=0.012,
)

POINTS = (
    PointPlan("GH", "humerus_r", "sphere", within=(1, -0.012, 0.1)),
    PointPlan("EM", "humerus_r", "extreme", (0.0, 0.3, -1.0), (1, -0.4, -0.25)),
    PointPlan("EL", "humerus_r", "extreme", (0.0, 0.3, 1.0), (1, -0.4, -0.25)),
    PointPlan("olecranon", "ulna_r", "extreme", (-1.0, 0.6, 0.0), (1, -0.05, 0.1)),
    PointPlan("US", "ulna_r", "extreme", (0.0, -1.0, 0.0)),
    PointPlan("RS", "radius_r", "extreme", (0.0, -1.0, 0.0)),
    PointPlan("capitate", "capitate_r", "middle"),
    PointPlan("MC2_base", "secondmc_r", "middle", within=(1, 0.023, 0.1)),
    PointPlan("MC2_head", "secondmc_r", "middle", within=(1, -0.1, -0.022)),
    PointPlan("MC3_base", "thirdmc_r", "middle", within=(1, 0.023, 0.1)),
    PointPlan("MC3_head", "thirdmc_r", "middle", within=(1, -0.1, -0.022)),
    PointPlan("MC5_base", "fifthmc_r", "middle", within=(1, 0.018, 0.1)),
    PointPlan("MC5_head", "fifthmc_r", "middle", within=(1, -0.1, -0.018)),
    PointPlan("thumb_tip", "distal_thumb_r", "extreme", (0.5, -0.8, -0.3)),
    PointPlan("finger2_tip", "distph2_r", "extreme", (0.0, -1.0, 0.0)),
    PointPlan("finger3_tip", "distph3_r", "extreme", (0.0, -1.0, 0.0)),
    PointPlan("finger5_tip", "distph5_r", "extreme", (0.0, -1.0, 0.0)),
)

_ELBOW = ("elbow_axis_medial", "elbow_axis_lateral")
_WRIST = ("wrist_flexion_axis_ulnar", "wrist_flexion_axis_radial")
_STYLOIDS = ("US", "RS")

BONES = (
    BonePlan(
        "humerus",
        ("humerus_r",),
        count=2500,
        spacing=0.0010,
        blur=0.0007,
        envelope=0.0,
        tet_edge=0.006,
        frame=Frame(("GH",), ("EM", "EL"), ("GH",), ("EM",), ("EL",)),
    ),
    BonePlan(
        "ulna",
        ("ulna_r",),
        count=2000,
        spacing=0.0008,
        blur=0.0006,
        envelope=0.0,
        tet_edge=0.005,
        frame=Frame(("US",), ("US",), ("EM", "EL"), ("EM",), ("EL",)),
    ),
    BonePlan(
        "radius",
        ("radius_r",),
        count=2000,
        spacing=0.0008,
        blur=0.0006,
        envelope=0.0,
        tet_edge=0.005,
        frame=Frame(("RS",), ("RS",), ("EL",), ("US",), ("RS",)),
    ),
    BonePlan(
        "hand",
        _HAND,
        count=7500,
        spacing=0.0005,
        blur=0.0,
        envelope=0.0025,
        tet_edge=0.005,
        frame=Frame(("MC3_base",), ("MC3_head",), ("MC3_base",), ("MC5_head",), ("MC2_head",)),
    ),
)

HANDLES = (
    HandlePlan(
        "humerus_proximal", "humerus", "shoulder", PointPlan("", "humerus_r", "sphere", within=(1, -0.012, 0.1))
    ),
    HandlePlan("humerus_distal", "humerus", "elbow", PointPlan("", "humerus_r", "middle", within=(1, -0.4, -0.285))),
    HandlePlan("ulna_proximal", "ulna", "elbow", PointPlan("", "ulna_r", "middle", within=(1, -0.035, -0.014))),
    HandlePlan("ulna_distal", "ulna", "wrist", PointPlan("", "ulna_r", "middle", within=(1, -0.244, -0.228))),
    HandlePlan("radius_proximal", "radius", "elbow", PointPlan("", "radius_r", "middle", within=(1, -0.012, 0.1))),
    HandlePlan("radius_distal", "radius", "wrist", PointPlan("", "radius_r", "middle", within=(1, -0.236, -0.215))),
    HandlePlan("hand_proximal", "hand", "wrist", PointPlan("", "capitate_r", "middle")),
    # All the knuckles: fingers are held still, so beyond them the hand scales and shifts as one.
    HandlePlan(
        "hand_distal",
        "hand",
        "knuckles",
        PointPlan("", "thirdmc_r", "middle", within=(1, -0.1, -0.022)),
        also=(
            PointPlan("", "secondmc_r", "middle", within=(1, -0.1, -0.022)),
            PointPlan("", "fourthmc_r", "middle", within=(1, -0.1, -0.020)),
            PointPlan("", "fifthmc_r", "middle", within=(1, -0.1, -0.018)),
        ),
    ),
)

_TURN, _REACH = 2.0 * pi, 10.0

COORDINATES = (
    Coordinate("shoulder_rx", "rad", -_TURN, _TURN, 0.0),
    Coordinate("shoulder_ry", "rad", -_TURN, _TURN, 0.0),
    Coordinate("shoulder_rz", "rad", -_TURN, _TURN, 0.0),
    Coordinate("shoulder_tx", "m", -_REACH, _REACH, 0.0),
    Coordinate("shoulder_ty", "m", -_REACH, _REACH, 0.0),
    Coordinate("shoulder_tz", "m", -_REACH, _REACH, 0.0),
    Coordinate("elbow_flexion", "rad", 0.0, radians(130.0), 0.0),
    Coordinate("pro_sup", "rad", radians(-90.0), radians(90.0), 0.0),
    Coordinate("deviation", "rad", radians(-10.0), radians(25.0), 0.0),
    Coordinate("flexion", "rad", radians(-70.0), radians(70.0), 0.0),
)

JOINTS = (
    Joint("shoulder", "free", None, "humerus", tuple(c.name for c in COORDINATES[:6]), (), ("GH",)),
    Joint("elbow", "hinge", "humerus", "ulna", ("elbow_flexion",), (_ELBOW,), _ELBOW),
    Joint("radioulnar", "hinge", "ulna", "radius", ("pro_sup",), (("ulnar_head", "radial_head"),), ("radial_head",)),
    Joint(
        "wrist",
        "universal",
        "radius",
        "hand",
        ("deviation", "flexion"),
        (("wrist_deviation_axis_dorsal", "wrist_deviation_axis_palmar"), _WRIST),
        _WRIST,
    ),
)

DEFORMERS = (
    Deformer("upper_arm", "rigid", ("humerus",)),
    Deformer(
        "forearm",
        "forearm",
        ("ulna", "radius"),
        # Both y axes run up the forearm; with pro_sup at 0 both z axes point away from the trunk's midline.
        (
            Frame(_ELBOW, _STYLOIDS, _ELBOW, ("elbow_axis_medial",), ("elbow_axis_lateral",)),
            Frame(_STYLOIDS, _STYLOIDS, _ELBOW, ("wrist_deviation_axis_palmar",), ("wrist_deviation_axis_dorsal",)),
        ),
    ),
    Deformer("hand", "rigid", ("hand",)),
)

UPPER_LIMB_RIGHT = LimbPlan(
    name="upper-limb-right",
    side="right",
    upstream=(
        BONE_GEOMETRY,
        (
            "that arm's joints before that",
            "MoBL-ARMS (Saul et al. 2015): its elbow, forearm and wrist are NOT taken, see below; the source's is how "
            "the carpus's bones lie beside one another",
            "BSD-3-Clause, non-commercial",
        ),
        (
            "that hand's finger joints before that",
            "2nd-Hand (McFarland et al. 2019): they bent the fingers into the skin's, and are not in here",
            "MIT",
        ),
        (
            "axes and centres of elbow, forearm and wrist",
            "CompleteHumanModel of the nimblephysics repository (after Rajagopal et al. 2016, Seth et al. 2019)",
            "BSD-2-Clause",
        ),
    ),
    facts=(
        ("joint ranges, signs and names of coordinates", "Holzbaur, Murray & Delp (2005)"),
        ("landmarks, bone frames", "Wu et al. (2005), ISB"),
    ),
    notes="""\
## Choices

- Where ulna, styloids, epicondyles and metacarpals lie under skin and fascia alone, the skin was moved to them: as
  MakeHuman has it, it was 8 to 13 mm thick over the ulna's border and the backs of the metacarpals, which can be felt.
- Joints are those of openly licensed models, stated in `upper_limb_joints.py`; the source's hinges have the same places
  and axes to 3 micrometres. The bones confirm them: the elbow's axis runs where the trochlea is narrowest, the forearm's
  through the middles of the radius's head and of the ulna's. Only fingers were bent by the source's hinges.
- At the wrist skin is blended between forearm and hand, and sinks onto the carpus where the wrist bends far. So the hand
  holds the skin from 13 mm behind the capitate on, and whatever lies within 3 mm of its bones, and the skin keeps off
  the carpus. Five draws of tetrahedra then left the hand 0.5 to 2.1 mm beneath the outer skin in the worst of 25 poses
  of the wrist (held as before, -0.3 to 0.3 in three; the former arm -1.1 in a build that was refused); this one 2.1.
""",
    skin=SKIN,
    bodies=BODIES,
    without=(),
    pieces=(),
    follows={},
    stated=STATED,
    # The skin asks for a longer hand and a slimmer wrist than the source has: the carpus would press into the radius.
    shifts={"lunate_r": (0.0, -0.0010, 0.0)},
    bones=BONES,
    points=POINTS,
    axes=AXES,
    splines=(),
    handles=HANDLES,
    joints=JOINTS,
    coordinates=COORDINATES,
    rest_from=REST_FROM,
    deformers=DEFORMERS,
    held=(HeldPart("hand", "hand", "capitate", "MC3_head", -0.013, around=0.003),),
    cushions=(Cushion("ulna", "US", 0.013),),
    # The skin near the cut also follows the trunk; the fingers are held still by the model.
    fit_near_cut=((0.0, 0.08), (0.05, 1.0)),
    fit_ramps=(RampPlan("capitate", "MC3_head", (-0.02, 0.02, 0.05, 0.09), (1.0, 0.7, 0.7, 0.1)),),
    spots=SPOTS,
    clearance=CLEARANCE,
    pose=pose_upper_limb,
)
