"""The mathematics of the evaluation's experiments: affine fits, elastic solids, things in the way."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from adapt.anatomy import Anatomy
from adapt.anatomy_file import load_anatomy
from adapt.model.body import make_body, pose_skin, rest_theta
from capture.camera import Camera
from capture.recording import Calibration, Recording, Sensor, SensorCalibration
from capture.rigid import apply, exp_so3, inverse, transform
from capture.simulation.rig import RigSensor
from tests.toy_anatomy import toy_anatomy
from track.evaluation.elastic import inside
from track.evaluation.experiments.forearm import crossing_triangles
from track.evaluation.experiments.sensitivity import CONDITIONS, EXPERIMENT, LIMBS, case_parts, shifted
from track.evaluation.experiments.starts import scaled_body, vertex_error
from track.evaluation.experiments.stills import disturbed
from track.evaluation.paper import EXPERIMENTS
from track.evaluation.proportions import (
    affine_bones,
    body_through_bones,
    body_through_skin,
    fit_affine,
    person_by_handles,
    person_by_stretch,
    warped_bones,
)
from track.evaluation.things import Thing, ball_in_hand, board, faces_with_things, skin_and_things


@pytest.fixture(scope="module")
def arm() -> Anatomy:
    return load_anatomy("upper-limb-right")


def test_every_case_of_every_experiment_has_a_file_of_its_own() -> None:
    for experiment in EXPERIMENTS:
        files = {Path(case.replace(" ", "-")).with_suffix(".json") for case in experiment.cases}
        assert len(files) == len(experiment.cases)


def test_an_affine_map_is_found_again() -> None:
    rng = np.random.default_rng(0)
    points, linear, shift = rng.normal(size=(30, 3)), rng.normal(size=(3, 3)), rng.normal(size=3)
    np.testing.assert_allclose(fit_affine(points, points @ linear + shift), np.vstack([linear, shift]), atol=1e-12)


def test_each_kind_of_person_is_reconstructed_exactly_by_its_own_method_and_not_by_the_other(arm: Anatomy) -> None:
    by_handles, by_stretch = person_by_handles(arm, 1), person_by_stretch(arm, 1)
    for person, own, other in (
        (by_handles, body_through_bones(arm, by_handles.bones).rest_bones, affine_bones(arm, by_handles.bones)),
        (by_stretch, affine_bones(arm, by_stretch.bones), body_through_bones(arm, by_stretch.bones).rest_bones),
    ):
        for name, bone in person.bones.items():
            np.testing.assert_allclose(own[name], bone, atol=1e-9)
        assert max(np.abs(other[name] - bone).max() for name, bone in person.bones.items()) > 1e-3


def test_stretched_bones_hang_together(arm: Anatomy) -> None:
    person = person_by_stretch(arm, 2)
    for joint in arm.joints:
        if joint.parent is None:
            continue
        start = np.array([next(handle.position for handle in arm.handles if handle.bone == joint.child)])
        maps = [fit_affine(arm.bone(name).vertices, person.bones[name]) for name in (joint.parent, joint.child)]
        ends = [np.append(start, 1.0) @ affine for affine in maps]
        np.testing.assert_allclose(ends[0], ends[1], atol=1e-9)


def test_proportions_are_found_again_from_bare_skin(arm: Anatomy) -> None:
    body = scaled_body(arm, 1.07)
    found = body_through_skin(arm, body.v_tilde.value)
    np.testing.assert_allclose(found.shape, body.shape, atol=1e-9)


def test_skin_that_is_carried_by_one_affine_map_carries_the_bones_by_it() -> None:
    anatomy = toy_anatomy()
    linear, shift = np.array([[1.1, 0.1, 0.0], [0.0, 0.9, 0.0], [0.0, 0.05, 1.2]]), np.array([0.1, -0.2, 0.3])
    (bones,) = warped_bones(anatomy, [anatomy.skin_vertices @ linear + shift])
    for bone in anatomy.bones:
        np.testing.assert_allclose(bones[bone.name], bone.vertices @ linear + shift, atol=1e-6)


def test_places_in_a_solid_are_found_again_from_its_corners() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]], dtype=np.float64)
    tets = np.array([[0, 1, 2, 3], [1, 2, 3, 4]])
    where = np.array([[0.1, 0.2, 0.3], [0.6, 0.6, 0.6], [-0.01, 0.2, 0.2]])
    corners, weights = inside(points, tets, where)
    np.testing.assert_array_equal(corners, tets[[0, 1, 0]])
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(np.einsum("vk,vkj->vj", weights, points[corners]), where, atol=1e-12)


def test_triangles_that_cut_each_other_are_counted() -> None:
    flat = [[0, 0, 0], [2, 0, 0], [0, 2, 0]]
    through, beside = [[0.4, 0.4, -1], [0.4, 0.6, 1], [0.6, 0.4, 1]], [[5, 5, -1], [5, 6, 1], [6, 5, 1]]
    faces = np.arange(9).reshape(3, 3)
    assert crossing_triangles(np.array(flat + through + beside, dtype=np.float64), faces) == 2
    assert crossing_triangles(np.array(flat + beside, dtype=np.float64), faces[:2]) == 0


def test_a_scaled_body_is_a_scaled_copy() -> None:
    anatomy = toy_anatomy()
    body = scaled_body(anatomy, 1.1)
    spread = body.v_tilde.value - body.v_tilde.value.mean(axis=0)
    template = anatomy.skin_vertices - anatomy.skin_vertices.mean(axis=0)
    np.testing.assert_allclose(spread, 1.1 * template, atol=1e-9)


def test_the_vertex_error_of_a_shifted_body_is_the_shift() -> None:
    anatomy = toy_anatomy()
    body = make_body(anatomy)
    theta = np.tile(rest_theta(body), (2, 1))
    moved = theta.copy()
    root = anatomy.joints[0]
    moved[:, anatomy.coordinate_index(root.coordinates[3])] += 0.02
    assert vertex_error(body, theta, body, theta) == 0.0
    assert vertex_error(body, theta, body, moved) == pytest.approx(0.02)


def test_disturbed_poses_stay_within_what_is_stated() -> None:
    anatomy = toy_anatomy()
    thetas = np.zeros((5, len(anatomy.coordinates)))
    off = np.abs(disturbed(anatomy, thetas, 0, degrees=6.0, metres=0.015))
    turns = np.array([coordinate.unit == "rad" for coordinate in anatomy.coordinates])
    assert 0.5 * np.deg2rad(6.0) < off[:, turns].max() <= np.deg2rad(6.0)
    assert 0.5 * 0.015 < off[:, ~turns].max() <= 0.015


def test_a_board_hides_its_point_from_its_sensor() -> None:
    sensor = RigSensor(
        "s", Camera(640, 480, 580.0, 580.0, 319.5, 239.5), transform(exp_so3(np.array([0.1, 0.8, 0.2])), np.ones(3))
    )
    point = apply(sensor.world_from_sensor, np.array([[0.1, -0.05, 1.2]]))[0]
    seen = apply(inverse(sensor.world_from_sensor), board(sensor, point, before_m=0.3, side_m=0.1).vertices)
    assert seen[:, 2].min() > 0.8
    assert seen[:, 2].max() < 1.0
    across = seen[:, :2] / seen[:, 2:]
    wanted = np.array([0.1, -0.05]) / 1.2
    assert (across.min(axis=0) < wanted).all()
    assert (across.max(axis=0) > wanted).all()


def test_a_ball_rides_on_the_hand_outside_the_skin(arm: Anatomy) -> None:
    body = make_body(arm)
    ball = ball_in_hand(body, radius_m=0.035, gap_m=0.015)
    theta = rest_theta(body)
    theta[arm.coordinate_index("elbow_flexion")] += 0.7
    theta[arm.coordinate_index("pro_sup")] -= 0.5
    both = skin_and_things(body, theta, [ball])
    hand = np.flatnonzero(arm.deformer_weights[:, -1] == 1.0)
    rest = make_body(arm).v_tilde.value
    apart = np.linalg.norm(rest[hand] - ball.vertices.mean(axis=0), axis=1).min()
    posed = both[len(rest) :].mean(axis=0)
    assert np.linalg.norm(both[hand] - posed, axis=1).min() == pytest.approx(apart, abs=1e-6)
    np.testing.assert_allclose(both[: len(rest)], pose_skin(body, theta))


def test_the_faces_of_things_name_the_vertices_of_things() -> None:
    body = make_body(toy_anatomy())
    thing = Thing(np.zeros((3, 3)), np.array([[0, 1, 2]]))
    faces = faces_with_things(body, [thing, thing])
    count = len(body.v_hat)
    np.testing.assert_array_equal(faces[-2:], [[count, count + 1, count + 2], [count + 3, count + 4, count + 5]])


def test_only_the_last_sensor_is_shifted_and_by_what_is_stated(two_sensors_known: Recording) -> None:
    moved = shifted(two_sensors_known, 5.0, seed=1)
    assert moved.calibration is not None
    assert two_sensors_known.calibration is not None
    for name, expected in (("a", 0.0), ("b", 0.005)):
        before = two_sensors_known.calibration.sensors[name].world_from_sensor
        change = moved.calibration.sensors[name].world_from_sensor - before
        assert np.linalg.norm(change[:3, 3]) == pytest.approx(expected)
        np.testing.assert_array_equal(change[:3, :3], 0.0)


@pytest.fixture
def two_sensors_known(tmp_path: Path) -> Recording:
    camera = Camera(640, 480, 580.0, 580.0, 319.5, 239.5)
    sensors = tuple(Sensor(name, camera, 0.001, (0.3, 3.0)) for name in "ab")
    known = {name: SensorCalibration(np.eye(4), 0.0) for name in "ab"}
    return replace(Recording(tmp_path, sensors), calibration=Calibration(known))


def test_a_case_names_its_condition() -> None:
    found = [case_parts(case) for case in EXPERIMENT.cases]
    assert {condition.name for _, condition, _ in found} == {condition.name for condition in CONDITIONS}
    assert {limb for limb, _, _ in found} == set(LIMBS)
