"""The cylindrical joint: a child that turns about a line and slides along it."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from adapt.anatomy import Anatomy, Floats, Joint
from adapt.model.compiled.rows import Row, screw
from adapt.model.derivatives import Motion, Points, compose
from adapt.model.frames import varying_line
from adapt.model.joints.joint_type import JointType, rest_values
from adapt.model.joints.opensim import OsimJoint, Resting, TransformAxis, still_axes
from adapt.model.joints.turns import turn
from capture.rigid import exp_so3, transform


class Cylindrical(JointType):
    """A turn (rad) about the line through two landmarks, and a slide (m) along it from the first to the second.

    The mirror image's line runs from the opposite end: the same turn is the same movement, the slide changes its sign.
    """

    name = "cylindrical"
    units = ("rad", "m")
    axes = 1
    turned_over = (1,)

    def motion(self, anatomy: Anatomy, joint: Joint, q: Floats, p: Points, columns: list[int]) -> Motion:
        """H: x' = R (x - f) + f + s u, with the turn and the slide s counted from rest."""
        angle, shift = q - rest_values(anatomy, joint)
        (axis,) = joint.axes
        return compose(turn(anatomy, axis, angle, p, columns[0]), _slide(anatomy, axis, shift, p, columns[1]))

    def rows(self, anatomy: Anatomy, joint: Joint, p: Points) -> list[Row]:
        """The turn, and the slide that rides on it: they could change places."""
        line, (turned, shifted) = varying_line(anatomy, joint.axes[0], p), rest_values(anatomy, joint)
        return [screw(0, turned, line, turn=1.0), screw(1, shifted, line, shift=1.0)]

    def in_opensim(self, rest: Resting, joint: Joint, *, follows: bool) -> tuple[OsimJoint, ...]:
        """CustomJoint that turns about P's x axis and shifts along it, with C turned and moved back by the rest."""
        turned, shifted = coordinates = rest.coordinates(joint, follows=follows)
        (point, axis), *_ = rest.lines(joint)
        placed = transform(Rotation.align_vectors([axis], [[1.0, 0.0, 0.0]])[0].as_matrix(), point)
        x, y, z = still_axes()
        along = x.axis
        axes = (TransformAxis(along, turned.name), y, z, TransformAxis(along, shifted.name), y, z)
        at_rest = transform(exp_so3(turned.default * along), shifted.default * along)
        return (rest.joint("CustomJoint", joint, placed, placed @ at_rest, coordinates, axes),)


def _slide(anatomy: Anatomy, axis: tuple[str, str], shift: float, p: Points, column: int) -> Motion:
    """A shift by ``shift`` (m) along the line through two landmarks."""
    line = varying_line(anatomy, axis, p)
    d_translation = shift * line.d_direction
    d_translation[:, column] += line.direction
    return Motion(np.eye(3), shift * line.direction, np.zeros_like(d_translation), d_translation)
