"""How sure things are once the data are in: all covariances are made, widened and read here.

At the best fit, x = [shape (m), tissue (q), theta_1, ..., theta_K] has the covariance H^-1, H being the normal matrix
of algorithm 2 with its priors.

- **The body.** The block of shape and tissue in the inverse has the poses integrated out (their Schur complement). The
  noise is that of clouds which the body was not adapted to: in its own clouds the skin has bent to the noise.
- **A tracked pose** t errs by the noise of its cloud, H_tt^-1, with H scaled by the noise of the very frame; distances
  of neighbouring vertices err alike, so it is the spread of patches' mean distances that counts (``noise``). And an
  error db of the body b makes the best pose err by -H_tt^-1 H_tb db: the *lever*. This part hardly changes from frame
  to frame, and no longer recording makes it smaller.
- What the data leave open comes on top: coordinates that no bone in sight tells (``inflate_unobserved``), and what else
  is not known and moves the pose by a lever of its own (``inflate_by_lever``), as the velocity does where sensors did
  not look at once (``late_lever``).

When the skin slides along the cloud, the nearest points slide with it: that they lie near says next to nothing of where
along the surface a vertex is. So the planes alone count here (CERTAINTY_PLANE_WEIGHT), other than in fitting.

What the motion prior adds is left out on purpose. A frame's error is mostly that of the body, which its predecessor
shared: agreeing with it is no evidence. The joints' ranges are left out, too: a pose beyond a range is rather wrong
than sure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from adapt.anatomy import Floats
from adapt.fit.never_seen import Bools, without
from adapt.fit.noise import patch_noise, trusted
from adapt.fit.pose import PoseFit, fit_pose
from adapt.fit.problem import (
    CERTAINTY_PLANE_WEIGHT,
    SIGMA_M,
    Arrow,
    Unknowns,
    data_term,
    lever,
    marginal_covariance,
    schur_complement,
)
from adapt.fit.shape import ShapeEnergy, split_tissue
from adapt.match.correspondences import Correspondences, Target
from adapt.match.skin_sample import SkinSample, sample_skin, weighted_by_tissue
from adapt.model.body import Body, pose_skin_varying
from adapt.model.derivatives import Points
from adapt.model.handles import local_scale
from adapt.model.shape.population import ANYBODY, Person
from adapt.subject import Subject
from adapt.tissue import tissue_field
from capture.errors import FitError

OF_PEOPLE = 2.5
"""How many times as far off as the noise alone would have it a body is: people are not of our model's making. Set on
three people by MakeHuman, moved by its rigs, and looked at on three others: docs/uncertainty.md says what it covers."""
_SAMPLED_VERTICES = 2000
_UNTOLD = 1e-6  # of what a pose is told on average, it is taken to be told of everything
_ENOUGH = 400  # matches spread over the limb: with twice as many, deviations differ by 1 to 2 %


def body_covariance(body: Body, fits: Sequence[PoseFit], *, noise_m: float, person: Person = ANYBODY) -> Floats:
    """Covariance (m + q, m + q) of the shape and the tissue's coefficients of a body that was adapted to K clouds.

    ``fits`` are its poses there; ``noise_m`` is the standard deviation of a patch's distance from the cloud;
    ``person`` is what is said of whose body it is.
    """
    anatomy = body.anatomy
    fine, c = split_tissue(body, tissue_field(anatomy))
    of = Unknowns(len(body.shape), len(c), len(anatomy.coordinates))
    x = np.concatenate([body.shape, c, *(fit.theta for fit in fits)])
    sample = trusted(weighted_by_tissue(sample_skin(anatomy), anatomy), noise_m)
    matches = [fit.matches for fit in fits]
    energy = ShapeEnergy(body, fine, matches, sample, of, CERTAINTY_PLANE_WEIGHT, person)
    covariance = marginal_covariance(energy.quadratic(x).hessian, of.body)
    return np.asarray(OF_PEOPLE**2 * 0.5 * (covariance + covariance.T))


def with_other_prior(covariance: Floats, known: Floats, other: Floats) -> Floats:
    """The ``body_covariance`` (n, n) that the same data would have left with another prior than the ``known`` one.

    Both precisions (m, m) are those of the first m unknowns.

    >>> one = OF_PEOPLE**2 * np.array([[0.25]])
    >>> other = with_other_prior(one, np.array([[3.0]]), np.array([[1.0]]))  # the data's are 1
    >>> (other / OF_PEOPLE**2).tolist()
    [[0.5]]
    """
    m, information = len(known), np.linalg.inv(covariance)
    information[:m, :m] += (other - known) / OF_PEOPLE**2
    return np.asarray(np.linalg.inv(information))


def unseen_noise(body: Body, unseen: Sequence[tuple[Target, Floats]], gone: Bools | None = None) -> float | None:
    """The noise (m, see ``patch_noise``) in clouds that the body was not adapted to, from poses (n,) near theirs.

    The median over the clouds, for some of the poses may be wrong; None where no cloud can be posed. Skin (V,) that is
    ``gone`` takes no part.
    """
    sample, found = sample_skin(body.anatomy, at_most=_SAMPLED_VERTICES), []
    sample = sample if gone is None else without(sample, gone)
    for target, theta in unseen:
        try:
            fit = fit_pose(body, target, theta, sample)
        except FitError:
            continue
        found.append(patch_noise(body.anatomy, [fit.matches], sample, len(theta)))
    return float(np.median(found)) if found else None


def shape_information(body: Body, fit: PoseFit, sample: SkinSample) -> Floats:
    """What one fitted pose tells about the shape (m, m): H_ss - H_st H_tt^-1 H_ts."""
    skin = pose_skin_varying(body, fit.theta, with_shape=True, vertices=fit.matches.vertex)
    hessian = data_term(skin, fit.matches, sample.counts(fit.matches)).hessian
    n = len(fit.theta)
    hessian[:n, :n] += _UNTOLD * np.diag(hessian)[:n].mean() * np.eye(n)
    return schur_complement(hessian, slice(0, n))


@dataclass(frozen=True)
class PoseSensitivity:
    """What moves a best pose: covariance ``by_noise`` (n, n) for noise SIGMA_M, lever ``by_body`` (n, m [+ q])."""

    by_noise: Floats = field(repr=False)
    by_body: Floats = field(repr=False)


def pose_covariance(subject: Subject, fit: PoseFit, sample: SkinSample) -> Floats:
    """Covariance (n, n) of a fitted pose, (rad, m)^2."""
    with_tissue = len(subject.covariance) > len(subject.body.shape)
    pose = pose_sensitivity(subject.body, fit, sample, with_tissue=with_tissue)
    noise_m = patch_noise(subject.anatomy, [fit.matches], sample, len(fit.theta))
    covariance = (noise_m / SIGMA_M) ** 2 * pose.by_noise + pose.by_body @ subject.covariance @ pose.by_body.T
    return np.asarray(0.5 * (covariance + covariance.T))


def pose_sensitivity(body: Body, fit: PoseFit, sample: SkinSample, *, with_tissue: bool) -> PoseSensitivity:
    """How the best pose answers to noise and to the body, for the matches that it was fitted to.

    The soft tissue's columns take the posed skin's normals for the direction in which a vertex moves with its tissue.
    """
    n, step = len(fit.theta), max(1, len(fit.matches) // _ENOUGH)
    matches = fit.matches.at(slice(None, None, step))
    index, weights = matches.vertex, step * sample.counts(matches)
    modes = tissue_field(body.anatomy).modes[index] if with_tissue else np.zeros((len(index), 0))
    skin = pose_skin_varying(body, fit.theta, with_shape=True, vertices=index)
    grown = local_scale(body.anatomy.skin_handle_weights[index], body.a)[:, None] * matches.normal
    skin = Points(skin.value, np.concatenate([skin.d, grown[:, :, None]], axis=2))
    arrow = Arrow(Unknowns(len(body.shape), modes.shape[1], n), 1, modes)
    arrow.add_matches(0, np.arange(len(index)), skin, matches, weights, plane_weight=CERTAINTY_PLANE_WEIGHT)
    curvature, cross = arrow.of_pose(0)
    return PoseSensitivity(lever(curvature, np.eye(n)), -lever(curvature, cross))


def late_lever(
    body: Body, theta: Floats, sensors: Sequence[tuple[float, Correspondences]], sample: SkinSample
) -> Floats:
    """How far (n, n) (s) a pose (n,) is ahead of its instant, by velocity, from what each sensor matched and its delay.

    L = H^-1 sum over sensors of delay (s) times H_sensor, H being the sum of H_sensor: the curvature by its points.
    """
    n = len(theta)
    whole, moved = np.zeros((n, n)), np.zeros((n, n))
    for late_s, matches in sensors:
        skin = pose_skin_varying(body, theta, vertices=matches.vertex)
        part = data_term(skin, matches, sample.counts(matches), plane_weight=CERTAINTY_PLANE_WEIGHT).hessian
        whole, moved = whole + part, moved + late_s * part
    return lever(whole, moved)


def inflate_unobserved(covariance: Floats, guess: Floats) -> Floats:
    """The covariance (n, n) where some coordinates are guesses with standard deviations (n,), 0 for those that are not.

    >>> inflate_unobserved(np.full((2, 2), 1e-4), np.array([0.0, 0.5])).tolist()
    [[0.0001, 0.0], [0.0, 0.25]]
    """
    unknown = guess > 0.0
    told = covariance * ~(unknown[:, None] | unknown)
    return np.asarray(told + np.diag(guess**2))


def inflate_by_lever(covariance: Floats, by: Floats, deviation: Floats) -> Floats:
    """The covariance (n, n) once independent unknowns of standard deviations (k,) move things by the lever (n, k), too.

    >>> inflate_by_lever(np.eye(1), np.array([[2.0, 1.0]]), np.array([1.0, 3.0])).tolist()
    [[14.0]]
    """
    moved = by * deviation
    return np.asarray(covariance + moved @ moved.T)


def deviations(covariance: Floats) -> Floats:
    """Standard deviations (..., n) of covariances (..., n, n).

    >>> deviations(np.diag([4.0, 9.0])).tolist()
    [2.0, 3.0]
    """
    return np.asarray(np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1)))


def deviation_along(covariance: Floats, gradient: Floats) -> float:
    """Standard deviation of a number that changes with the first k of some unknowns by its gradient (k,).

    >>> deviation_along(np.diag([4.0, 9.0, 1.0]), np.array([1.0, 0.0]))
    2.0
    """
    k = len(gradient)
    return float(np.sqrt(np.maximum(gradient @ covariance[:k, :k] @ gradient, 0.0)))
