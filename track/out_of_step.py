"""Frames whose sensors did not look at once: what that does to their poses is taken back, and what is left is stated.

A point that a sensor saw d seconds after the instant lies on skin that has moved on by J v d, where the limb moves by v
a second. Near the best pose that makes the pose err by L v, with the *lever*

    L = H^-1 sum over sensors of d H_sensor        (n, n), seconds,

H the data's curvature and H_sensor the part of it that one sensor's points make. The velocity is that between the
neighbours of a frame; what is not known of it, times the lever, is left in the pose and goes into its covariance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.fit.pose import PoseFit
from adapt.fit.posterior import inflate_by_lever, late_lever
from adapt.match.correspondences import Correspondences, Target
from adapt.match.point_grid import PointGrid
from adapt.match.skin_sample import SkinSample
from adapt.model.body import Body
from adapt.model.pose_space import advance, pose_difference

if TYPE_CHECKING:
    from track.tracked_frame import TrackedFrame

IN_STEP_S = 1e-3
_NEIGHBOUR_S = 0.15  # a pose farther off in time says nothing of the velocity
_UNKNOWN = {"rad": 2.0, "m": 0.5}  # standard deviation of a velocity that nothing tells, a second
_UNSURE = 0.25  # of a velocity between neighbours, that between the frames may differ


def lever_of_late(body: Body, target: Target, fit: PoseFit, sample: SkinSample) -> Floats:
    """The lever (n, n) (s) of a pose fitted to the target; (0, 0) if all sensors looked at once."""
    late = [view.late_s for view, _, _ in target.parts]
    if max(map(abs, late), default=0.0) < IN_STEP_S:
        return np.zeros((0, 0))
    sensors = [(late_s, _seen_by(grid, fit.matches)) for (_, _, grid), late_s in zip(target.parts, late, strict=True)]
    return late_lever(body, fit.theta, sensors, sample)


def _seen_by(grid: PointGrid, matches: Correspondences) -> Correspondences:
    """Those of the matches whose targets are a sensor's."""
    return matches.at(np.flatnonzero(np.isfinite(grid.query(matches.target, distance_upper_bound=1e-9)[0])))


def in_step(anatomy: Anatomy, frames: Sequence[TrackedFrame]) -> list[TrackedFrame]:
    """The frames with their poses at their instants, and covariances that hold what is not known of the velocity."""
    return [_in_step(anatomy, frames, k) if frame.late.size else frame for k, frame in enumerate(frames)]


def _in_step(anatomy: Anatomy, frames: Sequence[TrackedFrame], k: int) -> TrackedFrame:
    frame = frames[k]
    velocity, deviation = _velocity(anatomy, frames, k)
    theta = advance(anatomy, frame.theta, -frame.late @ velocity)
    return replace(frame, theta=theta, covariance=inflate_by_lever(frame.covariance, frame.late, deviation))


def _velocity(anatomy: Anatomy, frames: Sequence[TrackedFrame], k: int) -> tuple[Floats, Floats]:
    """Velocity (n,) at a frame and its standard deviation, from the frames before and after it."""
    frame = frames[k]
    speeds = []
    for other in (k - 1, k + 1):
        if 0 <= other < len(frames) and not frames[other].lost:
            apart_s = frames[other].time_s - frame.time_s
            if abs(apart_s) <= _NEIGHBOUR_S:
                speeds.append(pose_difference(anatomy, frames[other].theta, frame.theta) / apart_s)
    unknown = np.array([_UNKNOWN[coordinate.unit] for coordinate in anatomy.coordinates])
    if not speeds:
        return np.zeros(len(unknown)), unknown
    velocity = np.mean(speeds, axis=0)
    apart = np.abs(speeds[0] - speeds[-1]) / 2.0 if len(speeds) > 1 else unknown / 2.0
    return velocity, apart + _UNSURE * np.abs(velocity)
