"""How sure the joints' centres are, by what a subject and a fitted pose state: coordinates alone do not say it.

With what moves a best pose, d theta = e + B d beta (see ``adapt.fit.posterior``), a centre c(theta, shape) has

    C = J_theta E J_theta^T + (J_theta B + J_beta) S (J_theta B + J_beta)^T,

E the covariance of e, S that of beta = (shape, tissue), and J_beta zero for tissue. Derivatives are differences.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from adapt.anatomy import Floats
from adapt.fit.noise import patch_noise
from adapt.fit.pose import PoseFit
from adapt.fit.posterior import pose_sensitivity
from adapt.fit.problem import SIGMA_M
from adapt.match.skin_sample import SkinSample
from adapt.model.body import Body, joint_centres, make_body
from adapt.subject import Subject

_STEP = 1e-5


def centre_deviations(subject: Subject, fit: PoseFit, sample: SkinSample) -> dict[str, Floats]:
    """One standard deviation (3,) m of every joint's centre along the axes of the recording's frame."""
    body, m = subject.body, len(subject.body.shape)
    pose = pose_sensitivity(body, fit, sample, with_tissue=len(subject.covariance) > m)
    noise_m = patch_noise(subject.anatomy, [fit.matches], sample, len(fit.theta))
    by_noise = (noise_m / SIGMA_M) ** 2 * pose.by_noise
    by_theta = _differences(lambda x: _centres(body, x), fit.theta)
    by_shape = _differences(
        lambda x: _centres(make_body(body.anatomy, shape=x, v_hat=body.v_hat), fit.theta), body.shape
    )
    by_body = by_theta @ pose.by_body
    by_body[:, :m] += by_shape
    covariance = by_theta @ by_noise @ by_theta.T + by_body @ subject.covariance @ by_body.T
    deviations = np.sqrt(np.diag(covariance)).reshape(-1, 3)
    return dict(zip(joint_centres(body, fit.theta), deviations, strict=True))


def _centres(body: Body, theta: Floats) -> Floats:
    return np.concatenate(list(joint_centres(body, theta).values()))


def _differences(f: Callable[[Floats], Floats], x: Floats) -> Floats:
    """The derivative (N, n) of f: (n,) -> (N,) at x, by central differences."""
    steps = _STEP * np.eye(len(x))
    return np.array([(f(x + step) - f(x - step)) / (2.0 * _STEP) for step in steps]).T
