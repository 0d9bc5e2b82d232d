"""Whatever a sensor delivers, what leaves ``fuse`` is finite."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from capture.camera import Camera
from capture.cloud.fuse import View, view_points
from capture.cloud.patches import fit_patches, fit_patches_by_arrays
from capture.cloud.preprocess import clean_depth
from capture.recording import Region
from tests.analytic_depth import sphere

EVERYWHERE = Region(np.full(3, -20.0), np.full(3, 20.0))
CAMERA = Camera(80, 60, 285.0, 285.0, 39.5, 29.5)


def noisy(distance_m: float, noise_m: float, empty: float, seed: int) -> np.ndarray:
    random = np.random.default_rng(seed)
    depth = sphere(CAMERA, np.array([0.0, 0.0, 1.2 * distance_m]), 0.2 * distance_m)
    depth = np.where(depth > 0.0, depth + random.normal(0.0, noise_m, depth.shape), 0.0)
    depth[random.random(depth.shape) < empty] = 0.0
    return np.maximum(depth, 0.0).astype(np.float32)


@settings(max_examples=60, deadline=None)
@given(
    distance_m=st.floats(0.1, 6.0),
    noise=st.floats(0.0, 0.02),
    empty=st.floats(0.0, 0.95),
    cleaned=st.booleans(),
    seed=st.integers(0, 2**16),
)
def test_points_and_normals_are_finite_however_noisy_near_or_full_of_holes_a_depth_image_is(
    distance_m, noise, empty, cleaned, seed
):
    depth = noisy(distance_m, noise * distance_m, empty, seed)
    view = View("s", CAMERA, np.eye(4), clean_depth(depth, CAMERA) if cleaned else depth)
    points, normals, _ = view_points(view, EVERYWHERE, spacing_m=0.005 * distance_m)
    assert np.isfinite(points).all()
    assert np.allclose(np.linalg.norm(normals, axis=1), 1.0)
    assert (np.einsum("ij,ij->i", points, normals) < 0.0).all()  # they face the sensor


def test_a_near_and_noisy_surface_keeps_its_place_and_both_ways_to_fit_it_agree():
    depth = noisy(0.35, 0.003, 0.0, 1)
    pixels = np.argwhere(depth > 0.0)
    compiled = fit_patches(depth, pixels, radius_px=4, focal_px=CAMERA.fx)
    by_arrays = fit_patches_by_arrays(depth, pixels, radius_px=4, focal_px=CAMERA.fx)
    assert np.isfinite(compiled).all()
    assert np.median(np.abs(compiled[:, 0] - by_arrays[:, 0])) < 1e-6
    inner = np.hypot(*(pixels - (29.5, 39.5)).T) < 25.0
    true = sphere(CAMERA, np.array([0.0, 0.0, 0.42]), 0.07)[tuple(pixels[inner].T)]
    z0 = depth[tuple(pixels[inner].T)]
    assert np.median(np.abs(z0 / (1.0 - compiled[inner, 0] / z0) - true)) < 0.0015
