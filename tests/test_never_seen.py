"""Bones that nobody ever saw, a lost hand above all: not claimed, nor what only they could tell."""

from __future__ import annotations

import numpy as np
import pytest

from adapt.anatomy import Anatomy, Floats
from adapt.fit.alternate import adapt_body
from adapt.fit.never_seen import ends, guessed_lengths, never_seen, without
from adapt.fit.pose import fit_pose
from adapt.match.correspondences import Target
from adapt.match.skin_sample import sample_skin
from adapt.model.body import Body, joint_centres, make_body
from adapt.subject import Subject
from tests.known_limb import bent, exact_cloud
from track.evaluation.random_bodies import random_body
from track.evaluation.stump import stump
from track.motion import bones_and_centres
from track.tracker import make_tracker

POSES = ((35.0, -30.0), (60.0, 30.0), (85.0, 0.0), (100.0, 40.0))


@pytest.fixture(scope="module")
def person(arm: Anatomy) -> Body:
    return random_body(arm, 5)


@pytest.fixture(scope="module")
def thetas(person: Body) -> Floats:
    return np.array([bent(person, *pose) for pose in POSES])


@pytest.fixture(scope="module")
def without_hand(person: Body, thetas: Floats) -> list[Target]:
    cut = stump(person, ("hand",))
    return [Target(exact_cloud(cut.at(theta), cut.faces)) for theta in thetas]


def posed(body: Body, targets: list[Target], thetas: Floats) -> list[tuple[Target, Floats]]:
    """The clouds with poses as a first search would give them: the template's, its hand bent to what there is."""
    sample = sample_skin(body.anatomy, at_most=2000)
    return [(t, fit_pose(body, t, theta, sample).theta) for t, theta in zip(targets, thetas, strict=True)]


def test_a_stump_is_a_closed_surface_with_everything_but_the_hand(person):
    cut = stump(person, ("hand",))
    edges = np.sort(np.concatenate([cut.faces[:, [0, 1]], cut.faces[:, [1, 2]], cut.faces[:, [2, 0]]]), axis=1)
    rides = person.skin_riding[:, [bone.name for bone in person.anatomy.bones].index("hand")]
    assert (rides[cut.faces[cut.faces < len(rides)]] < 0.5).all()
    around_tip = edges[(edges == len(rides)).any(axis=1)]
    _, count = np.unique(around_tip, axis=0, return_counts=True)
    assert len(count) == len(cut.rim)
    assert (count == 2).all()


def test_a_hand_that_no_cloud_shows_was_never_seen(arm, person, thetas, without_hand):
    body = make_body(arm)
    sample = sample_skin(arm, at_most=2000)
    lost = never_seen(body, posed(body, without_hand, thetas), sample)
    assert lost.bones == ("hand",)
    assert lost.skin.mean() < 0.6
    assert lost.report(arm) == {"bones_never_seen": ["hand"], "lengths_guessed": ["ulna", "radius"]}


def test_of_a_whole_arm_everything_was_seen_and_all_skin_takes_part(arm, limb):
    body = make_body(arm)
    sample = sample_skin(arm, at_most=2000)
    poses = posed(body, [limb.targets[k] for k in (0, 4)], limb.thetas[[0, 4]])
    lost = never_seen(body, poses, sample)
    assert lost.bones == ()
    assert not lost.skin.any()


def test_a_stumps_end_leaves_the_wrist_where_it_was(arm, person, thetas, without_hand):
    body = make_body(arm)
    poses = posed(body, without_hand, thetas)
    lost = never_seen(body, poses, sample_skin(arm, at_most=2000))
    starts = np.array([theta for _, theta in poses])
    found = adapt_body(body, without_hand, starts, outer_rounds=1, gone=lost.skin)
    pairs = zip(found.thetas, thetas, strict=True)
    wrists = [joint_centres(found.body, a)["wrist"] - joint_centres(person, b)["wrist"] for a, b in pairs]
    assert np.linalg.norm(wrists, axis=1).mean() < 0.006


def test_where_an_unseen_bone_begins_is_not_claimed_and_the_rest_is(arm, limb):
    subject = Subject(limb.subject.body, limb.thetas[:4], limb.times[:4], limb.subject.covariance, {})
    shown = np.ones((2, len(arm.bones)), dtype=bool)
    unsure = Subject(subject.body, subject.thetas, subject.times, subject.covariance, {"bones_never_seen": ["hand"]})
    _, centres = bones_and_centres(unsure, limb.thetas[:2], shown)
    assert np.isnan(centres.pop("wrist")).all()
    assert all(np.isfinite(centre).all() for centre in centres.values())
    _, sure = bones_and_centres(subject, limb.thetas[:2], shown)
    assert np.isfinite(sure["wrist"]).all()


def test_a_bone_never_seen_in_adapting_is_hidden_in_tracking_even_where_it_shows(limb):
    was = limb.subject
    report = was.report | {"bones_never_seen": ["hand"]}
    tracker = make_tracker(Subject(was.body, was.thetas, was.times, was.covariance, report))
    frame, _ = tracker.given(limb.targets[0], 0.0, limb.thetas[0], tracker.nothing_known())
    names = [bone.name for bone in was.anatomy.bones]
    assert not frame.lost
    assert not frame.shown[names.index("hand")]
    assert frame.shown[names.index("radius")]


def test_what_ends_at_an_unseen_bone_is_named(arm):
    assert ends(arm, ["hand"]) == ["wrist"]
    assert guessed_lengths(arm, ["hand"]) == ["ulna", "radius"]
    assert ends(arm, []) == guessed_lengths(arm, []) == []


def test_a_sample_without_some_skin_still_knows_the_normals_of_the_rest(arm):
    sample = sample_skin(arm)
    skin = np.arange(len(arm.skin_vertices)) % 3 == 0
    less = without(sample, skin)
    assert not skin[less.vertices].any()
    assert not less.observations[skin].any()
    np.testing.assert_allclose(
        less.normals(arm.skin_vertices)[less.vertices], sample.normals(arm.skin_vertices)[less.vertices], atol=1e-12
    )
