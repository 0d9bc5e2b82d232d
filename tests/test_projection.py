"""Points fall where OpenCV's lens model says, and nowhere where it says nothing."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from adapt.anatomy import Floats
from capture.calibration.box import _at_border
from capture.camera import DISTORTION_LENGTHS, Camera, ray_slopes
from capture.cloud.motion import gone_share
from capture.cloud.planes import Plane
from capture.projection import lens_of, pixel_within, pixels_in, pixels_within, project
from capture.simulation.ray_casting import _image_window
from track.view.render import render

PINHOLE = Camera(640, 480, 500.0, 510.0, 321.0, 238.0)
AZURE_KINECT = (0.5, -0.02, 2e-5, -7e-5, -0.003, 0.9, 0.08, -0.01)

coefficient = st.floats(-1.0, 1.0)


@st.composite
def cameras(draw: st.DrawFn) -> Camera:
    """A camera with as many coefficients as there can be, as large as those of real lenses or larger."""
    spread = np.array([0.5, 0.3, 0.01, 0.01, 0.2, 0.5, 0.3, 0.2, 0.01, 0.01, 0.01, 0.01, 0.1, 0.1])
    count = draw(st.sampled_from(DISTORTION_LENGTHS))
    size = draw(st.lists(coefficient, min_size=count, max_size=count))
    return replace(PINHOLE, distortion=tuple((spread[:count] * size).tolist()))


def points_before(seed: int, count: int = 200) -> Floats:
    """Points (N, 3) before a sensor, in its image and beside it."""
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.normal(0.0, 0.8, (count, 2)), np.ones(count)]) * rng.uniform(0.2, 4.0, (count, 1))


def by_opencv(camera: Camera, points: Floats) -> Floats:
    if not len(points):
        return np.zeros((0, 2))
    none = np.zeros(3)
    return cv2.projectPoints(points, none, none, camera.matrix, np.array(camera.distortion))[0].reshape(-1, 2)


@given(cameras(), st.integers(0, 1000))
@settings(deadline=None)
def test_points_fall_on_the_pixels_that_opencv_says(camera: Camera, seed: int) -> None:
    points = points_before(seed)
    pixels, z = project(camera, points)
    has_pixel = np.isfinite(pixels).all(axis=1)
    reach = np.hypot(*points[:, :2].T) / points[:, 2]
    np.testing.assert_array_equal(has_pixel, reach**2 <= lens_of(camera).furthest)
    expected = by_opencv(camera, points)[has_pixel]
    near = np.abs(expected).max(axis=1, initial=0.0) < 1e4  # just before a pole, rounding grows with the coordinate
    np.testing.assert_allclose(pixels[has_pixel][near], expected[near], rtol=0.0, atol=1e-9)
    np.testing.assert_array_equal(z, points[:, 2])


@given(cameras(), st.integers(0, 1000))
@settings(deadline=None)
def test_one_point_many_points_and_all_at_once_fall_on_the_same_pixels(camera: Camera, seed: int) -> None:
    points = points_before(seed) * np.where(np.arange(200) % 9 == 0, -1.0, 1.0)[:, None]
    shape, x, y, z = (camera.height, camera.width), *points.T.copy()
    row, column, inside = pixels_in(camera, points)
    assert 0.0 < inside.mean() < 1.0
    assert not inside[::9].any()
    expected = np.where(inside[:, None], np.column_stack([row, column]), -1)
    rows, columns = np.zeros((2, len(points)), dtype=np.int32)
    pixels_within(lens_of(camera), shape, x, y, z, rows, columns)
    np.testing.assert_array_equal(np.column_stack([rows, columns]), expected)
    one_by_one = [pixel_within(lens_of(camera), shape, *point) for point in points]
    np.testing.assert_array_equal(one_by_one, expected)


@given(cameras(), st.integers(0, 1000))
@example(replace(PINHOLE, distortion=(0.0, -0.139, 0.0, 0.0, -0.0078, 0.0, -0.0211, -0.0555)), 0)  # beyond its pole
@settings(deadline=None)
def test_as_far_as_a_lens_reaches_it_spreads_points_out(camera: Camera, seed: int) -> None:
    rng = np.random.default_rng(seed)
    reach = min(np.sqrt(lens_of(camera).furthest), 3.0)  # where it folds over is found to 0.6 %
    turn, slope = rng.uniform(0.0, 2.0 * np.pi, 200), 0.995 * reach * np.sqrt(rng.uniform(size=200))
    ray, step = np.column_stack([slope * np.cos(turn), slope * np.sin(turn), np.ones(200)]), 1e-6
    right, down = step * np.eye(3)[:2]
    here, right, down = (project(camera, there)[0] for there in (ray, ray + right, ray + down))
    u, v = right - here, down - here
    assert (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] > 0.0).all()


@pytest.mark.parametrize(
    ("distortion", "furthest"),
    [
        ((-0.2, 0.0, 0.0, 0.0), 1.0 / np.sqrt(3 * 0.2)),  # x (1 - 0.2 x^2) is largest there, and then comes back
        ((0.0, 0.0, 0.0, 0.05), 1.0 / (6 * 0.05)),  # so is -(x + 3 * 0.05 x^2), towards the left
        ((0.0, 0.0, 0.0, 0.0, 0.0, -0.5, 0.0, 0.0), np.sqrt(2.0)),  # 1 / (1 - 0.5 x^2) has its pole there
        ((0.0,) * 12 + (0.0, 0.9), 1.0 / np.tan(0.9)),  # a ray that runs along the tilted sensor
    ],
)
def test_a_lens_reaches_to_where_its_model_folds_over(distortion: tuple[float, ...], furthest: float) -> None:
    assert np.sqrt(lens_of(replace(PINHOLE, distortion=distortion)).furthest) == pytest.approx(furthest, rel=0.006)


def test_a_point_far_aside_does_not_come_back_into_the_image() -> None:
    """OpenCV's model turns it back: 1 - 0.2 x^2 is zero at x = 2.24, and projects onto the middle of the image."""
    barrel, aside = replace(PINHOLE, distortion=(-0.2, 0.0, 0.0, 0.0)), np.array([[2.236, 0.0, 1.0]])
    np.testing.assert_allclose(by_opencv(barrel, aside)[0], [321.0, 238.0], atol=1.0)
    assert np.isnan(project(barrel, aside)[0]).all()
    assert not pixels_in(barrel, aside)[2][0]
    assert pixel_within(lens_of(barrel), (480, 640), *aside[0]) == (-1, -1)


