"""A second limb that could be meant is asked about, in adapting and in tracking; another side's or none is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adapt.match.correspondences import Target
from adapt.match.skin_sample import sample_skin
from adapt.mirror import mirrored_body
from adapt.model.body import pose_skin
from adapt.search.other_limb import other_limb, refuse_two_limbs
from capture.errors import CloudError, FitError
from capture.recording import instants
from tests.known_limb import bent, exact_cloud
from track import first_look
from track.motion import MotionError
from track.options import TrackOptions
from track.track_recording import track_recording
from track.tracker import Tracker, make_tracker

_BESIDE = np.array([0.0, 0.0, -0.45])


def beside(body, theta, other, *, other_theta):
    """The cloud of a body's arm, and of another one beside it."""
    skins = [pose_skin(body, theta), pose_skin(other, other_theta) + _BESIDE]
    faces = [body.anatomy.skin_faces, len(skins[0]) + other.anatomy.skin_faces]
    return Target(exact_cloud(np.concatenate(skins), np.concatenate(faces)))


@pytest.fixture(scope="module")
def theta(limb):
    return bent(limb.subject.body, 60.0, 20.0)


@pytest.fixture(scope="module")
def two(limb, theta):
    """Two right arms of the same person, in different poses."""
    body = limb.subject.body
    return beside(body, theta, body, other_theta=bent(body, 90.0, -30.0))


@pytest.fixture(scope="module")
def sample(limb):
    return sample_skin(limb.subject.anatomy, at_most=1000)


def test_two_limbs_that_could_be_meant_are_asked_about(limb, theta, two, sample):
    with pytest.raises(FitError, match="two limbs could be meant") as refused:
        refuse_two_limbs(limb.subject.body, [two], theta[None], None, sample, scale=1.0)
    assert "--near" in refused.value.remedy


def test_an_arm_alone_has_no_second_one(limb, theta, sample):
    body = limb.subject.body
    alone = Target(exact_cloud(pose_skin(body, theta), body.anatomy.skin_faces))
    assert other_limb(body, alone, theta, sample) is None


def test_tracking_asks_which_of_two_arms_is_the_subjects(limb, theta, two):
    tracker = make_tracker(limb.subject)
    frame = replace(tracker.missed(0.0, ""), theta=theta)
    with pytest.raises(MotionError, match="two limbs that could be the subject's") as refused:
        first_look.refuse_two_limbs(tracker, two, frame, limb.recording.path)
    assert "--near" in refused.value.remedy


def test_the_other_arm_of_the_same_person_is_not_the_subjects(limb, theta):
    body, tracker = limb.subject.body, make_tracker(limb.subject)
    left = mirrored_body(body)
    both = beside(body, theta, left, other_theta=bent(left, 90.0, -30.0))
    frame = replace(tracker.missed(0.0, ""), theta=theta)
    first_look.refuse_two_limbs(tracker, both, frame, limb.recording.path)


def test_a_recording_that_does_not_show_the_subject_is_refused_after_a_few_looks(limb, tmp_path, monkeypatch):
    looks = []

    def in_vain(self, target, time_s):
        looks.append(time_s)
        return self.missed(time_s, "nothing like it"), None

    monkeypatch.setattr(Tracker, "first", in_vain)
    with pytest.raises(MotionError, match=r"in any of 7 frames looked at .*nothing like it") as refused:
        track_recording(limb.recording, limb.subject, tmp_path / "motion")
    assert len(looks) == 7
    assert "--keep-searching" in refused.value.remedy
    motion = track_recording(limb.recording, limb.subject, tmp_path / "motion", TrackOptions(keep_searching=True))
    assert not motion.tracked.any()


def test_a_limb_that_comes_into_view_later_is_no_stranger(limb):
    tracker, asked = make_tracker(limb.subject), []

    def ready(moment):
        asked.append(moment.time_s)
        return limb.targets[4] if len(asked) > 1 else CloudError("no sensor saw anything")

    first_look.refuse_a_stranger(
        tracker, instants(limb.recording), tracker.missed(0.0, "nothing"), ready, limb.recording.path
    )
    assert len(asked) == 2
