"""How the source's trunk is posed into the skin: the statements that ``pose_bones`` solves, in two stages.

Leg and arm stand as the limbs' own templates have them; between the two hang pelvis, spine, thorax, collar bone and
blade: the pelvis turns about the heads of the thighs, since a sacrum must find room, too, and the blade's socket must
meet the arm's head. First by joints and points alone, then with depths, at last with clearance beneath the skin: at
once, the whole lands in false minima, as the hand does.

Rig joints alone leave a head 3 to 5 cm off, so that points of the skull and spine are led to points of the skin.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import radians

import numpy as np
from numpy.typing import NDArray

from adapt.template_builder.body_trunk import CERVICAL, LUMBAR
from adapt.template_builder.meshes import Mesh
from adapt.template_builder.pose_bones import (
    DepthTarget,
    Placement,
    PoseProblem,
    Target,
    Unknown,
    fit_pose,
    placed_bodies,
)
from adapt.template_builder.sources_myosim import SourceSkeleton

Floats = NDArray[np.float64]

_SOCKET = np.array([-0.00955, -0.034, 0.009])  # m, the shoulder's centre in the source's scapula
# Heights above the floor as shares of stature in the 1,774 men of ANSUR: cervicale, suprasternale (Gordon et al. 1989).
_C7_HEIGHT, _NOTCH_HEIGHT = 0.865, 0.816

_SCALES = (
    dict.fromkeys(("sacrum", "pelvis"), ("log_pelvis",) * 3)
    | dict.fromkeys(LUMBAR, ("log_lumbar_across", "log_lumbar_along", "log_lumbar_across"))
    | {"thorax": ("log_thorax_deep", "log_thorax_high", "log_thorax_wide")}
    | dict.fromkeys(CERVICAL, ("log_neck_across", "log_neck_along", "log_neck_across"))
    | {"head": ("log_head_deep", "log_head_high", "log_head_wide")}
    | {"clavicle_r": ("log_clavicle",) * 3, "scapula_r": ("log_scapula",) * 3}
)


def pose_trunk(
    skeleton: SourceSkeleton, limbs: dict[str, Placement], skin: Mesh, depth: Callable[[Floats], Floats]
) -> tuple[dict[str, float], dict[str, Placement]]:
    """Hinge angles (rad) and log scales by name, and the placement of every body of the trunk.

    ``limbs`` has the placements of ``pelvis``, ``femur_r`` and ``humerus_r`` in the limbs' own templates.
    """
    problem = _problem(skeleton, limbs, skin)
    points_alone = fit_pose(replace(problem, clearance={}, depths=()), depth)
    values = fit_pose(replace(problem, clearance={}), depth, start=points_alone)
    values = fit_pose(problem, depth, start=values)
    return values, placed_bodies(replace(problem, skeleton=skeleton), values)


def _problem(skeleton: SourceSkeleton, limbs: dict[str, Placement], skin: Mesh) -> PoseProblem:
    pelvis, socket = limbs["pelvis"], limbs["pelvis"].inverse(limbs["femur_r"].translation)
    x, y, _ = pelvis.translation
    unknowns = (
        Unknown("root_rz", radians(-10.0), radians(4.0)),
        Unknown("root_tx", x, 0.03),
        Unknown("root_ty", y, 0.03),
        Unknown("lumbar_arc", 0.0, radians(2.0)),
        Unknown("thorax_pitch", 0.0, radians(5.0)),
        Unknown("neck_arc", 0.0, radians(2.0)),
        Unknown("head_pitch", 0.0, radians(5.0)),
        *(Unknown(f"log_lumbar_{way}", 0.0, sure, -0.15, 0.15) for way, sure in (("along", 0.03), ("across", 0.01))),
        *(
            Unknown(f"log_thorax_{way}", 0.0, sure, -0.15, 0.15)
            for way, sure in (("deep", 0.04), ("high", 0.03), ("wide", 0.015))
        ),
        *(Unknown(f"log_neck_{way}", 0.0, sure, -0.15, 0.15) for way, sure in (("along", 0.03), ("across", 0.01))),
        *(Unknown(f"log_head_{way}", 0.05, 0.05, -0.1, 0.2) for way in ("deep", "high", "wide")),
        Unknown("sternoclavicular_r2_r", 0.0, radians(8.0)),
        Unknown("sternoclavicular_r3_r", 0.0, radians(8.0)),
        Unknown("log_clavicle", 0.0, 0.06),
        *(Unknown(f"scapula_r{axis}", 0.0, radians(8.0)) for axis in "xyz"),
        Unknown("log_scapula", 0.0, 0.02),
    )
    return PoseProblem(
        skeleton=_thinned(skeleton),
        root="sacrum",
        scale_of=_SCALES,
        unknowns=unknowns,
        fixed={"root_rx": 0.0, "root_ry": 0.0, "root_tz": 0.0, "log_pelvis": float(np.log(pelvis.scale[0]))},
        clearance=dict.fromkeys(("thorax", "clavicle_r"), 0.004)
        | {"head": 0.001}  # teeth and orbits lie close to lips and lids
        | dict.fromkeys(("scapula_r", "sacrum"), 0.006)
        | dict.fromkeys((*LUMBAR, *CERVICAL), 0.006),
        targets=(
            Target("pelvis", socket, limbs["femur_r"].translation, 0.0005),
            Target("scapula_r", _SOCKET, limbs["humerus_r"].translation, 0.0015),
            *_targets(skeleton, skin),
        ),
        depths=_depths(skeleton),
        spread=0.001,
    )


def _targets(skeleton: SourceSkeleton, skin: Mesh) -> tuple[Target, ...]:
    """Points of spine, breastbone and skull, and where the skin has them: beneath its own, in the body's middle."""
    floor, stature = skin.vertices[:, 1].min(), float(np.ptp(skin.vertices[:, 1]))
    line = skin.vertices[np.abs(skin.vertices[:, 2]) < 0.006]
    back, front = (
        _outermost(line, floor + share * stature, way) for share, way in ((_C7_HEIGHT, -1.0), (_NOTCH_HEIGHT, 1.0))
    )
    top = line[np.argmax(line[:, 1])] * [1.0, 1.0, 0.0]
    occiput = _outermost(line[line[:, 1] > top[1] - 0.24], top[1] - 0.09, -1.0)
    bodies = skeleton.bodies
    skull = bodies["head"].vertices
    return (
        Target("c7", _farthest(bodies["c7"].vertices, (-1.0, -0.3, 0.0)), back + np.array([0.010, 0.0, 0.0]), 0.020),
        Target("thorax", _notch(bodies["thorax"].vertices), front - np.array([0.010, 0.0, 0.0]), 0.008),
        Target("head", _middle(_farthest(skull, (0.0, 1.0, 0.0))), top - np.array([0.0, 0.007, 0.0]), 0.004),
        Target("head", _middle(_farthest(skull, (-1.0, 0.0, 0.0))), occiput + np.array([0.008, 0.0, 0.0]), 0.005),
    )


