"""The motion prior: where a limb is expected, and how sure that is, from what was last known of it."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.fit.pose import GaussianPose
from adapt.model.pose_space import advance

ACCELERATION_RAD_S2 = 400.0  # motion prior: standard deviation of joint accelerations; fast people reach it
ACCELERATION_M_S2 = 20.0
_FLOOR_RAD, _FLOOR_M = np.deg2rad(0.5), 0.002  # the prior is never narrower than this
_MEMORY_S = 0.25  # a velocity older than this says nothing any more


class Moving(Protocol):
    """A pose that changes."""

    @property
    def time_s(self) -> float:
        """When the limb was in the pose."""

    @property
    def theta(self) -> Floats:
        """The pose (n,) in rad and m."""

    @property
    def velocity(self) -> Floats:
        """Its change (n,) in rad/s and m/s."""


def predict(anatomy: Anatomy, state: Moving, time_s: float) -> GaussianPose:
    """The motion prior: constant velocity, with an uncertainty that grows by acceleration times dt^2 / 2.

    >>> from types import SimpleNamespace
    >>> from adapt.anatomy_file import load_anatomy
    >>> anatomy = load_anatomy("upper-limb-right")
    >>> n, elbow = len(anatomy.coordinates), anatomy.coordinate_index("elbow_flexion")
    >>> bending = SimpleNamespace(time_s=0.0, theta=np.full(n, 0.3), velocity=np.eye(n)[elbow])
    >>> round(float(predict(anatomy, bending, 0.04).mean[elbow]), 6)  # at 1 rad/s
    0.34
    """
    dt = time_s - state.time_s
    memory = float(np.exp(-max(0.0, dt - 0.05) / _MEMORY_S))
    mean = advance(anatomy, state.theta, state.velocity * dt * memory)
    return GaussianPose(mean, np.diag(1.0 / _spread(anatomy, np.array(dt)) ** 2))


def _spread(anatomy: Anatomy, dt: Floats) -> Floats:
    """Standard deviation (n,) in rad or m of coordinates not seen for ``dt`` () or (n,) seconds."""
    rotational = np.array([coordinate.unit == "rad" for coordinate in anatomy.coordinates])
    spread = np.where(rotational, ACCELERATION_RAD_S2, ACCELERATION_M_S2) * dt**2 / 2.0
    return np.asarray(spread + np.where(rotational, _FLOOR_RAD, _FLOOR_M))


def guess_deviation(anatomy: Anatomy, unknown_s: Floats) -> Floats:
    """Standard deviation (n,) in rad or m of coordinates that have not been known for so long (n,) s; 0 where they are.

    What is not known spreads as in ``predict``, up to the standard deviation of any place of its range being as likely.

    >>> from adapt.anatomy_file import load_anatomy
    >>> anatomy = load_anatomy("upper-limb-right")
    >>> elbow, n = anatomy.coordinate_index("elbow_flexion"), len(anatomy.coordinates)
    >>> np.rad2deg([guess_deviation(anatomy, np.full(n, s))[elbow] for s in (0, 9)]).round(1).tolist()  # known, and not
    [0.0, 37.5]
    """
    anywhere = np.array([(c.high - c.low) / np.sqrt(12.0) for c in anatomy.coordinates])
    return np.where(unknown_s > 0.0, np.minimum(_spread(anatomy, unknown_s), anywhere), 0.0)
