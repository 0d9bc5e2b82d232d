"""Algorithm 1: the pose of one body in one cloud (paper, section 3.3)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.fit.correspondences import GATE_M, Correspondences, Target, find_corres
from adapt.fit.least_squares import Quadratic, data_term, gaussian_term, levenberg_marquardt
from adapt.fit.priors import range_term
from adapt.fit.sample import SkinSample
from adapt.model.body import Body, pose_skin, pose_skin_varying
from capture.errors import FitError

_TIGHTEST_GATE_M = 0.012
_FEWEST_MATCHES = 30
_STILL_RAD_OR_M = 1e-4  # a pose that moves less between two updates has converged


@dataclass(frozen=True)
class GaussianPose:
    """What is expected of a pose before the cloud is looked at: mean (n,) and precision (n, n)."""

    mean: Floats
    precision: Floats


@dataclass(frozen=True)
class PoseFit:
    """A fitted pose, the matches it rests on, and their distances along the normal (M,) in metres."""

    theta: Floats
    matches: Correspondences = field(repr=False)
    distances: Floats = field(repr=False)
    data_hessian: Floats = field(repr=False)  # (n, n) of the data alone, at theta

    @property
    def residual_m(self) -> float:
        """Median distance between skin and cloud over the matched vertices."""
        return float(np.median(np.abs(self.distances)))


def fit_pose(
    body: Body,
    target: Target,
    theta: Floats,
    sample: SkinSample,
    *,
    updates: int = 12,
    steps: int = 3,
    gate_m: float = GATE_M,
    prior: GaussianPose | None = None,
) -> PoseFit:
    """Pose ``body`` into the cloud from the start ``theta`` (n,).

    Each of at most ``updates`` rounds finds correspondences, then takes Levenberg-Marquardt steps. The gate
    closes as the fit improves, so that late rounds rest on sure matches only.

    Raises:
        FitError: fewer than 30 skin vertices find a target.
    """
    matches = match_pose(body, target, theta, sample, gate_m=gate_m)
    for _ in range(updates):
        before = theta
        theta = levenberg_marquardt(_energy(body, matches, sample, prior), theta, steps=steps)
        matches = match_pose(body, target, theta, sample, gate_m=next_gate(matches, gate_m))
        if np.abs(theta - before).max() < _STILL_RAD_OR_M:
            break
    theta = wrap(body.anatomy, theta)  # only now: inside the loop it would leave the prior's mean a turn away
    skin = pose_skin_varying(body, theta, vertices=matches.vertex)
    hessian = data_term(skin, matches, sample.observations[matches.vertex]).hessian
    return PoseFit(theta, matches, matches.distance, hessian)


def match_pose(body: Body, target: Target, theta: Floats, sample: SkinSample, *, gate_m: float) -> Correspondences:
    """Correspondences of the body posed by ``theta``. Raises FitError when there are fewer than 30."""
    skin = pose_skin(body, theta)
    matches = find_corres(target, skin, sample.normals(skin), sample.vertices, gate_m=gate_m)
    if len(matches) < _FEWEST_MATCHES:
        raise FitError(
            f"only {len(matches)} skin vertices have a point of the cloud within {100 * gate_m:.1f} cm",
            remedy="check the region of interest or give a first pose",
        )
    return matches


def next_gate(matches: Correspondences, widest_m: float) -> float:
    """A gate (m) of four robust standard deviations of what the matches disagree by, along the normal."""
    return float(np.clip(4.0 * 1.48 * np.median(np.abs(matches.distance)), _TIGHTEST_GATE_M, widest_m))


def wrap(anatomy: Anatomy, theta: Floats) -> Floats:
    """The same pose with free joints' rotation vectors no longer than pi, where they vary smoothly."""
    wrapped = theta.copy()
    for joint in anatomy.joints:
        if joint.type == "free":
            index = [anatomy.coordinate_index(name) for name in joint.coordinates[:3]]
            angle = float(np.linalg.norm(wrapped[index]))
            if angle > np.pi:
                wrapped[index] *= 1.0 - 2.0 * np.pi / angle
    return wrapped


def _energy(body: Body, matches: Correspondences, sample: SkinSample, prior: GaussianPose | None):  # type: ignore[no-untyped-def]
    weights = sample.observations[matches.vertex]

    def evaluate(theta: Floats) -> Quadratic:
        skin = pose_skin_varying(body, theta, vertices=matches.vertex)
        total = data_term(skin, matches, weights) + range_term(body.anatomy, theta)
        return total if prior is None else total + gaussian_term(theta, prior.mean, prior.precision)

    return evaluate
