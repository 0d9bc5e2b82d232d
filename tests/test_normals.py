import numpy as np
import pytest

from capture.camera import Camera
from capture.cloud.normals import surface_at
from capture.cloud.preprocess import boundary, clean_depth
from tests.analytic_depth import cylinder, plane, quantised, sphere

CAMERA = Camera(640, 480, 575.0, 575.0, 319.5, 239.5)
DISTORTED = Camera(640, 480, 575.0, 570.0, 325.0, 236.0, (0.09, -0.2, 0.001, 0.002))
CENTRE = np.array([0.05, 0.02, 1.2])
AXIS = np.array([1.0, 0.3, 0.2]) / np.linalg.norm([1.0, 0.3, 0.2])


def pixels_of(depth, count=1500):
    seen = np.argwhere(depth > 0.0)
    return seen[np.random.default_rng(0).permutation(len(seen))[:count]]


def rms_degrees(normals, truth):
    angle = np.degrees(np.arccos(np.clip((normals * truth).sum(axis=1), -1.0, 1.0)))
    return float(np.sqrt((angle**2).mean()))


def sphere_case(noise_m):
    depth = sphere(CAMERA, CENTRE, 0.06)
    return depth, 0.06, lambda points: points - CENTRE, noise_m


def cylinder_case(noise_m):
    depth = cylinder(CAMERA, CENTRE, AXIS, 0.04)
    return depth, 0.04, lambda points: (points - CENTRE) @ (np.eye(3) - np.outer(AXIS, AXIS)), noise_m


@pytest.mark.parametrize("case", [sphere_case(0.0), cylinder_case(0.0), sphere_case(0.0015), cylinder_case(0.0015)])
def test_normals_and_points_survive_a_quantised_noisy_sensor(case):
    exact, radius, from_axis, noise_m = case
    noisy = np.where(exact > 0, exact + np.random.default_rng(1).normal(0.0, noise_m, exact.shape), 0.0)
    depth = clean_depth(quantised(noisy), CAMERA)
    pixels = pixels_of(depth)
    points, normals = surface_at(depth, CAMERA, pixels)
    outward = from_axis(points)
    distance = np.linalg.norm(outward, axis=1)
    inner = ~boundary(depth, CAMERA)[pixels[:, 0], pixels[:, 1]]
    truth = outward / distance[:, None]
    assert rms_degrees(normals[inner], truth[inner]) < 3.5
    assert rms_degrees(normals[~inner], truth[~inner]) < 9.0
    # Smoothing must not shift the surface: the readings themselves are 4 mm apart here.
    assert abs(float((distance - radius)[inner].mean())) < 0.0003
    assert float((distance - radius)[inner].std()) < 0.0006


@pytest.mark.parametrize("camera", [CAMERA, DISTORTED])
@pytest.mark.parametrize("degrees", [0.0, 40.0, 65.0])
def test_a_plane_is_met_exactly(camera, degrees):
    normal = np.array([np.sin(np.radians(degrees)), 0.2, -np.cos(np.radians(degrees))])
    normal /= np.linalg.norm(normal)
    depth = plane(camera, normal, np.array([0.0, 0.0, 1.0])).astype(np.float32)
    depth[(depth < 0.8) | (depth > 1.3)] = 0.0
    points, normals = surface_at(depth, camera, pixels_of(depth, 300))
    assert rms_degrees(normals, normal[None]) < 0.3
    np.testing.assert_allclose((points - [0.0, 0.0, 1.0]) @ normal, 0.0, atol=1e-4)


def test_a_limb_in_front_of_a_chest_does_not_bend_its_normals():
    limb = cylinder(CAMERA, CENTRE, AXIS, 0.04)
    chest = np.where(limb > 0, limb, 1.32)
    alone, together = (quantised(depth) for depth in (limb, chest))
    pixels = np.argwhere((alone > 0) & ~boundary(alone, CAMERA))[::37]
    _, lone = surface_at(alone, CAMERA, pixels)
    _, normals = surface_at(together, CAMERA, pixels)
    assert rms_degrees(normals, lone) < 3.0


def test_normals_face_the_sensor():
    depth = quantised(sphere(CAMERA, CENTRE, 0.06))
    points, normals = surface_at(depth, CAMERA, np.argwhere(depth > 0)[::11])
    assert ((points * normals).sum(axis=1) < 0.0).all()
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)


def test_pixels_at_the_image_edge_and_lonely_pixels_get_an_answer():
    depth = np.zeros((480, 640), dtype=np.float32)
    depth[:, :3] = 1.0
    depth[100, 300] = 1.0
    points, normals = surface_at(depth, CAMERA, np.array([[0, 0], [479, 2], [100, 300]]))
    np.testing.assert_allclose(points[:, 2], 1.0, atol=1e-6)
    assert np.isfinite(normals).all()


def test_no_pixels_give_no_points():
    points, normals = surface_at(np.zeros((480, 640), np.float32), CAMERA, np.zeros((0, 2), np.intp))
    assert points.shape == normals.shape == (0, 3)
