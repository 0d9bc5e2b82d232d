"""Algorithm 1: the pose of one body in one cloud (paper, section 3.3)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from adapt.anatomy import Floats
from adapt.fit.least_squares import levenberg_marquardt
from adapt.fit.priors import held_term, range_term
from adapt.fit.problem import PLANE_WEIGHT, Quadratic, data_energy, data_term, gaussian_term
from adapt.match.bending_skin import bend_trust
from adapt.match.correspondences import GATE_M, Correspondences, Target, find_corres
from adapt.match.skin_sample import SkinSample
from adapt.model.body import Body, pose_skin, pose_skin_varying
from adapt.model.pose_space import wrap
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

    @property
    def residual_m(self) -> float:
        """Median distance between skin and cloud over the matched vertices."""
        return float(np.median(np.abs(self.distances)))


@dataclass(frozen=True)
class PoseEnergy:
    """What a pose costs for given matches: the data, the joint ranges and, if there is one, the prior."""

    body: Body
    matches: Correspondences
    weights: Floats  # (M,) of the matches
    prior: GaussianPose | None
    plane_weight: float = PLANE_WEIGHT

    def quadratic(self, theta: Floats) -> Quadratic:
        """The cost (n parameters) with its derivatives."""
        skin = pose_skin_varying(self.body, theta, vertices=self.matches.vertex)
        data = data_term(skin, self.matches, self.weights, plane_weight=self.plane_weight)
        return data + self._expected(theta)

    def value(self, theta: Floats) -> float:
        """The cost alone."""
        skin = pose_skin(self.body, theta, vertices=self.matches.vertex)
        data = data_energy(skin, self.matches, self.weights, plane_weight=self.plane_weight)
        return data + self._expected(theta).energy

    def _expected(self, theta: Floats) -> Quadratic:
        limits = range_term(self.body.anatomy, theta) + held_term(self.body, theta)
        return limits if self.prior is None else limits + gaussian_term(theta, self.prior.mean, self.prior.precision)


def fit_pose(
    body: Body,
    target: Target,
    theta: Floats,
    sample: SkinSample,
    *,
    updates: int = 12,
    steps: int = 3,
    gate_m: float = GATE_M,
    still: float = _STILL_RAD_OR_M,
    prior: GaussianPose | None = None,
    plane_weight: float = PLANE_WEIGHT,
) -> PoseFit:
    """Pose ``body`` into the cloud from the start ``theta`` (n,).

    Each of at most ``updates`` rounds finds correspondences, then takes Levenberg-Marquardt steps. The gate
    closes as the fit improves, so that late rounds rest on sure matches only. It stops early when no coordinate moves
    by ``still`` (rad, m) any more.

    Raises:
        FitError: fewer than 30 skin vertices find a target.
    """
    matches = match_pose(body, target, theta, sample, gate_m=gate_m)
    for _ in range(updates):
        before = theta
        energy = PoseEnergy(body, matches, sample.counts(matches), prior, plane_weight)
        theta = levenberg_marquardt(energy.quadratic, theta, steps=steps, energy=energy.value)
        matches = match_pose(body, target, theta, sample, gate_m=next_gate(matches, gate_m))
        if np.abs(theta - before).max() < still:
            break
    theta = wrap(body.anatomy, theta)  # only now: inside the loop it would leave the prior's mean a turn away
    return PoseFit(theta, matches, matches.distance)


def match_pose(body: Body, target: Target, theta: Floats, sample: SkinSample, *, gate_m: float) -> Correspondences:
    """Correspondences of the body posed by ``theta``, as trusted as that pose allows; FitError if fewer than 30."""
    skin = pose_skin(body, theta)
    matches = find_corres(target, skin, sample.normals(skin), sample.vertices, gate_m=gate_m)
    matches = replace(matches, trust=bend_trust(body, theta, matches.vertex))
    if len(matches) < _FEWEST_MATCHES:
        raise FitError(
            f"only {len(matches)} skin vertices have a point of the cloud within {100 * gate_m:.1f} cm",
            remedy="check the region of interest or give a first pose",
        )
    return matches


def next_gate(matches: Correspondences, widest_m: float) -> float:
    """A gate (m) of four robust standard deviations of what the matches disagree by, along the normal.

    >>> apart = np.array([-0.004, 0.002, 0.03])
    >>> far = Correspondences(np.arange(3), np.zeros((3, 3)), np.zeros((3, 3)), apart, np.ones(3))
    >>> round(next_gate(far, 0.1), 4), next_gate(far, 0.02)
    (0.0237, 0.02)
    """
    return float(np.clip(4.0 * 1.48 * np.median(np.abs(matches.distance)), _TIGHTEST_GATE_M, widest_m))
