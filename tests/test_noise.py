"""How much skin and cloud disagree is learnt from the distances that a fit leaves."""

from __future__ import annotations

import numpy as np
import pytest

from adapt.fit.noise import patch_noise, trusted
from adapt.fit.problem import SIGMA_M
from adapt.match.correspondences import Correspondences
from adapt.match.skin_sample import sample_skin


def matches_with(arm, distances) -> Correspondences:
    n = len(arm.skin_vertices)
    return Correspondences(np.arange(n), arm.skin_vertices, np.tile([0.0, 0.0, 1.0], (n, 1)), distances, np.ones(n))


def patchwise(arm, size_m: float, seed: int):
    """Distances (V,) that are the same all over each 3 cm cube of the skin, normally distributed between cubes."""
    cubes = np.floor(arm.skin_vertices / 0.03).astype(int)
    _, patch = np.unique(cubes, axis=0, return_inverse=True)
    return np.random.default_rng(seed).normal(0.0, size_m, patch.max() + 1)[patch.ravel()]


@pytest.mark.parametrize("size_m", [0.001, 0.003])
def test_the_noise_of_patches_is_found_again(arm, size_m):
    sample = sample_skin(arm)
    matches = [matches_with(arm, patchwise(arm, size_m, seed)) for seed in range(4)]
    assert patch_noise(arm, matches, sample, 0.0) == pytest.approx(size_m, rel=0.1)


def test_noise_of_single_points_averages_out(arm):
    """0.8 mm is the least that is believed; points alone, even of 4 mm, do not go far beyond it."""
    distances = np.random.default_rng(0).normal(0.0, 0.004, len(arm.skin_vertices))
    assert patch_noise(arm, [matches_with(arm, distances)], sample_skin(arm), 0.0) < 0.0015


def test_what_the_fit_used_up_counts_as_noise(arm):
    sample, matches = sample_skin(arm), [matches_with(arm, patchwise(arm, 0.001, 5))]
    assert patch_noise(arm, matches, sample, 60.0) > 1.1 * patch_noise(arm, matches, sample, 0.0)


def test_observations_count_by_the_inverse_of_their_variance(arm):
    sample = sample_skin(arm)
    np.testing.assert_allclose(trusted(sample, 2.0 * SIGMA_M).observations, sample.observations / 4.0)
