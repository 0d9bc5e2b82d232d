"""One motion per joint type, in rest space: how the child's rest pose is carried (anatomy.Joint).

T_child = T_parent H(q, q_rest; p), with H the identity at rest. Writing the joint in rest space keeps
T_b(theta) = F_b(theta) F_b(rest)^-1 (paper, section 3.1) without a frame of its own at every joint.
"""

from __future__ import annotations

from adapt.anatomy import Anatomy, Floats, Joint
from adapt.model.joints.free import free_motion
from adapt.model.joints.spline import spline_motion
from adapt.model.joints.turns import turning_motion
from adapt.model.variation import Motion, Points


def joint_motion(anatomy: Anatomy, joint: Joint, theta: Floats, p: Points, first_column: int) -> Motion:
    """The joint's motion H, varying with theta (its columns start at ``first_column``) and with the landmarks."""
    index = [anatomy.coordinate_index(name) for name in joint.coordinates]
    columns = [first_column + i for i in index]
    if joint.type == "free":
        return free_motion(anatomy, joint, theta[index], p, columns)
    if joint.type == "spline":
        return spline_motion(anatomy, joint, float(theta[index[0]]), p, columns[0])
    rest = [anatomy.coordinates[i].rest for i in index]
    return turning_motion(anatomy, joint, theta[index] - rest, p, columns)
