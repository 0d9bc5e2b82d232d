"""The ball: a hip."""

from __future__ import annotations

from adapt.model.joints.turns import Turning


class Ball(Turning):
    """Three turns about lines through one point, each riding on the one before."""

    name = "ball"
    units = ("rad", "rad", "rad")
    axes = 3
