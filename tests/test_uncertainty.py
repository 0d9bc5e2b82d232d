"""Stated deviations: what moves a best pose, how sure a body is, and that errors come out as often as claimed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pytest

from adapt.anatomy import Floats
from adapt.fit import alternate
from adapt.fit.alternate import adapt_body
from adapt.fit.least_squares import levenberg_marquardt
from adapt.fit.noise import patch_noise, trusted
from adapt.fit.pose import PoseEnergy, PoseFit, fit_pose
from adapt.fit.posterior import OF_PEOPLE, body_covariance, pose_covariance, pose_sensitivity, unseen_noise
from adapt.fit.problem import CERTAINTY_PLANE_WEIGHT, PATCH_M2
from adapt.match.correspondences import Correspondences
from adapt.match.skin_sample import SkinSample, sample_skin
from adapt.model.body import Body, make_body, pose_skin
from adapt.model.shape.prior import shape_prior
from adapt.subject import Subject
from adapt.tissue import tissue_field
from tests.known_limb import bent


@pytest.fixture(scope="module")
def sample(arm) -> SkinSample:
    return sample_skin(arm, at_most=1500)


@pytest.fixture(scope="module")
def covariance(limb) -> Floats:
    """How sure a body is that was adapted to four frames of the recording, without error."""
    whole = sample_skin(limb.subject.anatomy)
    fits = [fit_pose(limb.subject.body, limb.targets[k], limb.thetas[k], whole, updates=1) for k in (0, 3, 6, 9)]
    return body_covariance(limb.subject.body, fits, noise_m=0.0015)


@dataclass(frozen=True)
class Seen:
    """A pose, and the front of its skin seen without error."""

    body: Body
    theta: Floats
    matches: Correspondences

    def refitted(self, body: Body, sample: SkinSample, *, shift: Floats | float = 0.0) -> PoseFit:
        """Where another body comes to rest on the same skin, moved by ``shift`` (M,) along its normals."""
        target = self.matches.target + np.asarray(shift)[..., None] * self.matches.normal
        matches = replace(self.matches, target=target)
        weights = sample.counts(matches)
        energy = PoseEnergy(body, matches, weights, None, CERTAINTY_PLANE_WEIGHT)
        theta = levenberg_marquardt(energy.quadratic, self.theta, steps=8, tolerance=1e-12, energy=energy.value)
        apart = pose_skin(body, theta, vertices=matches.vertex) - target
        return PoseFit(theta, matches, np.einsum("ij,ij->i", matches.normal, apart))


def seen(body: Body, theta: Floats, sample: SkinSample) -> Seen:
    skin = pose_skin(body, theta)
    normals = sample.normals(skin)
    front = sample.vertices[normals[sample.vertices] @ [0.8, 0.0, 0.6] > 0.1]
    return Seen(
        body, theta, Correspondences(front, skin[front], normals[front], np.zeros(len(front)), np.ones(len(front)))
    )


def other_body(body: Body, change: Floats) -> Body:
    """The body with its shape and its soft tissue (m + q,) changed."""
    m, tissue = len(body.shape), tissue_field(body.anatomy)
    return make_body(body.anatomy, shape=body.shape + change[:m], v_hat=body.v_hat + tissue.displacement(change[m:]))


@pytest.mark.parametrize(("elbow", "twist"), [(30.0, 0.0), (95.0, 40.0)])
def test_the_lever_is_how_a_changed_body_moves_its_best_pose(arm, sample, elbow, twist):
    rng = np.random.default_rng(7)
    pose = seen(make_body(arm), bent(make_body(arm), elbow, twist), sample)
    fit = PoseFit(pose.theta, pose.matches, pose.matches.distance)
    lever = pose_sensitivity(pose.body, fit, sample, with_tissue=True).by_body
    m, q = len(pose.body.shape), tissue_field(arm).modes.shape[1]
    of_shape, of_tissue = 1e-3 * np.r_[rng.normal(size=m), np.zeros(q)], 0.05 * np.r_[np.zeros(m), rng.normal(size=q)]
    # The tissue is taken to grow along the posed skin's normals, which the deformers do not quite keep.
    for change, share in ((of_shape, 0.01), (of_tissue, 0.05)):
        one, other = (pose.refitted(other_body(pose.body, sign * change), sample).theta for sign in (1.0, -1.0))
        expected = lever @ change
        assert np.abs(expected).max() > 5e-4
        np.testing.assert_allclose(0.5 * (one - other), expected, atol=share * np.abs(expected).max())


def test_a_bodys_covariance_is_positive_and_smaller_than_what_was_known_before(limb, covariance):
    body = limb.subject.body
    m = len(body.shape)
    np.testing.assert_array_equal(covariance, covariance.T)
    assert (np.linalg.eigvalsh(covariance) > 0.0).all()
    by_noise = covariance / OF_PEOPLE**2
    before = np.linalg.inv(shape_prior(body.anatomy, body.affine).precision)
    assert np.diag(by_noise)[:m].sum() < 0.5 * np.diag(before).sum()
    assert (np.diag(by_noise)[m:] <= 1.0 + 1e-9).all()
    assert np.diag(by_noise)[m:].min() < 0.5


def test_a_body_is_less_sure_the_noisier_its_clouds_are(limb, covariance):
    whole = sample_skin(limb.subject.anatomy)
    fits = [fit_pose(limb.subject.body, limb.targets[k], limb.thetas[k], whole, updates=1) for k in (0, 3, 6, 9)]
    noisier = body_covariance(limb.subject.body, fits, noise_m=0.003)
    assert (np.linalg.eigvalsh(noisier - covariance) > -1e-9).all()
    assert np.trace(noisier) > 1.1 * np.trace(covariance)


def test_unseen_noise_is_that_of_the_clouds_and_none_without_any(limb):
    body = limb.subject.body
    assert unseen_noise(body, []) is None
    exact = unseen_noise(body, [(limb.targets[k], limb.thetas[k]) for k in (1, 5)])
    assert exact is not None
    assert exact < 0.0012
    thicker = other_body(body, np.r_[np.zeros(len(body.shape)), 0.7 * np.ones(150)])
    worse = unseen_noise(thicker, [(limb.targets[k], limb.thetas[k]) for k in (1, 5)])
    assert worse is not None
    assert worse > exact


def test_a_poses_covariance_is_positive_and_grows_with_the_tissues(limb, covariance):
    sample = sample_skin(limb.subject.anatomy, at_most=1500)
    fit = fit_pose(limb.subject.body, limb.targets[2], limb.thetas[2], sample)
    m = len(limb.subject.body.shape)
    both = pose_covariance(replace(limb.subject, covariance=covariance), fit, sample)
    shape_alone = pose_covariance(replace(limb.subject, covariance=covariance[:m, :m]), fit, sample)
    for stated in (both, shape_alone):
        np.testing.assert_array_equal(stated, stated.T)
        assert (np.linalg.eigvalsh(stated) > 0.0).all()
    assert np.sqrt(np.diag(both)[6:]).max() > 1.2 * np.sqrt(np.diag(shape_alone)[6:]).min()


def test_a_pose_that_rests_on_a_few_scattered_matches_is_unsure_and_not_without_deviation(limb, covariance):
    sample = sample_skin(limb.subject.anatomy, at_most=1500)
    fit = fit_pose(limb.subject.body, limb.targets[2], limb.thetas[2], sample)
    matches = fit.matches.at(slice(None, None, len(fit.matches) // 30))
    known = replace(limb.subject, covariance=covariance)
    sure, unsure = (
        np.diag(pose_covariance(known, f, sample)) for f in (fit, PoseFit(fit.theta, matches, matches.distance))
    )
    assert np.isfinite(unsure).all()
    assert (unsure > sure).all()


def z_scores(limb, covariance: Floats, stated_covariance: Floats, *, draws: int = 60) -> Floats:
    """Errors in stated deviations (draws, n) of bodies drawn from ``covariance``, on skin with noisy patches."""
    rng, body = np.random.default_rng(11), limb.subject.body
    sample = sample_skin(body.anatomy, at_most=1500)
    pose = seen(body, bent(body, 70.0, 20.0), sample)
    cubes = np.floor(body.anatomy.skin_vertices[pose.matches.vertex] / np.sqrt(PATCH_M2)).astype(int)
    _, patch = np.unique(cubes, axis=0, return_inverse=True)
    factor, z = np.linalg.cholesky(covariance), []
    for _ in range(draws):
        wrong = other_body(body, factor @ rng.normal(size=len(covariance)))
        shift = 0.0012 * rng.normal(size=patch.max() + 1)[patch.ravel()]
        fit = pose.refitted(wrong, sample, shift=shift)
        known = Subject(wrong, limb.subject.thetas, limb.subject.times, stated_covariance, {})
        z.append((fit.theta - pose.theta) / np.sqrt(np.diag(pose_covariance(known, fit, sample))))
    return np.array(z)


def test_errors_come_out_as_often_as_their_deviations_claim(limb, covariance):
    z = z_scores(limb, covariance, covariance)
    spread = np.sqrt((z**2).mean(axis=0))
    assert ((spread > 0.7) & (spread < 1.3)).all(), spread
    assert 0.90 < (np.abs(z) < 2.0).mean() < 0.98
    assert 0.60 < (np.abs(z) < 1.0).mean() < 0.76


def test_without_the_tissue_they_would_claim_too_much(limb, covariance):
    m = len(limb.subject.body.shape)
    z = z_scores(limb, covariance, covariance[:m, :m], draws=30)
    assert np.sqrt((z**2).mean()) > 1.15  # 1.19 with this arm


def test_noise_that_hangs_together_over_more_than_a_patch_counts_as_much_as_it_moves_bones(limb):
    anatomy, rng = limb.subject.anatomy, np.random.default_rng(3)
    sample = sample_skin(anatomy)
    index = sample.vertices
    blank, calm = np.zeros((len(index), 3)), np.ones(len(index))

    def noise_of(side_m: float, deviation_m: float) -> float:
        cubes = np.unique(np.floor(anatomy.skin_vertices[index] / side_m).astype(int), axis=0, return_inverse=True)[1]
        matches = [
            Correspondences(index, blank, blank, deviation_m * rng.normal(size=cubes.max() + 1)[cubes.ravel()], calm)
            for _ in range(12)
        ]
        return patch_noise(anatomy, matches, sample, 0.0)

    apart, together = noise_of(0.03, 0.0012), noise_of(0.06, 0.0012)
    assert 0.0010 < apart < 0.0016
    assert together > 1.4 * apart


def test_a_body_is_adapted_by_the_noise_of_clouds_that_it_was_not_adapted_to(limb, monkeypatch):
    trusts = []
    monkeypatch.setattr(
        alternate, "trusted", lambda sample, noise_m: trusts.append(noise_m) or trusted(sample, noise_m)
    )
    frames = [0, 3, 6, 9]
    targets, thetas = [limb.targets[k] for k in frames], limb.thetas[frames]
    monkeypatch.setattr(alternate, "unseen_noise", lambda *_: 0.0031)
    found = adapt_body(limb.subject.body, targets, thetas, outer_rounds=2, unseen=[(targets[0], thetas[0])])
    assert trusts[-1] == found.unseen_noise_m == 0.0031
    assert found.noise_m < 0.0031


def test_bones_under_a_sleeve_are_no_surer_than_bones_under_bare_skin(limb):
    """The skin takes the sleeve up, so that nothing of it is left in the noise."""
    targets, thetas = limb.targets[:2], limb.thetas[:2]
    adapt = partial(adapt_body, limb.subject.body, targets, thetas, outer_rounds=1, optimise_skin=False)
    bare, sleeved = adapt(), adapt(by_proportions_m=0.004)
    wider = np.diag(sleeved.covariance) / np.diag(bare.covariance)
    assert (wider > 1.0 - 1e-9).all()
    assert wider.max() > 2.0
