"""The noise model does what the papers say, and nothing where it is told not to."""

from __future__ import annotations

import numpy as np
import pytest

from capture.simulation.sensor import NoiseModel, carmine, carmine_camera, observe

CAMERA = carmine_camera()
SHAPE = (CAMERA.height, CAMERA.width)
NO_SHADOW = np.zeros(SHAPE, dtype=bool)


def plane(depth_m: float, angle_deg: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Depth and cosine images of an even surface."""
    return (
        np.full(SHAPE, depth_m, dtype=np.float32),
        np.full(SHAPE, np.cos(np.deg2rad(angle_deg)), dtype=np.float32),
    )


def seen(depth: np.ndarray, cos: np.ndarray, noise: NoiseModel | None = None, *, seed: int = 0) -> np.ndarray:
    """Observed depth in metres."""
    image = observe(depth, cos, NO_SHADOW, CAMERA, noise or carmine(), np.random.default_rng(seed))
    assert image.dtype == np.uint16
    return image / 1000.0


def two_steps() -> tuple[np.ndarray, np.ndarray]:
    """A surface at 1 m on the left, one at 1.5 m in the middle, nothing on the right."""
    depth, cos = plane(1.0)
    depth[:, 200:400], depth[:, 400:] = 1.5, 0.0
    cos[:, 400:] = 0.0
    return depth, cos


def test_without_noise_the_exact_depth_is_rounded_to_the_unit() -> None:
    rng = np.random.default_rng(1)
    depth = rng.uniform(0.5, 3.0, SHAPE).astype(np.float32)
    image = observe(depth, np.ones(SHAPE, np.float32), NO_SHADOW, CAMERA, NoiseModel(), rng)
    assert np.abs(image / 1000.0 - depth).max() < 0.000501
    tenths = observe(depth, np.ones(SHAPE, np.float32), NO_SHADOW, CAMERA, NoiseModel(), rng, depth_unit_m=0.0001)
    assert np.abs(tenths / 10000.0 - depth).max() < 0.0000502


@pytest.mark.parametrize("depth_m", [0.6, 1.2, 2.0])
def test_the_spread_of_a_frontal_plane_is_what_nguyen_measured(depth_m: float) -> None:
    measured = seen(*plane(depth_m))
    expected = 0.0012 + 0.0019 * (depth_m - 0.4) ** 2
    step = depth_m**2 / 8.0 / (CAMERA.fx * 0.075)
    # Where a quantisation step is wider than the noise, it alone sets the spread.
    assert measured.std() == pytest.approx(max(expected, step / np.sqrt(12.0)), rel=0.1)
    assert abs(measured.mean() - depth_m) < 0.001


def test_noise_grows_at_grazing_angles() -> None:
    frontal, at_60, at_74 = (float(seen(*plane(1.2, angle)).std()) for angle in (0.0, 60.0, 74.0))
    assert frontal < at_60 < at_74
    assert at_74 > 1.4 * frontal


def test_disparity_comes_in_eighths_of_a_pixel() -> None:
    values = np.unique(seen(*plane(1.2)))
    disparities = CAMERA.fx * 0.075 / values * 8.0
    assert len(values) < 12
    # Half a millimetre of rounding is 0.15 of a step at this depth.
    assert np.abs(disparities - np.rint(disparities)).max() < 0.16


def test_errors_of_neighbouring_pixels_hang_together_and_those_of_distant_ones_do_not() -> None:
    error = seen(*plane(1.2)) - 1.2
    error -= error.mean()

    def correlation(shift: int) -> float:
        return float((error[:, shift:] * error[:, :-shift]).mean() / error.var())

    assert correlation(1) > 0.5
    assert abs(correlation(12)) < 0.05


def test_grazing_surfaces_are_lost_little_by_little() -> None:
    lost = [float((seen(*plane(1.2, angle)) == 0.0).mean()) for angle in (70.0, 78.0, 82.0, 86.0)]
    assert lost[0] == 0.0
    assert 0.0 < lost[1] < lost[2] < 1.0
    assert lost[3] == 1.0


def test_shadowed_pixels_have_no_depth() -> None:
    depth, cos = plane(1.2)
    shadow = NO_SHADOW.copy()
    shadow[100:200, 300:400] = True
    image = observe(depth, cos, shadow, CAMERA, carmine(), np.random.default_rng(0))
    assert np.array_equal(image == 0, shadow)


def test_only_edges_are_ragged_and_they_stay_within_a_few_pixels() -> None:
    depth, cos = two_steps()
    measured = seen(depth, cos)
    wrong = np.abs(measured - depth) > 0.02
    columns = np.flatnonzero(wrong.any(axis=0))
    assert len(columns) > 0
    distance = np.minimum(np.abs(columns - 199.5), np.abs(columns - 399.5))
    assert distance.max() < 6.0


def test_edges_move_by_about_the_published_lateral_error() -> None:
    depth, cos = two_steps()
    nearer = (seen(depth, cos) > 0.0) & (seen(depth, cos) < 1.2)
    edge = np.array([row[:300].nonzero()[0].max() for row in nearer])
    assert 0.3 < edge.std() < 1.6
    assert abs(edge.mean() - 199.5) < 1.5


def test_flying_pixels_hang_between_two_surfaces_and_fall_a_little_behind_a_free_edge() -> None:
    depth, cos = two_steps()
    measured = seen(depth, cos)
    between = measured[:, 190:210]
    assert ((between > 1.05) & (between < 1.45)).any()
    behind = measured[:, 390:410]
    assert behind.max() > 1.5 + 3.0 * 0.0035
    assert behind.max() < 1.5 + 0.02 + 5.0 * 0.0035


def test_depth_out_of_range_is_not_measured() -> None:
    assert not seen(*plane(0.3)).any()
    assert not seen(*plane(3.2)).any()


def test_scaling_to_nothing_leaves_the_exact_depth_and_doubling_doubles_the_noise() -> None:
    depth, cos = two_steps()
    assert np.abs(seen(depth, cos, carmine().scaled(0.0)) - depth).max() < 0.000501
    once, twice = (seen(*plane(1.2), carmine().scaled(k)).std() for k in (1.0, 2.0))
    assert twice == pytest.approx(2.0 * once, rel=0.1)
    assert carmine().scaled(1.0) == carmine()
    assert carmine().scaled(10.0).edge_drop_probability == 1.0


def test_the_same_seed_gives_the_same_image_and_another_seed_another() -> None:
    depth, cos = two_steps()
    assert np.array_equal(seen(depth, cos, seed=5), seen(depth, cos, seed=5))
    assert not np.array_equal(seen(depth, cos, seed=5), seen(depth, cos, seed=6))
