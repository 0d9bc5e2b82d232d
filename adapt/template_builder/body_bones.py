"""The bones of the whole body: their parts, landmarks, axes and frames. Limbs have theirs from the limbs' plans.

Names without a side are the right side's, but for the middle's. What lies in the body's middle and on it is named in
``MIDDLE``; a landmark of a middle bone that lies to one side is named as of the right.
"""

from __future__ import annotations

from dataclasses import replace

from adapt.anatomy import Frame
from adapt.template_builder import lower_limb_bones as leg
from adapt.template_builder import upper_limb as arm
from adapt.template_builder.body_trunk import CERVICAL, LUMBAR
from adapt.template_builder.lower_limb_pose import TOES
from adapt.template_builder.plan import AxisPlan, BonePlan, PointPlan
from adapt.template_builder.upper_limb_joints import AXES as ARM_AXES

_ENDS, _BESIDE = ("start", "end"), ("", "_normal")
MIDDLE = frozenset(
    (
        *("pelvis", "lumbar", "thorax", "head"),
        *("lumbar_base", "lumbar_top", "thorax_top", "neck_top", "vertex", "IJ", "PX", "C7", "T8", "occiput", "chin"),
        *("pelvis_lumbar", "lumbar_low", "lumbar_high", "thorax_low", "thorax_high", "head_low", "head_high"),
        *("lumbosacral", "thoracolumbar", "cervicothoracic", "skull"),
        *(f"{part}_bend_{end}{also}" for part in ("lumbar", "thorax", "neck") for end in _ENDS for also in _BESIDE),
        *("thoracic_spine", "neck", "lumbar_curve", "thoracic_curve", "neck_curve"),
        *(f"pelvis_{way}" for way in ("rx", "ry", "rz", "tx", "ty", "tz")),
        *(f"{part}_{way}" for part in ("lumbar", "thorax", "head") for way in ("bending", "extension", "twist")),
    )
)

SUBTALAR, MTP = ("subtalar_axis_back", "subtalar_axis_front"), ("mtp_axis_back", "mtp_axis_front")
_MTP_ORIGIN, _MTP_AXIS = (0.1788, -0.0020, 0.0011), (0.581, 0.0, -0.814)
# The shoulder's centre in the source's scapula, and what is told of its frame: the blade's own axes through it.
_GH, _REACH = (-0.00955, -0.0340, 0.0090), 0.03

# Weights of a bone in several parts spread in its hull; the source's coarse bones need no finer level set than this.
_HULL = 0.004
_LEG = {bone.name: replace(bone, spacing=max(bone.spacing, 0.0015)) for bone in leg.BONES}
_ARM = {bone.name: replace(bone, spacing=max(bone.spacing, 0.0011)) for bone in arm.BONES}


def _on_line(names: tuple[str, str], body: str, origin: tuple[float, ...], axis: tuple[float, ...]) -> list[PointPlan]:
    """Two landmarks 20 mm before and after a point (m) of a body along a unit axis."""
    ends = ([o + way * 0.02 * a for o, a in zip(origin, axis, strict=True)] for way in (-1.0, 1.0))
    return [PointPlan(name, body, "at", (x, y, z)) for name, (x, y, z) in zip(names, ends, strict=True)]


def _plane(
    name: str, body: str, at: tuple[float, float, float], normal: tuple[float, float, float]
) -> tuple[PointPlan, ...]:
    """A point of a plane across the trunk, and one 30 mm beside it along its normal."""
    x, y, z = (a + 0.03 * n for a, n in zip(at, normal, strict=True))
    return PointPlan(name, body, "at", at), PointPlan(f"{name}_normal", body, "at", (x, y, z))


def _about(name: str, axis: int, way: float) -> PointPlan:
    x, y, z = (c + (way * _REACH if k == axis else 0.0) for k, c in enumerate(_GH))
    return PointPlan(name, "scapula_r", "at", (x, y, z))


