"""Sensors that do not look at once: poses are put in step, and deviations hold what is not known of the velocity."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adapt.fit.pose import fit_pose
from adapt.match.correspondences import Target
from adapt.match.skin_sample import sample_skin
from tests.known_limb import bent, exact_target
from track.out_of_step import in_step, lever_of_late
from track.tracker import make_tracker

LATE_S, STEP_S = 0.02, 0.05
SPEED_DEG_S = {"elbow_flexion": 120.0, "pro_sup": 150.0}


@pytest.fixture(scope="module")
def velocity(limb):
    values = np.zeros(len(limb.subject.anatomy.coordinates))
    for name, speed in SPEED_DEG_S.items():
        values[limb.subject.anatomy.coordinate_index(name)] = np.deg2rad(speed)
    return values


@pytest.fixture(scope="module")
def theta(limb):
    return bent(limb.subject.body, 60.0, 10.0)


def seen(body, first, second, late):
    """What two sensors see, each of a pose of its own; ``late`` is how long after the instant each looked."""
    targets = [exact_target(body, pose) for pose in (first, second)]
    clouds = [target.cloud for target in targets]
    mine = [cloud.sensor == k for k, cloud in enumerate(clouds)]
    parts = {
        name: np.concatenate([getattr(cloud, name)[chosen] for cloud, chosen in zip(clouds, mine, strict=True)])
        for name in ("points", "normals", "boundary", "sensor")
    }
    views = tuple(replace(clouds[k].views[k], late_s=late[k]) for k in range(2))
    return Target(replace(clouds[0], views=views, **parts))


def tracked_at(limb, theta, velocity, time_s, late):
    """A frame fitted to what the sensors saw of a limb that moves evenly."""
    body, tracker = limb.subject.body, make_tracker(limb.subject)
    now = theta + time_s * velocity
    target = seen(body, now + late[0] * velocity, now + late[1] * velocity, late)
    sample = sample_skin(body.anatomy, at_most=2000)
    fit = fit_pose(body, target, now, sample)
    shown, covariance = np.ones(len(body.anatomy.bones), dtype=bool), 1e-6 * np.eye(len(theta))
    lost = tracker.missed(time_s, "")
    return replace(
        lost, theta=fit.theta, covariance=covariance, shown=shown, late=lever_of_late(body, target, fit, sample)
    )


def errors_deg(limb, frame, truth):
    chosen = [limb.subject.anatomy.coordinate_index(name) for name in SPEED_DEG_S]
    return np.rad2deg(frame.theta - truth)[chosen], np.rad2deg(np.sqrt(np.diag(frame.covariance)))[chosen]


def test_a_pose_of_sensors_out_of_step_is_put_in_step(limb, theta, velocity):
    times = (-STEP_S, 0.0, STEP_S)
    frames = [tracked_at(limb, theta, velocity, time_s, (0.0, LATE_S)) for time_s in times]
    before, narrow = errors_deg(limb, frames[1], theta)
    after, wide = errors_deg(limb, in_step(limb.subject.anatomy, frames)[1], theta)
    assert np.abs(before).max() > 1.0  # half of what the limb turns by in 20 ms
    assert np.abs(after).max() < 0.4 * np.abs(before).max()
    assert (np.abs(after) < 2.0 * wide).all()
    assert (wide > narrow).all()


def test_sensors_that_are_late_alike_are_late_by_that(limb, theta, velocity):
    frame = tracked_at(limb, theta, velocity, 0.0, (LATE_S, LATE_S))
    np.testing.assert_allclose(frame.late, LATE_S * np.eye(len(theta)), atol=0.05 * LATE_S)


def test_sensors_in_step_need_nothing(limb, theta, velocity):
    frame = tracked_at(limb, theta, velocity, 0.0, (0.0, 0.0))
    assert frame.late.size == 0
    assert in_step(limb.subject.anatomy, [frame])[0] is frame


def test_a_frame_without_neighbours_is_as_unsure_as_a_limb_may_be_fast(limb, theta, velocity):
    frame = tracked_at(limb, theta, velocity, 0.0, (0.0, LATE_S))
    alone = in_step(limb.subject.anatomy, [frame])[0]
    error, deviation = errors_deg(limb, alone, theta)
    np.testing.assert_allclose(alone.theta, frame.theta, atol=1e-12)
    assert (np.abs(error) < 2.0 * deviation).all()
