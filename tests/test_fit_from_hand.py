"""A pose set by hand, fitted to the points of its frame: nearby it arrives, far away it says so."""

from __future__ import annotations

import numpy as np
import pytest

from adapt.model.body import joint_centres
from capture.recording import Region, instants
from tests.known_limb import KnownLimb
from track.fit_from_hand import fit_from_hand
from track.tracked_frame import BY_HAND
from track.tracker import Tracker, make_tracker

FRAME = 4


@pytest.fixture(scope="module")
def tracker(limb: KnownLimb) -> Tracker:
    return make_tracker(limb.subject)


def moved(limb: KnownLimb, seed: int, degrees: float, metres: float) -> np.ndarray:
    """The true pose with every coordinate moved by as much, one way or the other."""
    coordinates = limb.subject.anatomy.coordinates
    step = np.array([np.deg2rad(degrees) if c.unit == "rad" else metres for c in coordinates])
    theta = limb.thetas[FRAME] + step * np.random.default_rng(seed).choice([-1.0, 1.0], len(step))
    return np.clip(theta, [c.low for c in coordinates], [c.high for c in coordinates])


@pytest.mark.parametrize("seed", range(4))
def test_a_pose_ten_degrees_off_in_every_joint_arrives(limb: KnownLimb, tracker: Tracker, seed: int) -> None:
    moment, theta = instants(limb.recording)[FRAME], moved(limb, seed, 10.0, 0.02)
    found = fit_from_hand(tracker, limb.recording, moment, theta)
    assert not found.lost
    assert found.how == BY_HAND
    error = np.abs(found.theta - limb.thetas[FRAME])
    assert np.rad2deg(error[6:]).max() < 3.0
    assert error[3:6].max() < 0.005


def test_what_no_point_tells_of_stays_as_it_was_set(limb: KnownLimb, tracker: Tracker) -> None:
    """Without the hand's points its flexion is what the person said."""
    anatomy, points = limb.subject.anatomy, limb.targets[FRAME].cloud.points
    centres = joint_centres(limb.subject.body, limb.thetas[FRAME])
    onward = centres["wrist"] - centres["elbow"]
    axis = int(np.abs(onward).argmax())
    low, high = points.min(axis=0) - 0.01, points.max(axis=0) + 0.01
    (high if onward[axis] > 0.0 else low)[axis] = centres["wrist"][axis]
    theta = limb.thetas[FRAME].copy()
    theta[anatomy.coordinate_index("flexion")] += np.deg2rad(15.0)
    moment = instants(limb.recording)[FRAME]
    found = fit_from_hand(tracker, limb.recording, moment, theta, region=Region(low, high))
    assert not found.lost
    assert [bone.name for bone, shows in zip(anatomy.bones, found.shown, strict=True) if not shows] == ["hand"]
    flexion = anatomy.coordinate_index("flexion")
    assert abs(found.theta[flexion] - theta[flexion]) < np.deg2rad(5.0)


def test_a_pose_beside_the_limb_is_not_fitted(limb: KnownLimb, tracker: Tracker) -> None:
    theta = limb.thetas[FRAME].copy()
    theta[5] += 0.5
    found = fit_from_hand(tracker, limb.recording, instants(limb.recording)[FRAME], theta)
    assert found.lost.startswith("from the pose set by hand ")


def test_where_there_are_no_points_it_says_so(limb: KnownLimb, tracker: Tracker) -> None:
    nowhere = Region(np.full(3, 5.0), np.full(3, 6.0))
    moment = instants(limb.recording)[FRAME]
    found = fit_from_hand(tracker, limb.recording, moment, limb.thetas[FRAME], region=nowhere)
    assert "no sensor saw anything inside the region" in found.lost
