"""The pose of a limb that is being followed: from where it is expected to where it is.

A gate that closes around what most of the skin disagrees by shuts out a foot that has turned round faster than
expected: the rest of the leg fits, the foot's matches are dropped as strangers, and it stays behind. So the pose first
catches up under a gate wide enough for the fastest limb, in which a match counts the less the farther it lies apart,

    1 / (1 + |v - t|^2 / 1 cm^2)                                        (Cauchy's weight)

and only then settles under the closing gate of ``fit_pose``, on sure matches alone.
"""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Floats
from adapt.fit.least_squares import levenberg_marquardt
from adapt.fit.pose import GaussianPose, PoseEnergy, PoseFit, fit_pose, match_pose
from adapt.match.correspondences import Target
from adapt.match.skin_sample import SkinSample
from adapt.model.body import Body, pose_skin

_REACH_M = 0.08  # a toe at 30 frames a second turns round by less
_TRUSTED_M = 0.01
_ROUNDS = 8
_NEARLY_RAD_OR_M = 5e-3  # a pose that moves less between two rounds has caught up
_GATE_M = 0.03
_UPDATES = 12
_STILL_RAD_OR_M = 1e-3  # below what noise moves a pose by from frame to frame


def follow_pose(body: Body, target: Target, expected: GaussianPose, sample: SkinSample) -> PoseFit:
    """Pose ``body`` into the cloud from the mean of what is expected.

    Raises:
        FitError: fewer than 30 skin vertices find a target.
    """
    start = _caught_up(body, target, expected, sample)
    return fit_pose(
        body,
        target,
        start,
        sample,
        updates=_UPDATES,
        steps=1,
        gate_m=_GATE_M,
        still=_STILL_RAD_OR_M,
        prior=expected,
    )


def _caught_up(body: Body, target: Target, expected: GaussianPose, sample: SkinSample) -> Floats:
    theta = expected.mean
    for _ in range(_ROUNDS):
        before = theta
        matches = match_pose(body, target, theta, sample, gate_m=_REACH_M)
        apart = pose_skin(body, theta, vertices=matches.vertex) - matches.target
        trust = 1.0 / (1.0 + np.einsum("ij,ij->i", apart, apart) / _TRUSTED_M**2)
        energy = PoseEnergy(body, matches, trust * sample.counts(matches), expected)
        theta = levenberg_marquardt(energy.quadratic, theta, steps=1, energy=energy.value)
        if np.abs(theta - before).max() < _NEARLY_RAD_OR_M:
            break
    return theta
