"""How far a tracked pose may be off: from the noise of its cloud, and from what is not known of the body.

Near the best pose the data's energy is quadratic in the pose t and the body b = [shape, tissue's coefficients]:

- Noise of the cloud: H_tt^-1, with H scaled by the noise of the very frame. Distances of neighbouring vertices err
  alike, so it is the spread of patches' mean distances that counts (adapt.fit.noise), not that of the vertices.
- An error db of the body makes the best pose err by -H_tt^-1 H_tb db: the *lever*. This part hardly changes from frame
  to frame, and no longer recording makes it smaller.

What the motion prior adds is left out on purpose. A frame's error is mostly that of the body, which its predecessor
shared: agreeing with it is no evidence. The joints' ranges are left out, too: a pose beyond a range is rather wrong
than sure.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from adapt.anatomy import Floats
from adapt.fit.correspondences import Correspondences
from adapt.fit.least_squares import CERTAINTY_PLANE_WEIGHT, SIGMA_M, data_term
from adapt.fit.noise import patch_noise
from adapt.fit.pose import PoseFit
from adapt.fit.sample import SkinSample
from adapt.model.body import Body, pose_skin_varying
from adapt.model.handles import local_scale
from adapt.subject import Subject
from adapt.tissue import tissue_field

_ENOUGH = 400  # matches spread over the limb: with twice as many, deviations differ by 1 to 2 %


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
