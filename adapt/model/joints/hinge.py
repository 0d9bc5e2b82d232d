"""The hinge: an elbow, an ankle."""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Joint
from adapt.model.joints.opensim import OsimJoint, Resting, along_z
from adapt.model.joints.turns import Turning
from capture.rigid import exp_so3, transform


class Hinge(Turning):
    """A turn about the line through two landmarks."""

    name = "hinge"
    units = ("rad",)
    axes = 1
    child_carries_centre = True

    def in_opensim(self, rest: Resting, joint: Joint, *, follows: bool) -> tuple[OsimJoint, ...]:
        """PinJoint about P's z axis, with C turned back so that zero is the coordinate's own."""
        coordinates = rest.coordinates(joint, follows=follows)
        (point, axis), *_ = rest.lines(joint)
        placed = transform(along_z(axis), point)
        turned = placed @ transform(exp_so3(np.array([0.0, 0.0, coordinates[0].default])), np.zeros(3))
        return (rest.joint("PinJoint", joint, placed, turned, coordinates),)
