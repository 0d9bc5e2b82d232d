"""What a person may say of an adaptation: which frames to look at, and their first poses."""

from __future__ import annotations

import numpy as np
import pytest

import adapt.adapt_recording as fitting
import adapt.search.candidates as finding
from adapt.adapt_recording import adapt_recording
from adapt.match.skin_sample import sample_skin
from adapt.model.body import pose_skin
from adapt.model.size import resized
from adapt.options import AdaptOptions
from adapt.search.candidates import Candidate, choose
from adapt.search.first_pose import try_pose
from capture.errors import FitError
from capture.recording import Instant
from tests.known_limb import bent, exact_target

LOOKED_AT = 4
GIVEN = (2, 5)


class Stopped(Exception):
    pass


@pytest.fixture
def candidates(limb, monkeypatch):
    """The candidates that an adaptation of few frames goes on with; it is stopped there."""
    reached = []

    def plausible(found):
        reached.extend(found)
        raise Stopped

    def locate(body, target, sample, starts, *, good_m=0.0):
        poses = [try_pose(body, target, sample, start) for start in starts]
        return min((pose for pose in poses if pose is not None), key=lambda pose: pose.cost_m)

    monkeypatch.setattr(finding, "_CANDIDATES", LOOKED_AT)
    monkeypatch.setattr(fitting, "plausible", plausible)
    monkeypatch.setattr(finding, "locate", locate)
    return reached


def test_frames_whose_first_pose_is_given_are_looked_at(limb, candidates):
    given = {frame: limb.thetas[frame] + 0.02 for frame in GIVEN}
    with pytest.raises(Stopped):
        adapt_recording(limb.recording, limb.subject.anatomy, AdaptOptions(first_poses=given, poses=4))
    times = [candidate.instant.time_s for candidate in candidates]
    spread = np.linspace(0, len(limb.times) - 1, LOOKED_AT).round().astype(int)
    assert not set(spread) & set(GIVEN)
    np.testing.assert_allclose(times, limb.times[sorted({*spread, *GIVEN})], atol=1e-9)
    for frame in GIVEN:
        candidate = candidates[times.index(pytest.approx(limb.times[frame]))]
        skins = [pose_skin(limb.subject.body, theta) for theta in (candidate.pose.fit.theta, limb.thetas[frame])]
        assert np.linalg.norm(skins[0] - skins[1], axis=1).mean() < 0.03


@pytest.mark.parametrize("frame", [-1, 12])
def test_a_first_pose_of_a_frame_that_does_not_exist_is_refused(limb, frame):
    given = {3: limb.thetas[3], frame: limb.thetas[3]}
    for frames in (None, [0, 3, 6, 9]):
        with pytest.raises(FitError, match=rf"no frame {frame}; frames run from 0 to 11"):
            adapt_recording(limb.recording, limb.subject.anatomy, AdaptOptions(first_poses=given, frames=frames))


def test_a_first_pose_of_a_frame_that_is_not_adapted_to_is_refused(limb):
    given = {3: limb.thetas[3], 4: limb.thetas[4]}
    with pytest.raises(FitError, match="frame 4 has a first pose, and is not among the frames"):
        adapt_recording(limb.recording, limb.subject.anatomy, AdaptOptions(first_poses=given, frames=[0, 3, 6, 9]))


def test_a_forearm_turned_over_in_some_candidates_is_turned_back_from_its_neighbours(limb):
    """In a child's arm a forearm turned by half its range has points near all its skin: its own start keeps it so."""
    child = resized(limb.subject.body, 0.6)
    turn, sample = child.anatomy.coordinate_index("pro_sup"), sample_skin(child.anatomy, at_most=1000)
    twists, candidates = (10.0, -30.0, -50.0, -50.0, -50.0, -10.0), []
    for k, twist in enumerate(twists):
        target = exact_target(child, bent(child, 20.0 + 2.0 * k, twist))
        pose = try_pose(child, target, sample, bent(child, 35.0, 85.0 if twist == -50.0 else twist))
        candidates.append(Candidate(Instant(float(k), {}), target, pose))
    assert all(np.rad2deg(candidates[k].pose.fit.theta[turn]) > 60.0 for k in (2, 3, 4))
    _, chosen, left, _ = choose(child, candidates, sample, 4)
    posed = {c.instant.time_s: np.rad2deg(c.pose.fit.theta[turn]) for c in chosen + left}
    for k, twist in enumerate(twists):
        assert abs(posed[float(k)] - twist) < 8.0