POINTS = (
    *arm.POINTS,
    *leg.POINTS,
    *_on_line(MTP, "calcn_r", _MTP_ORIGIN, _MTP_AXIS),
    PointPlan("lumbar_base", "lumbar5", "at"),
    PointPlan("lumbar_top", "thorax", "at"),
    PointPlan("L3_side", "lumbar3", "extreme", (0.0, 0.0, 1.0)),
    PointPlan("thorax_top", "c7", "at"),
    PointPlan("neck_top", "head", "at"),
    PointPlan("C7", "c7", "extreme", (-1.0, -0.3, 0.0)),
    PointPlan("T8", "thorax", "at", (-0.083, 0.085, 0.0)),
    PointPlan("IJ", "thorax", "at", (0.0390, 0.2527, 0.0)),
    PointPlan("PX", "thorax", "at", (0.0980, 0.0780, 0.0)),
    PointPlan("vertex", "head", "extreme", (0.0, 1.0, 0.0)),
    PointPlan("occiput", "head", "extreme", (-1.0, 0.0, 0.0)),
    PointPlan("chin", "head", "extreme", (0.6, -1.0, 0.0)),
    PointPlan("parietal", "head", "extreme", (0.0, 0.4, 1.0)),
    PointPlan("SC", "clavicle_r", "at"),
    PointPlan("SC_above", "thorax", "at", (0.0393, 0.2946, 0.0255)),
    PointPlan("SC_beside", "thorax", "at", (0.0393, 0.2646, 0.0555)),
    PointPlan("AC", "scapula_r", "at"),
    PointPlan("AA", "scapula_r", "extreme", (-0.5, 0.0, 1.0)),
    PointPlan("TS", "scapula_r", "extreme", (-1.0, 0.5, -1.0)),
    PointPlan("AI", "scapula_r", "extreme", (0.0, -1.0, 0.0)),
    _about("shoulder_low", 1, -1.0),
    _about("shoulder_high", 1, 1.0),
    _about("shoulder_inner", 2, -1.0),
    _about("shoulder_outer", 2, 1.0),
    # Where skin starts and stops to ride along the spine's curves; at the neck's ends, in front lower than behind.
    *_plane("lumbar_bend_start", "sacrum", (-0.090, 0.030, 0.0), (0.0, 1.0, 0.0)),
    *_plane("lumbar_bend_end", "thorax", (0.0, 0.010, 0.0), (0.0, 1.0, 0.0)),
    *_plane("thorax_bend_start", "thorax", (0.0, -0.020, 0.0), (0.0, 1.0, 0.0)),
    *_plane("thorax_bend_end", "thorax", (0.0, 0.235, 0.0), (0.0, 1.0, 0.0)),
    *_plane("neck_bend_start", "thorax", (-0.020, 0.275, 0.0), (0.25, 1.0, 0.0)),
    *_plane("neck_bend_end", "head", (0.0, -0.035, 0.0), (0.3, 1.0, 0.0)),
    # Where skin starts and stops to turn with the arm: between blade and arm.
    PointPlan("shoulder_bend_start", "humerus_r", "at", (0.0, 0.035, 0.0)),
    PointPlan("shoulder_bend_start_normal", "humerus_r", "at", (0.0, 0.015, 0.0)),
    PointPlan("shoulder_bend_end", "humerus_r", "at", (0.0, -0.085, 0.0)),
    PointPlan("shoulder_bend_end_normal", "humerus_r", "at", (0.0, -0.105, 0.0)),
)

AXES = (
    *ARM_AXES,
    *leg.AXES,
    AxisPlan(SUBTALAR, "calcn_r", "talus_r", (0.7872, 0.6047, -0.1209), (0.01, 0.05)),
)

_HIPS = ("HJC_l",), ("HJC_r",)


def _middle(name: str, bodies: tuple[str, ...], count: int, blur: float, frame: Frame) -> BonePlan:
    return BonePlan(name, bodies, count=count, spacing=0.002, blur=blur, envelope=_HULL, tet_edge=0.020, frame=frame)


BONES = (
    _middle(
        "pelvis",
        ("pelvis", "sacrum"),
        3600,
        0.0012,
        Frame(("HJC_r", "HJC_l"), ("HJC_r", "HJC_l"), ("above_hip_r", "above_hip_l"), *_HIPS),
    ),
    _middle(
        "lumbar",
        LUMBAR,
        2500,
        0.0,
        Frame(("lumbar_base",), ("lumbar_base",), ("lumbar_top",), ("L3_side_l",), ("L3_side_r",)),
    ),
    # ISB, but for z: from one collar bone's end to the other's, which is across the body.
    _middle("thorax", ("thorax",), 9500, 0.0, Frame(("IJ",), ("PX", "T8"), ("IJ", "C7"), ("SC_l",), ("SC_r",))),
    _middle(
        "head",
        ("head", *CERVICAL),
        5000,
        0.0,
        Frame(("neck_top",), ("neck_top",), ("vertex",), ("parietal_l",), ("parietal_r",)),
    ),
    replace(_LEG["femur"], count=1800),
    replace(_LEG["tibia"], count=1800),
    replace(_LEG["patella"], count=600),
    replace(
        _LEG["foot"],
        name="talus",
        bodies=("talus_r",),
        count=500,
        spacing=0.0010,
        envelope=0.0,
        frame=Frame(("talus",), ("sole",), ("talus",), *((name,) for name in leg.ANKLE)),
    ),
    replace(_LEG["foot"], name="calcn", bodies=("calcn_r",), count=2200, spacing=0.0010),
    replace(
        _LEG["foot"],
        name="toes",
        bodies=tuple(toe.name for toe in TOES),
        count=1300,
        spacing=0.0008,
        frame=Frame(("MT2_head",), ("sole",), ("talus",), ("MT1_head",), ("MT5_head",)),
    ),
    BonePlan(
        "clavicle",
        ("clavicle_r",),
        count=700,
        spacing=0.0008,
        blur=0.0008,
        envelope=0.0,
        tet_edge=0.006,
        frame=Frame(("SC",), ("SC",), ("SC_above",), ("SC",), ("AC",)),
    ),
    # z as ISB's along the spine, y along the inner border.
    BonePlan(
        "scapula",
        ("scapula_r",),
        count=1800,
        spacing=0.0014,
        blur=0.0008,
        envelope=0.0,
        tet_edge=0.006,
        frame=Frame(("AA",), ("AI",), ("TS",), ("TS",), ("AA",)),
    ),
    replace(_ARM["humerus"], count=1500),
    replace(_ARM["ulna"], count=1200),
    replace(_ARM["radius"], count=1200),
    replace(_ARM["hand"], count=5000),
)
