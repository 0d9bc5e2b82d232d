"""The hinge: an elbow, an ankle."""

from __future__ import annotations

from adapt.model.joints.turns import Turning


class Hinge(Turning):
    """A turn about the line through two landmarks."""

    name = "hinge"
    units = ("rad",)
    axes = 1