@pytest.mark.parametrize("distortion", [AZURE_KINECT, (-0.2, 0.05, 0.001, -0.002, 0.01)])
def test_a_lens_reaches_all_of_its_image(distortion: tuple[float, ...]) -> None:
    camera = replace(PINHOLE, distortion=distortion)
    rays = np.concatenate([ray_slopes(camera), np.ones((480, 640, 1))], axis=2).reshape(-1, 3)
    row, column, inside = pixels_in(camera, rays)
    assert inside.all()
    np.testing.assert_array_equal(row * 640 + column, np.arange(480 * 640))


@pytest.mark.parametrize("distortion", [(), AZURE_KINECT])
def test_what_is_no_point_before_the_sensor_has_no_pixel(distortion: tuple[float, ...]) -> None:
    camera = replace(PINHOLE, distortion=distortion)
    nowhere = np.array([[np.nan, 0.0, 1.0], [0.0, np.nan, 1.0], [0.0, 0.0, np.nan], [0.0, 0.0, 0.0], [0.0, 0.1, -1.0]])
    assert np.isnan(project(camera, nowhere)[0]).all()
    assert not pixels_in(camera, nowhere)[2].any()
    assert all(pixel_within(lens_of(camera), (480, 640), *point) == (-1, -1) for point in nowhere)


def test_coefficients_that_are_all_zero_are_a_pinhole() -> None:
    assert lens_of(replace(PINHOLE, distortion=(0.0,) * 8)) == lens_of(PINHOLE)


def test_reading_recordings_of_sensors_takes_no_compiled_loops_along() -> None:
    told = "import sys, capture.importers; print('numba' in sys.modules)"
    ran = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "False"


@pytest.mark.filterwarnings("error")  # of no number taken for a pixel
def test_points_that_a_lens_does_not_reach_are_not_drawn_not_gone_and_beyond_the_border() -> None:
    barrel = replace(PINHOLE, distortion=(-0.2, 0.0, 0.0, 0.0))
    aside, ahead = np.full((50, 3), [2.236, 0.0, 1.0]), np.full((50, 3), [0.1, 0.1, 1.0])
    both = np.concatenate([aside, ahead])
    assert (render([], np.eye(4), barrel, points=aside) == 255).all()
    assert not (render([], np.eye(4), barrel, points=both) == 255).all()
    stays = np.ones((480, 640), dtype=np.float32)
    stays[:10], stays[-10:], stays[:, :10], stays[:, -10:] = 0.0, 0.0, 0.0, 0.0
    assert gone_share(both, barrel, stays) == 0.0
    assert _at_border(Plane(np.array([0.0, 0.0, -1.0]), -1.0, both), barrel)
    assert not _at_border(Plane(np.array([0.0, 0.0, -1.0]), -1.0, ahead), barrel)
    assert _image_window(barrel, both) == (slice(0, 480), slice(0, 640))
    assert _image_window(barrel, ahead) != (slice(0, 480), slice(0, 640))
