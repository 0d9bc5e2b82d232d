"""Fit a pose that a person set by hand to the points of its frame: what the viewer's button does.

A person sets a pose to within some ten degrees and centimetres, which is farther than tracking goes from one frame to
the next. So the pose is reached from it and from variations of each joint, held to it loosely, and the best one is
judged as tracking would judge it.
"""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Floats
from adapt.fit.pose import GaussianPose, fit_pose
from adapt.fit.problem import SEARCH_PLANE_WEIGHT
from adapt.match.correspondences import Target
from adapt.search.first_pose import variations
from adapt.search.pose_score import ScoredPose, score_pose
from capture.cloud.fuse import Region, region_of_interest
from capture.errors import CloudError, FitError
from capture.recording import Instant, Recording
from track.track_recording import ready_target
from track.tracked_frame import TrackedFrame
from track.tracker import Tracker

_LOOSELY_RAD, _LOOSELY_M = np.deg2rad(25.0), 0.10  # keeps what no point tells of where the person set it
_REACH_M = 0.10
_UPDATES = 40


def fit_from_hand(
    tracker: Tracker, recording: Recording, moment: Instant, theta: Floats, *, region: Region | None = None
) -> TrackedFrame:
    """The frame that one instant becomes when a person has set its pose near theta (n,).

    It is lost, with the reason, where there is no cloud or no pose nearby fits it.

    Raises:
        RecordingError, CalibrationError: see ``fuse``.
    """
    target = ready_target(recording, region or region_of_interest(recording), moment)
    if isinstance(target, CloudError):
        return tracker.missed(moment.time_s, target.problem)
    near = _reached(tracker, target, theta)
    start = theta if near is None else near.fit.theta
    return tracker.given(target, moment.time_s, start, tracker.nothing_known())[0]


def _reached(tracker: Tracker, target: Target, theta: Floats) -> ScoredPose | None:
    """The best pose reached from theta (n,) and from its variations, or None where none finds enough points."""
    body = tracker.subject.body
    loosely = np.array([_LOOSELY_RAD if c.unit == "rad" else _LOOSELY_M for c in body.anatomy.coordinates])
    held = GaussianPose(theta, np.diag(1.0 / loosely**2))
    reached = []
    for start in variations(body.anatomy, theta):
        try:
            fit = fit_pose(
                body,
                target,
                start,
                tracker.sample,
                updates=_UPDATES,
                gate_m=_REACH_M,
                prior=held,
                plane_weight=SEARCH_PLANE_WEIGHT,
            )
        except FitError:
            continue
        reached.append(score_pose(body, target, fit, tracker.sample))
    return min(reached, key=lambda pose: pose.cost_m, default=None)
