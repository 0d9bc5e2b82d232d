"""Of a person's two legs the right one is on the right, whichever side a search took it for."""

from __future__ import annotations

import numpy as np
import pytest

from adapt.anatomy_file import load_anatomy
from adapt.match.correspondences import Target
from adapt.match.skin_sample import sample_skin
from adapt.mirror import mirrored_body
from adapt.model.body import make_body, pose_skin, rest_theta
from adapt.search import one_leg
from adapt.search.candidates import Candidate
from adapt.search.first_pose import try_pose
from adapt.search.one_leg import on_one_leg
from adapt.search.other_limb import on_its_side
from adapt.search.own_side import is_nearer_to, keeps_to_its_side, lies_on_its_side
from capture.recording import Instant
from tests.known_limb import exact_cloud


def leg(side):
    return make_body(load_anatomy(f"lower-limb-{side}"))


def standing(body, across_m, *, turned=0.0, knee_deg=20.0):
    theta = rest_theta(body)
    theta[1] += turned
    theta[5] += across_m
    theta[body.anatomy.coordinate_index(f"knee_angle_{body.anatomy.side[0]}")] = np.deg2rad(knee_deg)
    return theta


@pytest.mark.parametrize("side", ["right", "left"])
def test_a_leg_lies_on_its_side_of_the_other_or_not(side):
    body, out = leg(side), 0.1 if side == "right" else -0.1
    mine, other = standing(body, out), standing(body, -out)
    assert lies_on_its_side(body, mine, other) is True
    assert lies_on_its_side(body, other, mine) is False
    assert lies_on_its_side(body, mine, mine) is None
    assert lies_on_its_side(body, mine, standing(body, -7.0 * out)) is None  # somebody else's
    assert lies_on_its_side(body, mine, standing(body, -out, turned=np.pi)) is None


@pytest.mark.parametrize("side", ["right", "left"])
def test_a_leg_at_another_time_is_told_by_where_both_stood(side):
    body, out = leg(side), 0.1 if side == "right" else -0.1
    mine, other = standing(body, out), standing(body, -out)
    assert is_nearer_to(body, standing(body, 0.6 * out, knee_deg=50.0), mine, other) is True
    assert is_nearer_to(body, standing(body, -0.4 * out), mine, other) is False
    assert is_nearer_to(body, standing(body, 9.0 * out), mine, other) is None  # walked away since
    assert is_nearer_to(body, standing(body, out, turned=np.pi / 2), mine, other) is None


def test_of_arms_nothing_follows(arm):
    assert not keeps_to_its_side(arm)


@pytest.fixture(scope="module")
def both():
    """A right body, and what two sensors see of its leg and of the left one beside it."""
    body = leg("right")
    left = mirrored_body(body)
    skins = [pose_skin(body, standing(body, 0.0)), pose_skin(left, standing(left, -0.05, knee_deg=35.0))]
    faces = [body.anatomy.skin_faces, len(skins[0]) + left.anatomy.skin_faces]
    return body, Target(exact_cloud(np.concatenate(skins), np.concatenate(faces)))


def test_a_leg_found_in_the_other_one_is_taken_across(both):
    body, target = both
    sample = sample_skin(body.anatomy, at_most=1000)
    mine = standing(body, 0.0)
    first = try_pose(body, target, sample, standing(body, -0.2, knee_deg=35.0))
    pose, told = on_its_side(body, target, first, sample)
    assert told is not None
    at = pose_skin(body, pose.fit.theta).mean(axis=0)
    assert np.linalg.norm(at - pose_skin(body, mine).mean(axis=0)) < 0.03


def test_a_leg_found_on_its_side_stays(both):
    body, target = both
    sample = sample_skin(body.anatomy, at_most=1000)
    first = try_pose(body, target, sample, standing(body, 0.0))
    assert on_its_side(body, target, first, sample)[0] is first


def candidate(time_s, target, pose):
    return Candidate(Instant(time_s, {}), target, pose)


def test_example_poses_are_all_of_one_leg(both, monkeypatch):
    body, target = both
    sample, left = sample_skin(body.anatomy, at_most=1000), mirrored_body(body)
    alone = Target(exact_cloud(pose_skin(left, standing(left, -0.05, knee_deg=35.0)), left.anatomy.skin_faces))
    mine = try_pose(body, target, sample, standing(body, 0.0))
    theirs = try_pose(body, target, sample, standing(body, -0.2, knee_deg=35.0))
    gone = try_pose(body, alone, sample, standing(body, -0.2, knee_deg=35.0))
    found = {id(mine): (mine, theirs.fit.theta)}  # both are found in the first cloud only
    monkeypatch.setattr(one_leg, "on_its_side", lambda body, target, pose, sample: found.get(id(pose), (pose, None)))
    used = [candidate(0.0, target, mine), candidate(1.0, target, theirs), candidate(2.0, alone, gone)]
    others = [candidate(3.0, target, mine), candidate(4.0, target, mine)]
    kept, spare, crossed = on_one_leg(body, used, others, sample)
    assert [one.instant.time_s for one in kept] == [0.0, 1.0, 3.0]
    assert [one.instant.time_s for one in spare] == [4.0]
    assert crossed == {2.0: "the other leg was found"}
    for one in kept:
        at = pose_skin(body, one.pose.fit.theta).mean(axis=0)
        assert np.linalg.norm(at - pose_skin(body, standing(body, 0.0)).mean(axis=0)) < 0.03


def test_legs_of_which_none_is_told_stay_as_they_are(both, monkeypatch):
    body, target = both
    sample = sample_skin(body.anatomy, at_most=1000)
    pose = try_pose(body, target, sample, standing(body, 0.0))
    monkeypatch.setattr(one_leg, "on_its_side", lambda body, target, pose, sample: (pose, None))
    used = [candidate(0.0, target, pose)]
    assert on_one_leg(body, used, [], sample)[0][0].pose is pose