def _depths(skeleton: SourceSkeleton) -> tuple[DepthTarget, ...]:
    """Bony points and how deep they lie beneath the skin of a man of average build: assumed, as nobody measured."""
    vertices = {name: body.vertices for name, body in skeleton.bodies.items()}
    thorax, head = vertices["thorax"], vertices["head"]
    middle = thorax[np.abs(thorax[:, 2]) < 0.01]
    spines = [_farthest(middle[np.abs(middle[:, 1] - y) < 0.012], (-1.0, 0.0, 0.0)) for y in (0.04, 0.12, 0.20)]
    breast = [_farthest(middle[np.abs(middle[:, 1] - y) < 0.012], (1.0, 0.0, 0.0)) for y in (0.10, 0.17, 0.22)]
    blade, hip = vertices["scapula_r"], vertices["pelvis"]
    return (
        DepthTarget("pelvis", _farthest(hip, (1.0, 0.3, 0.5)), 0.012, 0.008),
        DepthTarget("pelvis", _farthest(hip, (-1.0, 0.3, 0.0)), 0.012, 0.005),
        DepthTarget("sacrum", _farthest(vertices["sacrum"], (-1.0, 0.0, 0.0)), 0.012, 0.004),
        *(DepthTarget("thorax", at, 0.014, 0.004) for at in spines),
        *(DepthTarget("thorax", at, 0.010, 0.0015) for at in breast),
        DepthTarget("lumbar3", _farthest(vertices["lumbar3"], (-1.0, 0.0, 0.0)), 0.016, 0.005),
        DepthTarget("c7", _farthest(vertices["c7"], (-1.0, -0.3, 0.0)), 0.009, 0.003),
        DepthTarget("head", _farthest(head, (-1.0, 0.0, 0.0)), 0.007, 0.002),
        DepthTarget("head", _farthest(head, (0.0, 1.0, 0.0)), 0.006, 0.002),
        DepthTarget("head", _farthest(head, (0.8, 0.6, 0.0)), 0.005, 0.002),
        DepthTarget("head", _farthest(head, (0.6, -1.0, 0.0)), 0.009, 0.002),
        DepthTarget("head", _farthest(head[np.abs(head[:, 1]) < 0.02], (1.0, 0.0, 0.0)), 0.010, 0.003),
        DepthTarget("head", _farthest(head[head[:, 1] > 0.05], (0.0, 0.0, 1.0)), 0.007, 0.002),
        DepthTarget("scapula_r", _farthest(blade, (0.0, 0.3, 1.0)), 0.008, 0.003),  # acromion
        DepthTarget("scapula_r", _farthest(blade, (0.0, -1.0, 0.0)), 0.020, 0.005),  # lower angle
        DepthTarget("scapula_r", _farthest(blade, (-1.0, 0.7, 0.0)), 0.016, 0.005),  # spine
        DepthTarget("clavicle_r", _farthest(vertices["clavicle_r"], (1.0, 0.5, 0.0)), 0.007, 0.005),
    )


def _thinned(skeleton: SourceSkeleton) -> SourceSkeleton:
    """The same skeleton with every fourth vertex of the skull: enough to feel the skin."""
    return replace(
        skeleton,
        bodies={
            name: replace(body, vertices=body.vertices[::4]) if name == "head" else body
            for name, body in skeleton.bodies.items()
        },
    )


def _notch(thorax: Floats) -> Floats:
    """The upper edge of the breastbone."""
    front = thorax[(np.abs(thorax[:, 2]) < 0.01) & (thorax[:, 0] > 0.02)]
    return np.asarray(front[np.argmax(front[:, 1])])


def _outermost(line: Floats, height: float, way: float) -> Floats:
    """The point of a line of the skin near a height (m) that is foremost (``way`` 1) or hindmost (-1)."""
    near = line[np.abs(line[:, 1] - height) < 0.012]
    found = near[np.argmax(way * near[:, 0])]
    return np.array([found[0], height, 0.0])


def _middle(point: Floats) -> Floats:
    return np.asarray(point * [1.0, 1.0, 0.0])


def _farthest(points: Floats, direction: tuple[float, float, float]) -> Floats:
    return np.asarray(points[np.argmax(points @ np.array(direction))])
