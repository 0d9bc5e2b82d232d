"""How much skin and cloud disagree, learnt from the fit itself.

It decides how far the data may pull a body away from what is known of bodies beforehand: well-measured bare skin
deserves more trust than a sleeve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from adapt.anatomy import Anatomy, Floats, Ints
from adapt.fit.problem import PATCH_M2, SIGMA_M
from adapt.match.correspondences import Correspondences
from adapt.match.skin_sample import SkinSample

_WIDER = 2.0  # a sensor's noise hangs together over more than a patch: it counts as much as in patches so much wider
LEAST_M, _MOST_M = 0.00075, 0.004  # below and beyond these an estimate is not believed
_LEAST_SHARE = 0.3  # a patch of which less was matched says little


def patch_noise(anatomy: Anatomy, matches: Sequence[Correspondences], sample: SkinSample, parameters: float) -> float:
    """Standard deviation (m) of a patch's mean distance from the cloud, along the normal, over K poses.

    Patches are cubes of the rest skin with PATCH_M2 sides. Were their means independent, those of wider cubes would
    vary less by just as much as they are larger. Where they vary more, it is they that move a whole bone, and they
    count. ``parameters`` is how many of them the fit has used up: what it could bend to the data no longer shows in
    the distances. It is the noise of calm skin: patches near a bend count as much as they are trusted. Where too few
    vertices matched to fill a patch, nothing speaks against the most.
    """
    means, trust, _ = _patch_means(anatomy, matches, sample, 1.0)
    if not len(means):
        return _MOST_M
    free = max(trust.sum() - parameters, 0.1 * trust.sum())
    variance = (trust * means**2).sum() / free
    wide, trust, observations = _patch_means(anatomy, matches, sample, _WIDER)
    if trust.sum() > 2.0 * parameters:  # fewer tell more of the fit than of the noise
        variance = max(variance, (trust * observations * wide**2).sum() / (trust.sum() - parameters))
    return float(np.clip(np.sqrt(variance), LEAST_M, _MOST_M))


def patch_misfit(anatomy: Anatomy, apart: Floats, trust: Floats, sample: SkinSample) -> tuple[float, int]:
    """Root mean square (m) of patches' mean distances from K clouds, given vertex by vertex (K, V), and how many.

    Vertices count as they are trusted in each pose (K, V). NaN is what was not seen. A patch counts once, with the
    median over the poses in which it was seen: one pose that went astray does not decide.

    >>> from adapt.anatomy_file import load_anatomy
    >>> from adapt.match.skin_sample import sample_skin
    >>> arm = load_anatomy("upper-limb-right")
    >>> apart = np.full((2, len(arm.skin_vertices)), np.nan)
    >>> patch_misfit(arm, apart, np.ones_like(apart), sample_skin(arm))
    (0.0, 0)
    >>> apart[0] = 0.003  # one of two poses saw all of it
    >>> round(patch_misfit(arm, apart, np.ones_like(apart), sample_skin(arm))[0], 6)
    0.003
    """
    patch = _patches(anatomy, 1.0)
    means = np.full((len(apart), patch.max() + 1), np.nan)
    for mean, distance, trusted_by in zip(means, apart, trust, strict=True):
        seen = sample.observations * np.isfinite(distance)
        enough, weight = np.bincount(patch, seen) > _LEAST_SHARE, seen * trusted_by
        total = np.maximum(np.bincount(patch, weight), 1e-12)
        mean[enough] = (np.bincount(patch, weight * np.nan_to_num(distance)) / total)[enough]
    counted = np.isfinite(means).any(axis=0)
    if not counted.any():
        return 0.0, 0
    return float(np.sqrt((np.nanmedian(np.abs(means[:, counted]), axis=0) ** 2).mean())), int(counted.sum())


def _patch_means(
    anatomy: Anatomy, matches: Sequence[Correspondences], sample: SkinSample, wider: float
) -> tuple[Floats, Floats, Floats]:
    """Mean distances (N,) m of patches, so many times ``wider``, over all poses; their trust, their observations."""
    means, trust, observations = [], [], []
    for match in matches:
        patch, counts = _patches(anatomy, wider)[match.vertex], sample.counts(match)
        counted, total = np.bincount(patch, counts), np.bincount(patch, counts / match.trust)
        enough = total > _LEAST_SHARE * wider**2
        means.append((np.bincount(patch, counts * match.distance) / np.maximum(counted, 1e-12))[enough])
        trust.append((counted / np.maximum(total, 1e-12))[enough])
        observations.append(total[enough])
    return np.concatenate(means), np.concatenate(trust), np.concatenate(observations)


@lru_cache(maxsize=8)
def _patches(anatomy: Anatomy, wider: float) -> Ints:
    """The number (V,) of the patch that each skin vertex belongs to."""
    cubes = np.floor(anatomy.skin_vertices / (wider * np.sqrt(PATCH_M2))).astype(np.int64)
    return np.asarray(np.unique(cubes, axis=0, return_inverse=True)[1]).ravel()


def trusted(sample: SkinSample, noise_m: float) -> SkinSample:
    """The sample, each observation counted as one of standard deviation ``noise_m`` instead of SIGMA_M.

    >>> from adapt.anatomy_file import load_anatomy
    >>> from adapt.match.skin_sample import sample_skin
    >>> sample = sample_skin(load_anatomy("upper-limb-right"), at_most=10)
    >>> doubtful = trusted(sample, 2.0 * SIGMA_M)
    >>> round(float(sample.observations.sum() / doubtful.observations.sum()), 6)
    4.0
    """
    return replace(sample, observations=sample.observations * (SIGMA_M / noise_m) ** 2)
