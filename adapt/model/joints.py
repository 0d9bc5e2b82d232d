"""One motion per joint type, in rest space: how the child's rest pose is carried (anatomy.Joint).

T_child = T_parent H(q - q_rest; p). Writing the joint in rest space keeps T_b(theta) = F_b(theta) F_b(rest)^-1
(paper, section 3.1) without a frame of its own at every joint.
"""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Anatomy, Floats, Joint
from adapt.model.frames import frame_from_landmarks, unit
from adapt.model.variation import Motion, Points, compose, invert
from capture.rigid import exp_so3, hat, left_jacobian_so3


def joint_motion(anatomy: Anatomy, joint: Joint, theta: Floats, p: Points, first_column: int) -> Motion:
    """The joint's motion H, varying with theta (its columns start at ``first_column``) and with the landmarks."""
    index = [anatomy.coordinate_index(name) for name in joint.coordinates]
    columns = [first_column + i for i in index]
    if joint.type == "free":
        return _free(anatomy, joint, theta[index], p, columns)
    turns = [
        _turn(anatomy, axis, theta[i] - anatomy.coordinates[i].rest, p, column)
        for axis, i, column in zip(joint.axes, index, columns, strict=True)
    ]
    motion = turns[0]
    for turn in turns[1:]:
        motion = compose(motion, turn)
    return motion


def _turn(anatomy: Anatomy, axis: tuple[str, str], angle: float, p: Points, column: int) -> Motion:
    """A turn by ``angle`` (rad) about the line through two landmarks: x' = R (x - f) + f."""
    first, second = (anatomy.landmark_index(name) for name in axis)
    f, df = p.value[first], p.d[first]
    direction, d_direction = unit(p.value[second] - f, p.d[second] - df)
    rotation = exp_so3(angle * direction)
    d_rotation = left_jacobian_so3(angle * direction) @ (angle * d_direction)
    d_rotation[:, column] += direction
    turned = rotation @ f
    d_translation = df - rotation @ df + hat(turned) @ d_rotation
    return Motion(rotation, f - turned, d_rotation, d_translation)


def _free(anatomy: Anatomy, joint: Joint, q: Floats, p: Points, columns: list[int]) -> Motion:
    """The child's frame placed by a rotation vector and an origin: H = [exp(q_r), q_t] C_child(p)^-1."""
    d_rotation, d_translation = np.zeros((2, 3, p.n))
    d_rotation[:, columns[:3]] = left_jacobian_so3(q[:3])
    d_translation[:, columns[3:]] = np.eye(3)
    placed = Motion(exp_so3(q[:3]), q[3:], d_rotation, d_translation)
    return compose(placed, invert(frame_from_landmarks(anatomy, anatomy.bone(joint.child).frame, p)))
