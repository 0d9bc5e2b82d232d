"""What hinge, universal joint and ball share: turns about lines through landmarks, each riding on the one before."""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Anatomy, Floats, Joint
from adapt.model.compiled.rows import Row, screw
from adapt.model.derivatives import Motion, Points, compose
from adapt.model.frames import varying_line
from adapt.model.joints.joint_type import JointType, rest_values
from adapt.model.joints.opensim import OsimJoint, Resting, TransformAxis, nearest_point, still_axes, unit_vector
from capture.rigid import exp_so3, hat, transform


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

    def rows(self, anatomy: Anatomy, joint: Joint, p: Points) -> list[Row]:
        """One turn after the other."""
        rest = rest_values(anatomy, joint)
        return [screw(k, rest[k], varying_line(anatomy, axis, p), turn=1.0) for k, axis in enumerate(joint.axes)]


def turn(anatomy: Anatomy, axis: tuple[str, str], angle: float, p: Points, column: int) -> Motion:
    """A turn by ``angle`` (rad) about the line through two landmarks: x' = R (x - f) + f.

    >>> from adapt.anatomy_file import load_anatomy
    >>> from adapt.model.derivatives import constant_points
    >>> arm = load_anatomy("upper-limb-right")
    >>> motion = turn(arm, ("EM", "EL"), np.deg2rad(90.0), constant_points(arm.landmarks, 1), column=0)
    >>> on_axis = arm.landmarks[arm.landmark_index("EM")]
    >>> np.allclose(motion.rotation @ on_axis + motion.translation, on_axis)
    True
    >>> round(float(np.linalg.norm(motion.d_rotation[:, 0])), 6)  # rad for each rad of the angle
    1.0
    """
    line = varying_line(anatomy, axis, p)
    k, sine, versine = hat(line.direction), np.sin(angle), 1.0 - np.cos(angle)
    rotation = np.eye(3) + sine * k + versine * (k @ k)
    # The left Jacobian of angle * direction, for a change of the direction, which stays square to it.
    d_rotation = sine * line.d_direction + versine * (k @ line.d_direction)
    d_rotation[:, column] += line.direction
    turned = rotation @ line.point
    d_translation = line.d_point - rotation @ line.d_point + hat(turned) @ d_rotation
    return Motion(rotation, line.point - turned, d_rotation, d_translation)


def turns_in_opensim(rest: Resting, joint: Joint, *, follows: bool) -> OsimJoint:
    """CustomJoint whose functions are the coordinates, where every coordinate is zero:

    R(a1, q1 - r1) R(a2, q2 - r2) ... = R(a1, q1) R(B1 a2, q2) ... B with B1 = R(a1, -r1) and so on.

    Its axes meet in one point; ours miss each other by hundredths of a millimetre in bodies of unusual proportions, and
    the point nearest to all is taken.
    """
    lines, coordinates = rest.lines(joint), rest.coordinates(joint, follows=follows)
    placed = transform(np.eye(3), nearest_point(lines))
    back, axes = np.eye(3), []
    for (_, axis), coordinate in zip(lines, coordinates, strict=True):
        axes.append(TransformAxis(back @ axis, coordinate.name))
        back = back @ exp_so3(-coordinate.default * axis)
    if len(axes) == 2:
        axes.append(TransformAxis(unit_vector(np.cross(axes[0].axis, axes[1].axis))))
    turned = placed @ transform(back.T, np.zeros(3))
    return rest.joint("CustomJoint", joint, placed, turned, coordinates, (*axes, *still_axes()))
