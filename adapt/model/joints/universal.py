"""The universal joint: a wrist."""

from __future__ import annotations

from adapt.model.joints.turns import Turning


class Universal(Turning):
    """Two turns: the first line is fixed in the parent, the second rides on the first turn."""

    name = "universal"
    units = ("rad", "rad")
    axes = 2
