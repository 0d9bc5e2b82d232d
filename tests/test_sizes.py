"""Children and very tall people are found at their own size; sizes that nobody has are refused by bone."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import adapt.search.overall_size as overall_size_module
from adapt.anatomy_file import load_anatomy
from adapt.fit.plausible_sizes import refuse_what_nobody_is
from adapt.match.skin_sample import sample_skin
from adapt.model.body import joint_centres, make_body
from adapt.model.shape.prior import overall_size
from adapt.model.size import resized
from adapt.search.first_pose import locate, try_pose
from adapt.search.overall_size import SizedPose, settle_size
from capture.errors import FitError
from tests.known_limb import bent, exact_target
from track.evaluation.random_bodies import random_body

SEED = 21
BENT = ((70.0, 20.0), (30.0, -30.0), (100.0, 0.0), (60.0, 60.0))  # elbow and forearm, degrees
SOMEWHERE = Path("recording")


@pytest.fixture(scope="module")
def sample(arm):
    return sample_skin(arm, at_most=1200)


def settled(arm, sample, true, theta):
    """The size found in one exact cloud, and at which sizes the limb was looked for."""
    target, sizes = exact_target(true, theta), []

    def search(body, size):
        sizes.append(size)
        return locate(body, target, sample, [])

    return settle_size(make_body(arm), target, search), sizes


@pytest.mark.parametrize("size", [0.6, 1.25])
def test_a_limb_of_another_size_is_found_at_its_own(arm, sample, size):
    true = resized(random_body(arm, SEED), size)
    theta = bent(true, 70.0, 20.0)
    found, _ = settled(arm, sample, true, theta)
    assert overall_size(found.body) == pytest.approx(overall_size(true), rel=0.08)
    centres = joint_centres(true, theta)
    for name, centre in joint_centres(found.body, found.pose.fit.theta).items():
        assert np.linalg.norm(centre - centres[name]) < 0.05 * size, name


def test_a_grown_up_is_looked_for_once_and_keeps_the_template(arm, sample):
    true = random_body(arm, SEED)
    found, sizes = settled(arm, sample, true, bent(true, 70.0, 20.0))
    assert sizes == [1.0]
    np.testing.assert_array_equal(found.body.shape, make_body(arm).shape)


def test_a_grown_up_keeps_the_pose_that_was_searched(arm, sample, monkeypatch):
    """Proportions fitted to a single frame may turn a forearm over; they only tell the size."""
    true = random_body(arm, SEED)
    theta = bent(true, 70.0, 20.0)
    searched = try_pose(make_body(arm), exact_target(true, theta), sample, theta)
    turned = replace(searched, fit=replace(searched.fit, theta=searched.fit.theta + 1.0))
    monkeypatch.setattr(overall_size_module, "_grown", lambda target, start, pose, person: SizedPose(start, turned))
    found = settle_size(make_body(arm), exact_target(true, theta), lambda body, size: searched)
    np.testing.assert_array_equal(found.pose.fit.theta, searched.fit.theta)


def test_a_resized_body_is_the_same_body_larger(arm):
    body = random_body(arm, SEED)
    grown = resized(body, 0.7)
    spans = [np.diff(one.affine.heads(one.shape), axis=0) for one in (body, grown)]
    np.testing.assert_allclose(spans[1], 0.7 * spans[0], atol=1e-12)
    skins = [one.v_tilde.value - one.affine.heads(one.shape)[0] for one in (body, grown)]
    np.testing.assert_allclose(skins[1], 0.7 * skins[0], atol=1e-7)  # weights are stored in single precision


@pytest.mark.parametrize("anatomy", ["upper-limb-right", "lower-limb-right"])
@pytest.mark.parametrize("size", [0.6, 1.0, 1.25])
def test_people_of_six_and_tall_ones_are_not_refused(anatomy, size):
    for seed in range(6):
        refuse_what_nobody_is(resized(random_body(load_anatomy(anatomy), seed), size), SOMEWHERE)


def test_the_smallest_girl_of_six_is_not_refused(arm):
    """WHO 2007, 72 months: girls are smaller than boys and vary more (0.990 of the smallest boy of a thousand)."""
    refuse_what_nobody_is(resized(make_body(arm), 0.449), SOMEWHERE)
    with pytest.raises(FitError, match="from six years on"):
        refuse_what_nobody_is(resized(make_body(arm), 0.445), SOMEWHERE)


def test_a_wide_pelvis_over_short_thighs_is_somebodys():
    """ANSUR II: hips' breadth and thigh go together less than two parts of a limb do."""
    leg = load_anatomy("lower-limb-right")
    body = make_body(leg)
    for pelvis in (0.7, 1.4):
        shape = body.shape.reshape(-1, 4).copy()
        shape[1:, 1:] += (pelvis - 1.0) * (body.affine.centres[1] - body.affine.centres[0])
        refuse_what_nobody_is(make_body(leg, shape=shape.ravel()), SOMEWHERE)


@pytest.mark.parametrize("size", [0.1, 0.4, 1.5, 10.0])  # centimetres for millimetres, half or twice the focal length
def test_a_size_that_nobody_has_is_refused_by_bone_with_its_causes(arm, size):
    with pytest.raises(FitError) as refusal:
        refuse_what_nobody_is(resized(make_body(arm), size), SOMEWHERE)
    text = str(refusal.value)
    assert f"{size:.2f} of the template's" in text
    assert re.search(r"the \w+ came out \d+ mm long", text)
    assert "99.9 % of people" in text
    causes = ["unit", "focal length", "side", "something else"]
    assert [text.index(cause) for cause in causes] == sorted(text.index(cause) for cause in causes)


def test_a_forearm_too_long_for_its_upper_arm_is_refused(arm):
    body = make_body(arm)
    shape = body.shape.reshape(-1, 4).copy()
    shape[1:, 1:] -= 0.3 * (body.affine.centres[1] - body.affine.centres[0])  # the upper arm 0.7,
    shape[2:, 1:] += 0.3 * (body.affine.centres[2] - body.affine.centres[1])  # the forearm 1.3 times as long
    with pytest.raises(FitError, match=r"the humerus came out 209 mm long and the ulna 323 mm"):
        refuse_what_nobody_is(make_body(arm, shape=shape.ravel()), SOMEWHERE)
