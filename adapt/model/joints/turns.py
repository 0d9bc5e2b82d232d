"""What hinge, universal joint and ball share: turns about lines through landmarks, each riding on the one before."""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Anatomy, Floats, Joint
from adapt.model.frames import unit
from adapt.model.joints.joint_type import JointType, rest_values
from adapt.model.variation import Motion, Points, compose
from capture.rigid import hat


class Turning(JointType):
    """A joint that turns about as many lines through landmarks as it has coordinates."""

    def motion(self, anatomy: Anatomy, joint: Joint, q: Floats, p: Points, columns: list[int]) -> Motion:
        """Turns by q - q_rest (rad) about the joint's axes: H = H_1 H_2 ..."""
        angles = q - rest_values(anatomy, joint)
        first, *others = (
            turn(anatomy, axis, angle, p, column)
            for axis, angle, column in zip(joint.axes, angles, columns, strict=True)
        )
        motion = first
        for other in others:
            motion = compose(motion, other)
        return motion


def turn(anatomy: Anatomy, axis: tuple[str, str], angle: float, p: Points, column: int) -> Motion:
    """A turn by ``angle`` (rad) about the line through two landmarks: x' = R (x - f) + f."""
    first, second = (anatomy.landmark_index(name) for name in axis)
    f, df = p.value[first], p.d[first]
    direction, d_direction = unit(p.value[second] - f, p.d[second] - df)
    k, sine, versine = hat(direction), np.sin(angle), 1.0 - np.cos(angle)
    rotation = np.eye(3) + sine * k + versine * (k @ k)
    # The left Jacobian of angle * direction, for a change of the direction, which stays square to it.
    d_rotation = sine * d_direction + versine * (k @ d_direction)
    d_rotation[:, column] += direction
    turned = rotation @ f
    d_translation = df - rotation @ df + hat(turned) @ d_rotation
    return Motion(rotation, f - turned, d_rotation, d_translation)
