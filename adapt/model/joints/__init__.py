"""One file per joint type, in rest space: how the child's rest pose is carried (anatomy.Joint).

T_child = T_parent H(q, q_rest; p), with H the identity at rest. Writing the joint in rest space keeps
T_b(theta) = F_b(theta) F_b(rest)^-1 (paper, section 3.1) without a frame of its own at every joint.

The limbs have free joints, hinges, universal joints, balls and splines. Curves (the spine), ellipsoids (the
shoulder blade), struts (the collar bone) and sockets (the shoulder) are for a trunk: no anatomy that ships has one yet.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from adapt.anatomy import Anatomy, Floats, Joint
from adapt.model.arc import Arc
from adapt.model.derivatives import Motion, Points
from adapt.model.joints.ball import Ball
from adapt.model.joints.curve import Curve
from adapt.model.joints.cylindrical import Cylindrical
from adapt.model.joints.ellipsoid import Ellipsoid
from adapt.model.joints.free import Free
from adapt.model.joints.hinge import Hinge
from adapt.model.joints.joint_type import JointType
from adapt.model.joints.socket import Socket
from adapt.model.joints.spline import Spline
from adapt.model.joints.strut import Strut
from adapt.model.joints.universal import Universal
from capture.errors import AnatomyError

_TYPES: tuple[JointType, ...] = (
    Free(),
    Hinge(),
    Universal(),
    Ball(),
    Spline(),
    Cylindrical(),
    Curve(),
    Ellipsoid(),
    Socket(),
    Strut(),
)
JOINT_TYPES = {each.name: each for each in _TYPES}
"""Every type of joint by the name that an anatomy gives it."""


def joint_motion(anatomy: Anatomy, joint: Joint, theta: Floats, p: Points, first_column: int) -> Motion:
    """The joint's motion H, varying with theta (its columns start at ``first_column``) and with the landmarks."""
    index = [anatomy.coordinate_index(name) for name in joint.coordinates]
    columns = [first_column + i for i in index]
    return JOINT_TYPES[joint.type].motion(anatomy, joint, theta[index], p, columns)


def carried_by(
    anatomy: Anatomy, joint: Joint, theta: Floats, p: Points, first_column: int, motions: Mapping[str, Motion]
) -> Motion:
    """T_child of the joint, given the motions of the bones that are placed before it, by name."""
    index = [anatomy.coordinate_index(name) for name in joint.coordinates]
    columns = [first_column + i for i in index]
    return JOINT_TYPES[joint.type].carried(anatomy, joint, theta[index], p, columns, motions)


def joint_problem(joint: Joint) -> str | None:
    """Why these parts make no joint of the type that they name, or None."""
    if joint.type not in JOINT_TYPES:
        return f"no type {joint.type!r}: the types are {', '.join(JOINT_TYPES)}"
    return JOINT_TYPES[joint.type].problem(joint)


def arched_joint(anatomy: Anatomy, bone: str) -> Joint | None:
    """The joint by which an arc leads to a bone, or None.

    >>> from adapt.anatomy_file import load_anatomy
    >>> arched_joint(load_anatomy("upper-limb-right"), "ulna") is None  # an arm has no spine
    True
    """
    arched = (joint for joint in anatomy.joints if JOINT_TYPES[joint.type].arched)
    return next((joint for joint in arched if joint.child == bone), None)


def arc_to(anatomy: Anatomy, bone: str, p: Points) -> Arc:
    """The arc at rest that leads to a bone, varying with the landmarks. Raises AnatomyError if there is none."""
    joint = arched_joint(anatomy, bone)
    if joint is None:
        raise AnatomyError(f"no curve leads to the bone {bone!r}", remedy="mend the anatomy's data")
    return JOINT_TYPES[joint.type].arc(anatomy, joint, p)


def units_of(joint: Joint) -> tuple[Literal["rad", "m"], ...]:
    """The units of a joint's coordinates.

    >>> from adapt.anatomy_file import load_anatomy
    >>> arm = load_anatomy("upper-limb-right")
    >>> units_of(arm.joint("shoulder")), units_of(arm.joint("wrist"))
    (('rad', 'rad', 'rad', 'm', 'm', 'm'), ('rad', 'rad'))
    """
    return JOINT_TYPES[joint.type].units
