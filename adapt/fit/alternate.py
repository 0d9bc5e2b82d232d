"""Algorithm 4: shape and poses, then the skin, and again (paper, section 3.3).

How far the data may pull the body away from what is known of bodies beforehand goes by the noise of clouds that it was
not adapted to, where there are any. In its own clouds the skin bends to the noise and then seems to fit better than it
does: a body adapted by that would be surer of them than its covariance, and farther off than it says.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from adapt.anatomy import Floats
from adapt.fit.never_seen import Bools, without
from adapt.fit.noise import LEAST_M, patch_noise, trusted
from adapt.fit.pose import PoseFit, fit_pose, match_pose
from adapt.fit.posterior import body_covariance, unseen_noise
from adapt.fit.problem import SIGMA_M
from adapt.fit.shape import fit_shape
from adapt.fit.skin import Factor, fit_skin
from adapt.match.correspondences import Correspondences, Target
from adapt.match.skin_sample import SkinSample, sample_skin, weighted_by_tissue
from adapt.model.body import Body
from adapt.model.shape.population import ANYBODY, Person
from adapt.stages import CERTAINTY, FINAL_POSES, ROUNDS, Progress

_OUTER_ROUNDS = 3
_SKIN_UPDATES = 3
_SKIN_GATE_M = 0.02
_TOGETHER = 2.0  # a sleeve is off alike along a whole bone: it counts as so many times what its patches show


@dataclass(frozen=True)
class Adaptation:
    """An adapted body, its K example poses and how well each is explained.

    ``noise_m`` is the standard deviation by which a patch of skin and the cloud still disagree, ``unseen_noise_m`` the
    same in clouds that the body was not adapted to, None where there were none.
    """

    body: Body
    fits: list[PoseFit]
    covariance: Floats = field(repr=False)  # (m + q, m + q) of shape and soft tissue
    noise_m: float
    unseen_noise_m: float | None

    @property
    def thetas(self) -> Floats:
        """Example poses (K, n)."""
        return np.array([fit.theta for fit in self.fits])


def adapt_body(
    body: Body,
    targets: list[Target],
    thetas: Floats,
    *,
    outer_rounds: int = _OUTER_ROUNDS,
    optimise_skin: bool = True,
    unseen: Sequence[tuple[Target, Floats]] = (),
    gone: Bools | None = None,
    by_proportions_m: float = 0.0,
    person: Person = ANYBODY,
    progress: Progress = lambda words, share: None,
) -> Adaptation:
    """Adapt ``body`` to K clouds from first poses ``thetas`` (K, n).

    ``unseen`` are further clouds with poses near theirs (n,): not adapted to, they tell how much to believe the others.
    Skin (V,) that is ``gone`` takes no part (see ``adapt.fit.never_seen``). ``by_proportions_m`` is how far patches of
    skin are from the clouds when proportions alone are fitted: what skin has to take up beyond the noise (clothes,
    tissue like nobody's) is not noise afterwards, but the bones under it are no surer for that. ``person``
    is what is said of whose body it is.

    Raises:
        FitError: a pose finds too few correspondences.
    """
    sample = sample_skin(body.anatomy) if gone is None else without(sample_skin(body.anatomy), gone)
    bony = weighted_by_tissue(sample, body.anatomy)
    noise_m = own_noise_m = SIGMA_M
    unseen_noise_m = None
    for outer in range(outer_rounds):
        progress(f"round {outer + 1} of {outer_rounds}: shape and poses", ROUNDS.at(2 * outer, 2 * outer_rounds))
        fitted = fit_shape(body, targets, thetas, trusted(bony, noise_m), person=person)
        body, thetas = fitted.body, fitted.thetas
        if not optimise_skin:
            continue  # what the skin alone could explain would pass for noise
        progress(f"round {outer + 1} of {outer_rounds}: skin", ROUNDS.at(2 * outer + 1, 2 * outer_rounds))
        body, matches = _skin_updates(body, targets, thetas, sample)
        own_noise_m = patch_noise(body.anatomy, matches, sample, fitted.parameters)
        unseen_noise_m = unseen_noise(body, unseen, gone)
        noise_m = own_noise_m if unseen_noise_m is None else unseen_noise_m
    progress("final poses", FINAL_POSES.begin)
    fits = [fit_pose(body, target, theta, sample) for target, theta in zip(targets, thetas, strict=True)]
    progress("how sure the body is", CERTAINTY.begin)
    if not optimise_skin:
        unseen_noise_m = unseen_noise(body, unseen, gone)
        noise_m = own_noise_m if unseen_noise_m is None else unseen_noise_m
    beyond_m = float(np.sqrt(max(0.0, by_proportions_m**2 - LEAST_M**2)))
    covariance = body_covariance(body, fits, noise_m=float(np.hypot(noise_m, _TOGETHER * beyond_m)), person=person)
    return Adaptation(body, fits, covariance, own_noise_m, unseen_noise_m)


def _skin_updates(
    body: Body, targets: list[Target], thetas: Floats, sample: SkinSample
) -> tuple[Body, list[Correspondences]]:
    """Algorithm 3 for the poses as they are: the body with its skin fitted, and the matches that it was fitted to."""
    factor = Factor()
    for _ in range(_SKIN_UPDATES):
        poses = zip(targets, thetas, strict=True)
        matches = [match_pose(body, target, theta, sample, gate_m=_SKIN_GATE_M) for target, theta in poses]
        body = fit_skin(body, thetas, matches, sample, factor=factor)
    return body, matches
