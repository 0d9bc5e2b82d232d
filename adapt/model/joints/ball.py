"""The ball: a hip."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adapt.anatomy import Joint
from adapt.model.joints.opensim import OsimJoint, Resting, TransformAxis, along_z, unit_vector
from adapt.model.joints.turns import Turning, turns_in_opensim
from capture.rigid import transform


class Ball(Turning):
    """Three turns about lines through one point, each riding on the one before."""

    name = "ball"
    units = ("rad", "rad", "rad")
    axes = 3
    child_carries_centre = True

    def in_opensim(self, rest: Resting, joint: Joint, *, follows: bool) -> tuple[OsimJoint, ...]:
        """Two turns to a phantom body without extent, and from there a PinJoint for the third.

        One CustomJoint would do for OpenSim; nimblephysics turns three times about axes at right angles only, from
        which those of an adapted hip are off by some hundredths of a degree. With Z the turn from z to the third axis,

            P R(a1, q1) R(a2, q2) R(a3, q3) C^-1 = (P R(a1, q1) R(a2, q2)) (Z R(z, q3) (C Z)^-1).
        """
        whole = turns_in_opensim(rest, joint, follows=follows)
        first, second, third, *shifts = whole.axes
        still = TransformAxis(unit_vector(np.cross(first.axis, second.axis)))
        to_axis, phantom = transform(along_z(third.axis), np.zeros(3)), f"{joint.name}_phantom"
        two = replace(
            whole,
            child=phantom,
            in_child=np.eye(4),
            coordinates=whole.coordinates[:2],
            axes=(first, second, still, *shifts),
        )
        in_child = whole.in_child @ to_axis
        pin = OsimJoint("PinJoint", _third(joint), phantom, whole.child, to_axis, in_child, whole.coordinates[2:])
        return two, pin

    def opensim_owners(self, joint: Joint) -> dict[str, str]:
        """The third coordinate is that of the joint from the phantom."""
        return super().opensim_owners(joint) | {joint.coordinates[2]: _third(joint)}


def _third(joint: Joint) -> str:
    return f"{joint.name}_third"
