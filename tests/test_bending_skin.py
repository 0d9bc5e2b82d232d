"""Skin near a bending joint counts less, the same function for every joint and for everyone who weighs matches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adapt.anatomy import Anatomy, Floats
from adapt.anatomy_file import load_anatomy
from adapt.fit.noise import patch_misfit, patch_noise
from adapt.fit.pose import PoseFit, match_pose
from adapt.fit.posterior import pose_sensitivity
from adapt.match.bending_skin import REACH_M, SIZE, bend_trust
from adapt.match.correspondences import Correspondences
from adapt.match.skin_sample import sample_skin
from adapt.mirror import mirrored
from adapt.model.body import joint_centres, make_body, rest_theta
from adapt.search.pose_score import find_skin
from adapt.search.search_journal import FoundPoses
from capture.journal import resume_journal


@pytest.fixture(scope="module")
def leg() -> Anatomy:
    return load_anatomy("lower-limb-right")


def bent_by(anatomy: Anatomy, **degrees: float) -> Floats:
    """The rest pose with some coordinates changed."""
    theta = rest_theta(make_body(anatomy))
    for name, angle in degrees.items():
        theta[anatomy.coordinate_index(name)] += np.deg2rad(angle)
    return theta


def trust(anatomy: Anatomy, **degrees: float) -> Floats:
    return bend_trust(make_body(anatomy), bent_by(anatomy, **degrees))


def far_from(anatomy: Anatomy, joint: str, distance_m: float) -> Floats:
    centre = joint_centres(make_body(anatomy), rest_theta(make_body(anatomy)))[joint]
    return np.linalg.norm(anatomy.skin_vertices - centre, axis=1) > distance_m


def test_in_the_rest_pose_all_skin_is_calm(arm, leg):
    for anatomy in (arm, leg):
        np.testing.assert_array_equal(trust(anatomy), 1.0)


def test_a_limb_that_moves_as_a_whole_bends_nothing(arm):
    theta = bent_by(arm, shoulder_rx=70.0, shoulder_rz=-40.0)
    np.testing.assert_allclose(bend_trust(make_body(arm), theta), 1.0, atol=1e-12)


@pytest.mark.parametrize(
    ("limb", "coordinate", "joint"),
    [
        ("arm", "elbow_flexion", "elbow"),
        ("arm", "flexion", "wrist"),
        ("leg", "knee_angle_r", "knee"),
        ("leg", "ankle_angle_r", "ankle"),
        ("leg", "hip_flexion_r", "hip"),
        ("leg", "hip_adduction_r", "hip"),
    ],
)
def test_a_bent_joint_lowers_trust_in_the_skin_about_it_only(limb, coordinate, joint, request):
    anatomy = request.getfixturevalue(limb)
    bent = trust(anatomy, **{coordinate: 30.0})
    assert bent.min() == pytest.approx(1.0 / (1.0 + (SIZE * 0.5) ** 2), rel=0.1)
    assert bent[far_from(anatomy, joint, 0.30)].min(initial=1.0) > 0.99


def test_a_joint_bent_either_way_is_trusted_alike_and_beyond_90_degrees_no_more_than_there(leg):
    forth, back = (trust(leg, ankle_angle_r=angle) for angle in (25.0, -25.0))
    np.testing.assert_allclose(forth, back, atol=1e-9)
    right_angle, beyond = (trust(leg, knee_angle_r=angle) for angle in (90.0, 119.0))
    np.testing.assert_allclose(right_angle, beyond, atol=0.02)
    assert beyond.min() == pytest.approx(1.0 / (1.0 + SIZE**2), rel=0.02)


def test_trust_comes_back_with_the_distance_from_the_bend(leg):
    size = np.sqrt(1.0 / trust(leg, knee_angle_r=90.0) - 1.0)
    at_bend = size > 0.999 * SIZE
    gap = np.linalg.norm(leg.skin_vertices[:, None] - leg.skin_vertices[at_bend][None], axis=2).min(axis=1)
    np.testing.assert_allclose(size, SIZE * np.exp(-0.5 * (gap / REACH_M) ** 2), atol=0.05 * SIZE)


@pytest.mark.parametrize(("limb", "twist"), [("arm", {"pro_sup": 75.0}), ("leg", {"hip_rotation_r": 35.0})])
def test_a_twist_hardly_bends_anything(limb, twist, request):
    assert trust(request.getfixturevalue(limb), **twist).min() > 0.93


def test_a_mirrored_limb_is_trusted_the_same(arm, leg):
    for anatomy, bend in ((arm, {"elbow_flexion": 60.0, "pro_sup": 20.0}), (leg, {"hip_flexion_r": 50.0})):
        other = mirrored(anatomy)
        names = {c.name: o.name for c, o in zip(anatomy.coordinates, other.coordinates, strict=True)}
        here, there = trust(anatomy, **bend), trust(other, **{names[name]: angle for name, angle in bend.items()})
        np.testing.assert_allclose(here, there, atol=1e-9)


# ---- who weighs matches


@pytest.fixture(scope="module")
def sample(arm):
    return sample_skin(arm, at_most=1500)


@pytest.fixture(scope="module")
def matches(limb, sample) -> Correspondences:
    """Of an elbow bent by more than it is at rest."""
    bent = int(limb.thetas[:, limb.subject.anatomy.coordinate_index("elbow_flexion")].argmax())
    return match_pose(limb.subject.body, limb.targets[bent], limb.thetas[bent], sample, gate_m=0.04)


def test_matches_are_trusted_as_the_pose_allows_in_which_they_were_found(limb, sample, matches):
    bent = int(limb.thetas[:, limb.subject.anatomy.coordinate_index("elbow_flexion")].argmax())
    np.testing.assert_array_equal(matches.trust, bend_trust(limb.subject.body, limb.thetas[bent], matches.vertex))
    assert matches.trust.min() < 0.3
    np.testing.assert_array_equal(sample.counts(matches), sample.observations[matches.vertex] * matches.trust)


def test_a_pose_is_less_sure_where_matches_are_trusted_less(limb, sample, matches):
    doubted = PoseFit(limb.thetas[0], matches, matches.distance)
    believed = PoseFit(limb.thetas[0], replace(matches, trust=np.ones(len(matches))), matches.distance)
    one, other = (
        pose_sensitivity(limb.subject.body, fit, sample, with_tissue=True).by_noise for fit in (doubted, believed)
    )
    assert (np.linalg.eigvalsh(one - other) > -1e-12).all()
    assert np.trace(one) > 1.05 * np.trace(other)


def test_what_skin_near_a_bend_is_off_by_is_no_noise_of_calm_skin(arm):
    sample, rng = sample_skin(arm), np.random.default_rng(1)
    index, calm = sample.vertices, 0.001
    near = trust(arm, elbow_flexion=60.0)[index]
    off = rng.normal(0.0, calm, len(arm.skin_vertices))[index] + 0.003 * (near < 0.5)
    blank = np.zeros((len(index), 3))
    doubted, believed = (
        patch_noise(arm, [Correspondences(index, blank, blank, off, weight)], sample, 0.0)
        for weight in (near, np.ones(len(index)))
    )
    assert doubted < 0.7 * believed
    apart = np.full((1, len(arm.skin_vertices)), np.nan)
    apart[0, index] = off
    weights = np.ones((1, len(arm.skin_vertices)))
    weights[0, index] = near
    assert patch_misfit(arm, apart, weights, sample)[0] <= patch_misfit(arm, apart, np.ones_like(apart), sample)[0]


def test_the_judge_hears_less_of_skin_near_a_bend(limb, sample, monkeypatch):
    bent = int(limb.thetas[:, limb.subject.anatomy.coordinate_index("elbow_flexion")].argmax())
    body, target, theta = limb.subject.body, limb.targets[bent], limb.thetas[bent]
    near = bend_trust(body, theta) < 0.5
    swollen = make_body(body.anatomy, shape=body.shape, v_hat=body.v_hat * (1.0 + 0.05 * near[:, None]))
    heard = find_skin(swollen, target, theta, sample).whole.skin_m
    monkeypatch.setattr("adapt.search.pose_score.bend_trust", lambda _, __, vertices: np.ones(len(vertices)))
    assert heard < find_skin(swollen, target, theta, sample).whole.skin_m


def test_a_journal_of_before_trust_was_written_down_is_read(tmp_path):
    matches = {"vertex": [3, 5], "target": np.zeros((2, 3)), "normal": np.zeros((2, 3)), "distance": [0.0, 0.0]}
    found = {"skin_m": 0.0, "cloud_m": 0.0, "coverage": 1.0, "merged_outline": 0.0, "free_space": 0.0}
    journal = resume_journal(tmp_path / "adapt.journal", "0" * 64)
    fit = {"theta": np.zeros(10), "distances": np.zeros(2), "matches": matches}
    journal.append({"search": "instant 0", "pose": {"fit": fit, **found}})
    again = FoundPoses(resume_journal(tmp_path / "adapt.journal", "0" * 64))
    pose = again.find("instant 0", lambda: pytest.fail("it was found before"))
    np.testing.assert_array_equal(pose.fit.matches.trust, [1.0, 1.0])
