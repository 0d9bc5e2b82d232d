"""A performance: who moves, and how. It is what can be simulated as a recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from adapt.anatomy import Floats
from adapt.model.body import Body, rest_theta
from adapt.model.pose_space import joint_index
from capture.errors import BonetrackError


class PerformanceError(BonetrackError):
    """A motion table cannot be performed."""


@dataclass(frozen=True, eq=False)
class Performance:
    """A body and its poses (T, n) over time (T,) s."""

    body: Body
    times: Floats = field(repr=False)
    thetas: Floats = field(repr=False)


def poses_with(body: Body, columns: Mapping[str, Floats], count: int) -> Floats:
    """So many poses (count, n) at rest, but for the ``columns`` (count,) given by a coordinate's name."""
    thetas = np.tile(rest_theta(body), (count, 1))
    for joint in body.anatomy.joints:
        if len(joint.axes) == 2:  # held straight, not as at rest: a wrist
            thetas[:, joint_index(body.anatomy, joint)] = 0.0
    for name, values in columns.items():
        thetas[:, body.anatomy.coordinate_index(name)] = values
    return thetas
