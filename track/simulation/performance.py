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
    """So many poses (count, n) at rest, but for the ``columns`` (count,) given by a coordinate's name.

    >>> from adapt.anatomy_file import load_anatomy
    >>> from adapt.model.body import make_body
    >>> arm = make_body(load_anatomy("upper-limb-right"))
    >>> poses = poses_with(arm, {"elbow_flexion": np.deg2rad([0.0, 90.0])}, 2)
    >>> poses.shape, poses[:, arm.anatomy.coordinate_index("elbow_flexion")].round(2).tolist()
    ((2, 10), [0.0, 1.57])
    """
    thetas = np.tile(rest_theta(body), (count, 1))
    for joint in body.anatomy.joints:
        if len(joint.axes) == 2:  # held straight, not as at rest: a wrist
            thetas[:, joint_index(body.anatomy, joint)] = 0.0
    for name, values in columns.items():
        thetas[:, body.anatomy.coordinate_index(name)] = values
    return thetas
