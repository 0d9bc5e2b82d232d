"""OpenSim's CustomJoint as a table, and the landmarks by which a spline joint of the anatomy reproduces it.

Of six functions of one coordinate q, three turn and three shift the child's joint frame in the parent's:

    T_child(q) = P [R(u1, r1(q)) R(u2, r2(q)) R(u3, r3(q)),  t1(q) e1 + t2(q) e2 + t3(q) e3] C^-1

with P and C the joint's frames in the parent and in the child, turns body-fixed, shifts along axes of P. A function
is OpenSim's SimmSpline through values at knots. Angles in radians, lengths in metres; (4, 4) on column vectors.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.spatial.transform import Rotation

from adapt.anatomy import Floats, Frame, Joint
from capture.errors import AnatomyError
from capture.rigid import apply, exp_so3, inverse, transform

Vector = tuple[float, float, float]

_RIGHT_ANGLE = 1e-6  # how far from perpendicular the guides of a joint may be


@dataclass(frozen=True)
class Curve:
    """One function of the coordinate: a turn about, or a shift along, ``axis`` of the parent's joint frame."""

    axis: Vector
    values: tuple[float, ...]  # rad or m, one a knot


@dataclass(frozen=True)
class CoupledJoint:
    """A CustomJoint with one coordinate. Orientations are body-fixed X-Y-Z angles, as OpenSim writes them."""

    knots: tuple[float, ...]  # values of the coordinate
    turns: tuple[Curve, ...]  # in the order of multiplication
    shifts: tuple[Curve, ...]
    location_in_parent: Vector
    orientation_in_parent: Vector
    location_in_child: Vector
    orientation_in_child: Vector


@dataclass(frozen=True)
class Guides:
    """Three points (m) of the child's frame that a joint's control landmarks follow.

    The line from the middle between ``medial`` and ``lateral`` to ``normal`` is perpendicular to the line between.
    """

    medial: Vector
    lateral: Vector
    normal: Vector


def simm_spline(x: tuple[float, ...], y: tuple[float, ...], at: Floats) -> Floats:
    """OpenSim's cubic spline through (x, y), at least four points, evaluated ``at`` (N,) inside their range.

    Its third derivative at either end is that of the cubic through the nearest four points (Forsythe, Malcolm and
    Moler 1977); splines with other end conditions differ in the outermost intervals.
    """
    return np.asarray(_simm_spline(x, y)(at))


@lru_cache(maxsize=32)
def _simm_spline(x: tuple[float, ...], y: tuple[float, ...]) -> BSpline:
    ends = [6.0 * np.polyfit(np.subtract(x[four], x[four][0]), y[four], 3)[0] for four in (slice(4), slice(-4, None))]
    return make_interp_spline(x, y, k=3, bc_type=([(3, ends[0])], [(3, ends[1])]))


def child_in_parent(joint: CoupledJoint, angle: float) -> Floats:
    """T_child(q) (4, 4): from the child's frame to the parent's, at the coordinate's value ``angle``."""
    turn, shift = np.eye(3), np.zeros(3)
    for curve in joint.turns:
        turn = turn @ exp_so3(_at(joint, curve, angle) * np.array(curve.axis))
    for curve in joint.shifts:
        shift = shift + _at(joint, curve, angle) * np.array(curve.axis)
    parent, child = joint_frames(joint)
    return parent @ transform(turn, shift) @ inverse(child)


def joint_frames(joint: CoupledJoint) -> tuple[Floats, Floats]:
    """P and C (4, 4): the joint's frame in the parent and in the child."""
    return (
        _frame(joint.location_in_parent, joint.orientation_in_parent),
        _frame(joint.location_in_child, joint.orientation_in_child),
    )


def spline_joint(
    table: CoupledJoint,
    guides: Guides,
    place: Callable[[Floats], Floats],
    *,
    knots: tuple[float, ...],
    name: str,
    parent: str,
    child: str,
    coordinate: str,
    centre: tuple[str, ...],
) -> tuple[Joint, dict[str, Floats]]:
    """The joint that moves ``child`` as the table does, and its control landmarks: name to point (3,) in m.

    Where the table puts the guides at each of the ``knots`` (rad), there the parent has a landmark:
    ``<name>_medial_<k>``, ``<name>_lateral_<k>`` and ``<name>_normal_<k>``. ``place`` carries points (N, 3) of the
    parent's OpenSim frame to the template's rest space by a similarity; its scale is the joint's. What the
    coordinate is at rest does not matter here: the landmarks belong to the parent.

    Raises:
        AnatomyError: the guides' two directions are not perpendicular, so that a frame would not meet the normal.
    """
    points = np.array([guides.medial, guides.lateral, guides.normal])
    across, up = points[1] - points[0], points[2] - points[:2].mean(axis=0)
    if abs(across @ up) > _RIGHT_ANGLE * np.linalg.norm(across) * np.linalg.norm(up):
        raise AnatomyError(f"the normal of {name!r} is not perpendicular to its width", remedy="move a guide")
    landmarks: dict[str, Floats] = {}
    frames = []
    for k, knot in enumerate(knots):
        medial, lateral, normal = names = tuple(f"{name}_{part}_{k:02d}" for part in ("medial", "lateral", "normal"))
        landmarks |= dict(zip(names, place(apply(child_in_parent(table, knot), points)), strict=True))
        frames.append(Frame((medial, lateral), (medial, lateral), (normal,), (medial,), (lateral,)))
    joint = Joint(name, "spline", parent, child, (coordinate,), (), centre, knots, tuple(frames))
    return joint, landmarks


def _at(joint: CoupledJoint, curve: Curve, angle: float) -> float:
    return float(simm_spline(joint.knots, curve.values, np.array([angle]))[0])


def _frame(location: Vector, orientation: Vector) -> Floats:
    return transform(Rotation.from_euler("XYZ", orientation).as_matrix(), np.array(location))
