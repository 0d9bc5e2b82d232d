"""The universal joint: a wrist."""

from __future__ import annotations

from adapt.anatomy import Joint
from adapt.model.joints.opensim import OsimJoint, Resting
from adapt.model.joints.turns import Turning, turns_in_opensim


class Universal(Turning):
    """Two turns: the first line is fixed in the parent, the second rides on the first turn."""

    name = "universal"
    units = ("rad", "rad")
    axes = 2

    def in_opensim(self, rest: Resting, joint: Joint, *, follows: bool) -> tuple[OsimJoint, ...]:
        """CustomJoint whose first two turns are the coordinates, and whose third stands still."""
        return (turns_in_opensim(rest, joint, follows=follows),)
