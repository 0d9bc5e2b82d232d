import numpy as np
import pytest

from capture.camera import Camera, backproject
from capture.projection import project

PLAIN = Camera(64, 48, 57.0, 58.0, 31.2, 23.8)
DISTORTED = Camera(64, 48, 57.0, 58.0, 31.2, 23.8, (0.08, -0.05, 0.002, -0.001, 0.01))


@pytest.mark.parametrize("camera", [PLAIN, DISTORTED])
def test_backprojected_pixels_project_onto_themselves(camera):
    depth = np.random.default_rng(0).uniform(0.5, 2.0, (camera.height, camera.width))
    points = backproject(camera, depth)
    uv, z = project(camera, points.reshape(-1, 3))
    v, u = np.mgrid[: camera.height, : camera.width]
    np.testing.assert_allclose(uv, np.stack([u.ravel(), v.ravel()], axis=1), atol=1e-3)
    np.testing.assert_allclose(z, depth.ravel())


def test_the_principal_point_looks_straight_ahead():
    uv, _ = project(DISTORTED, np.array([[0.0, 0.0, 1.5]]))
    np.testing.assert_allclose(uv, [[31.2, 23.8]])


def test_barrel_distortion_pulls_points_inwards():
    point = np.array([[0.4, 0.0, 1.0]])
    barrel = Camera(64, 48, 57.0, 58.0, 31.2, 23.8, (-0.2, 0.0, 0.0, 0.0))
    assert project(barrel, point)[0][0, 0] < project(PLAIN, point)[0][0, 0]


def test_no_reading_gives_no_point():
    depth = np.ones((48, 64))
    depth[3, 4], depth[5, 6], depth[7, 8] = 0.0, np.nan, -1.0
    missing = np.isnan(backproject(PLAIN, depth)).all(axis=2)
    assert missing.sum() == 3
    assert missing[[3, 5, 7], [4, 6, 8]].all()


@pytest.mark.parametrize("camera", [PLAIN, DISTORTED])
def test_points_behind_the_sensor_have_no_pixel(camera):
    uv, z = project(camera, np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    assert np.isnan(uv[:2]).all()
    assert np.isfinite(uv[2]).all()
    np.testing.assert_array_equal(z, [-1.0, 0.0, 1.0])


def test_an_image_of_another_size_is_refused():
    with pytest.raises(ValueError, match="expected"):
        backproject(PLAIN, np.ones((64, 48)))
