"""What is known once the data are in: covariances of an adapted body and of a tracked pose, and what a pose tells.

At the best fit, x = [shape (m), tissue (q), theta_1, ..., theta_K] has the covariance H^-1, H being the normal matrix
of algorithm 2 with its priors.

- **The body.** The block of shape and tissue in the inverse has the poses integrated out (their Schur complement). The
  noise is that of clouds which the body was not adapted to: in its own clouds the skin has bent to the noise.
- **A tracked pose** t errs by the noise of its cloud, H_tt^-1, with H scaled by the noise of the very frame; distances
  of neighbouring vertices err alike, so it is the spread of patches' mean distances that counts (``noise``). And an
  error db of the body b makes the best pose err by -H_tt^-1 H_tb db: the *lever*. This part hardly changes from frame
  to frame, and no longer recording makes it smaller.

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
from adapt.fit.least_squares import CERTAINTY_PLANE_WEIGHT, SIGMA_M, data_term
from adapt.fit.never_seen import Bools, without
from adapt.fit.noise import patch_noise, trusted
from adapt.fit.pose import PoseFit, fit_pose
from adapt.fit.shape import ShapeEnergy, Unknowns, split_tissue
from adapt.match.correspondences import Correspondences, Target
from adapt.match.skin_sample import SkinSample, sample_skin, weighted_by_tissue
from adapt.model.body import Body, pose_skin_varying
from adapt.model.handles import local_scale
from adapt.model.shape.population import ANYBODY, Person
from adapt.subject import Subject
from adapt.tissue import tissue_field
from capture.errors import FitError

_SAMPLED_VERTICES = 2000
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
    covariance = np.linalg.inv(energy.quadratic(x).hessian)[: of.m + of.q, : of.m + of.q]
    return np.asarray(0.5 * (covariance + covariance.T))


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
    hessian = data_term(skin, fit.matches, sample.observations[fit.matches.vertex]).hessian
    n = len(fit.theta)
    pose = hessian[:n, :n] + 1e-6 * np.trace(hessian[:n, :n]) / n * np.eye(n)
    return np.asarray(hessian[n:, n:] - hessian[n:, :n] @ np.linalg.solve(pose, hessian[:n, n:]))


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
    matches = _every(step, fit.matches)
    index, weights = matches.vertex, step * sample.observations[matches.vertex]
    skin = pose_skin_varying(body, fit.theta, with_shape=True, vertices=index)
    hessian = data_term(skin, matches, weights, plane_weight=CERTAINTY_PLANE_WEIGHT).hessian
    cross = hessian[:n, n:]
    if with_tissue:
        along = np.matmul(matches.normal[:, None, :], skin.d[:, :, :n])[:, 0]
        grown = weights * local_scale(body.anatomy.skin_handle_weights[index], body.a) / SIGMA_M**2
        cross = np.hstack([cross, (grown[:, None] * along).T @ tissue_field(body.anatomy).modes[index]])
    by_noise: Floats = np.asarray(np.linalg.inv(hessian[:n, :n] + 1e-6 * np.eye(n)), dtype=np.float64)
    return PoseSensitivity(by_noise, -by_noise @ cross)


def _every(step: int, matches: Correspondences) -> Correspondences:
    """Each ``step``-th of the matches."""
    some = slice(None, None, step)
    return Correspondences(matches.vertex[some], matches.target[some], matches.normal[some], matches.distance[some])
