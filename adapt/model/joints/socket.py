"""The socket: a ball whose coordinates are a rotation vector, so that no pose locks it: a shoulder.

Three angles lock a ball where the second turn brings the axis of the third onto that of the first: body-fixed X-Y-Z
at 90 degrees of Y, which a raised arm passes. In the rotation vector r, X(r) = exp(r) varies by the left Jacobian as in
the free joint, and has full rank short of a whole turn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from adapt.anatomy import Anatomy, Floats, Joint
from adapt.model.compiled.rows import Row, swing
from adapt.model.derivatives import Motion, Points
from adapt.model.joints.euler import arm_angles, continuous_angles, euler_names
from adapt.model.joints.framed import Framed, turned_over
from adapt.model.joints.joint_type import rest_values
from adapt.model.joints.opensim import OsimCoordinate, OsimJoint, Resting, TransformAxis, still_axes
from adapt.model.known_rows import of_known_rows
from capture.rigid import exp_so3, left_jacobian_so3


class Socket(Framed):
    """A rotation vector (rad) in a frame of the parent about its origin, zero where the child's axes are the frame's.

    The mirror image's frame is turned over, so that the same vector is the same movement on both sides.
    """

    name = "socket"
    child_carries_centre = True
    rotation_vector = (0, 1, 2)

    def placed(self, anatomy: Anatomy, joint: Joint, q: Floats, p: Points, columns: Sequence[int]) -> Motion:
        """[exp(q), 0]."""
        d_rotation, d_translation = np.zeros((2, 3, p.n))
        if len(columns):
            d_rotation[:, columns] = left_jacobian_so3(q)
        return Motion(exp_so3(q), np.zeros(3), d_rotation, d_translation)

    def rows_inside(self, anatomy: Anatomy, joint: Joint, p: Points, after: Motion) -> list[Row]:
        """One turn by all three."""
        return [swing(after)]

    def mirrored(self, joint: Joint) -> Joint:
        """The frame turned over, in which turns keep their signs."""
        return replace(joint, frames=tuple(turned_over(frame) for frame in joint.frames))

    def reported(self, joint: Joint, q: Floats) -> dict[str, Floats]:
        """Body-fixed X-Y-Z angles in the frame, which go on past the lock, and ISB's Y-X'-Y'' of an upper arm."""
        angles = np.rad2deg(of_known_rows(q, continuous_angles))
        raised = np.rad2deg(of_known_rows(q, lambda known: arm_angles(exp_so3(known))))
        names = (f"{joint.name}_{what}" for what in ("plane_of_elevation", "elevation", "axial_rotation"))
        return dict(zip(euler_names(joint), angles.T, strict=True)) | dict(zip(names, raised.T, strict=True))

    def in_opensim(self, rest: Resting, joint: Joint, *, follows: bool) -> tuple[OsimJoint, ...]:
        """CustomJoint of the body-fixed X-Y-Z angles."""
        (angles,) = continuous_angles(rest_values(rest.anatomy, joint)[None])
        coordinates = tuple(
            OsimCoordinate(name, -np.pi, np.pi, float(angle))
            for name, angle in zip(euler_names(joint), angles, strict=True)
        )
        turns = (TransformAxis(axis, c.name) for axis, c in zip(np.eye(3), coordinates, strict=True))
        axes = (*turns, *still_axes())
        return (rest.joint("CustomJoint", joint, *self.offsets(rest, joint), coordinates, axes),)

    def opensim_owners(self, joint: Joint) -> dict[str, str]:
        """Those of the X-Y-Z angles."""
        return dict.fromkeys(euler_names(joint), joint.name)
