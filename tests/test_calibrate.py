"""From images of a box, sensors learn where they stand; where the images do not tell, nothing is guessed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray

from capture.calibration.box import find_box, symmetries
from capture.calibration.box_images import averaged_depth
from capture.calibration.calibrate import DOUBTFUL_APART_M, calibrate_recording, write_calibration
from capture.calibration.extrinsic_check import cloud_offset, surface
from capture.camera import Camera, backproject
from capture.cloud.planes import find_planes
from capture.commands import calibrate_command
from capture.errors import CalibrationError
from capture.recording import Calibration, Recording, RecordingWriter, Sensor, open_recording
from capture.rigid import apply, exp_so3, inverse, rotation_angle, transform
from capture.simulation.ray_casting import cast, scene_of
from capture.simulation.rig import SensorRig, box_mesh, default_rig
from capture.simulation.sensor import NoiseModel, carmine, carmine_camera, observe
from capture.simulation.simulate import simulate_recording
from tests.moving_arm import arm_motion

Floats = NDArray[np.float64]
Mesh = tuple[Floats, NDArray[np.int64]]

SIZE = (0.30, 0.20, 0.15)
EXACT = NoiseModel()
CAMERA = carmine_camera()


def joined(*meshes: Mesh) -> Mesh:
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    faces = [faces + start for (_, faces), start in zip(meshes, starts, strict=False)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(faces)


def block(size: tuple[float, float, float], at: tuple[float, float, float], turn: tuple[float, float, float]) -> Mesh:
    vertices, faces = box_mesh(size)
    return apply(transform(exp_so3(np.array(turn)), np.array(at)), vertices), faces


def image(mesh: Mesh, pose: Floats, *, noise: NoiseModel | None = None, seed: int = 0) -> Floats:
    """Depth (m) that a sensor at a pose (4, 4) measures of a mesh."""
    noise = carmine() if noise is None else noise
    view = cast(scene_of(*mesh), CAMERA, pose, mesh[0], noise.baseline_m)
    rng = np.random.default_rng(seed)
    return observe(view.depth, view.normal_cos, view.shadow, CAMERA, noise, rng) / 1000.0


def recorded(
    path: Path,
    *,
    rig: SensorRig | None = None,
    noise: NoiseModel | None = None,
    seed: int = 0,
    count: int = 3,
    box_frames: int = 5,
) -> Recording:
    frames, faces, times = arm_motion(count)
    return simulate_recording(
        path, frames, faces, times, rig=rig, noise=noise, seed=seed, box_frames=box_frames, overwrite=True
    )


def random_rig(seed: int) -> SensorRig:
    rng = np.random.default_rng(seed)
    elevations = tuple(rng.uniform(-10.0, 35.0, 2))
    points = np.concatenate(arm_motion(3)[0])
    return default_rig(points, spread_deg=rng.uniform(40.0, 110.0), elevations_deg=elevations, seed=seed)


def errors_against_truth(recording: Recording, calibration: Calibration) -> tuple[float, float, float]:
    """Of the second sensor relative to the first: deg, mm, and mm at the middle of the working volume."""
    assert recording.truth_path is not None
    with np.load(recording.truth_path) as truth:
        first, second = truth["world_from_sensor"]
        centre = truth["world_from_box"][None, :3, 3]
    a, b = (calibration.sensors[sensor.name].world_from_sensor for sensor in recording.sensors)
    true, found = inverse(first) @ second, inverse(a) @ b
    turn = np.rad2deg(rotation_angle(true[:3, :3].T @ found[:3, :3]))
    seen = apply(inverse(second), centre)
    middle = np.linalg.norm(apply(found, seen) - apply(true, seen))
    return turn, 1000.0 * float(np.linalg.norm(true[:3, 3] - found[:3, 3])), 1000.0 * float(middle)


def error_against_box(found: Floats, box_from_sensor: Floats) -> tuple[float, float]:
    """Degrees and millimetres to the nearest of the symmetric readings of the true pose."""
    readings = [transform(turn, np.zeros(3)) @ box_from_sensor for turn in symmetries(SIZE)]
    return min(
        (
            float(np.rad2deg(rotation_angle(true[:3, :3].T @ found[:3, :3]))),
            1000.0 * float(np.linalg.norm(true[:3, 3] - found[:3, 3])),
        )
        for true in readings
    )


@pytest.mark.parametrize("seed", range(10))
def test_two_carmines_find_each_other_the_right_way_round(tmp_path: Path, seed: int) -> None:
    recording = recorded(tmp_path / "rec", rig=random_rig(seed), seed=seed)
    calibration = calibrate_recording(recording)
    degrees, millimetres, at_the_middle = errors_against_truth(recording, calibration)
    assert degrees < 0.3
    assert millimetres < 3.5  # a tenth of a degree is 2 mm at 1.2 m; what counts is the next line
    assert at_the_middle < 0.5
    for sensor in calibration.sensors.values():
        assert sensor.residual_mm < 1.5
        assert sensor.details["box_faces"] == 3
        assert np.abs(np.array(sensor.details["face_angles_deg"]) - 90.0).max() < 1.0
        assert np.abs(np.array(sensor.details["measured_size_mm"]) - (300.0, 200.0, 150.0)).max() < 8.0


def test_without_noise_the_calibration_is_exact(tmp_path: Path) -> None:
    recording = recorded(tmp_path / "rec", noise=EXACT, box_frames=1)
    degrees, millimetres, at_the_middle = errors_against_truth(recording, calibrate_recording(recording))
    # Depth still comes in whole millimetres.
    assert degrees < 0.01
    assert millimetres < 0.2
    assert at_the_middle < 0.02


def test_the_common_frame_is_the_boxs_with_its_axes_in_the_order_of_the_size(tmp_path: Path) -> None:
    recording = recorded(tmp_path / "rec", noise=EXACT, box_frames=1)
    calibration = calibrate_recording(recording)
    assert (calibration.sensors["sensor1"].world_from_sensor[:2, 3] > 0.0).all()
    for sensor in recording.sensors:
        seen = backproject(sensor.camera, averaged_depth(sensor, sensor.box_frames))
        in_box = apply(calibration.sensors[sensor.name].world_from_sensor, seen[np.isfinite(seen[..., 2])])
        assert np.abs(np.abs(in_box).max(axis=0) - (0.15, 0.10, 0.075)).max() < 0.002


def test_more_box_frames_leave_less_noise(tmp_path: Path) -> None:
    recording = recorded(tmp_path / "rec", count=1, box_frames=12)
    one, all_twelve = (
        np.mean(
            [
                find_box(averaged_depth(s, s.box_frames[:count]).astype(float), s.camera, SIZE).residual_m
                for s in recording.sensors
            ]
        )
        for count in (1, 12)
    )
    assert all_twelve < 0.5 * one


def test_a_calibration_is_kept_in_the_recording(tmp_path: Path) -> None:
    recording = recorded(tmp_path / "rec", count=1)
    calibration = calibrate_recording(recording)
    write_calibration(recording, calibration)
    kept = open_recording(recording.path).calibration
    assert kept is not None
    for name, sensor in calibration.sensors.items():
        assert np.array_equal(kept.sensors[name].world_from_sensor, sensor.world_from_sensor)
        assert kept.sensors[name].details == sensor.details
    assert kept.sensors["sensor1"].details["ambiguity_margin"] is None
    assert kept.sensors["sensor2"].details["ambiguity_margin"] > 0.5


@pytest.mark.parametrize("size", [(0.30, 0.20, 0.20), (0.20, 0.20, 0.20)])
def test_boxes_with_equal_sides_have_more_readings_and_the_right_one_is_still_found(
    tmp_path: Path, size: tuple[float, float, float]
) -> None:
    rig = replace(random_rig(3), box_size_m=size)
    recording = recorded(tmp_path / "rec", rig=rig)
    degrees, _, at_the_middle = errors_against_truth(recording, calibrate_recording(recording))
    assert degrees < 0.3
    assert at_the_middle < 0.5


def test_three_sensors_share_one_frame(tmp_path: Path) -> None:
    points = np.concatenate(arm_motion(3)[0])
    rig = default_rig(points, spread_deg=110.0, elevations_deg=(10.0, 25.0, 15.0))
    recording = recorded(tmp_path / "rec", rig=rig)
    calibration = calibrate_recording(recording)
    with np.load(recording.path / "truth.npz") as truth:
        moves = [
            calibration.sensors[name].world_from_sensor @ inverse(pose)
            for name, pose in zip(truth["sensor_names"].tolist(), truth["world_from_sensor"], strict=True)
        ]
    assert all(np.rad2deg(rotation_angle(move[:3, :3].T @ moves[0][:3, :3])) < 0.3 for move in moves)


def test_one_sensor_needs_no_decision(tmp_path: Path) -> None:
    rig = random_rig(0)
    recording = recorded(tmp_path / "rec", rig=replace(rig, sensors=rig.sensors[:1]), count=1)
    calibration = calibrate_recording(recording)
    assert calibration.sensors["sensor1"].details["ambiguity_margin"] is None


def cylinder_along_the_boxs_axis(rig: SensorRig) -> Mesh:
    around, along = np.arange(48) * np.pi / 24, np.linspace(-0.3, 0.3, 30)
    a, z = (x.ravel() for x in np.meshgrid(around, along))
    points = apply(rig.world_from_box, np.column_stack([z, 0.05 * np.cos(a), 0.05 * np.sin(a)]))
    i, j = (x.ravel() for x in np.meshgrid(np.arange(29), np.arange(48), indexing="ij"))
    q, r = i * 48 + j, i * 48 + (j + 1) % 48
    return points, np.concatenate([np.column_stack([q, r, q + 48]), np.column_stack([r, r + 48, q + 48])])


def test_a_subject_that_looks_the_same_every_way_round_decides_nothing(tmp_path: Path) -> None:
    rig = random_rig(4)
    vertices, faces = cylinder_along_the_boxs_axis(rig)
    recording = simulate_recording(tmp_path / "rec", [vertices] * 2, faces, [0.0, 0.1], rig=rig, box_frames=3)
    with pytest.raises(CalibrationError, match="sensor 'sensor2' sees the box cannot be decided") as caught:
        calibrate_recording(recording)
    assert "person moving in view of all sensors" in caught.value.remedy


def test_box_frames_alone_decide_nothing(tmp_path: Path) -> None:
    rig = random_rig(1)
    recording = simulate_recording(tmp_path / "rec", [], box_mesh(SIZE)[1], [], rig=rig, box_frames=3)
    with pytest.raises(CalibrationError, match="the box alone does not tell"):
        calibrate_recording(recording)


def test_a_box_of_another_size_than_stated_is_refused(tmp_path: Path) -> None:
    recording = replace(recorded(tmp_path / "rec", count=1), box_size_m=(0.33, 0.20, 0.15))
    with pytest.raises(CalibrationError, match=r"measured 29\d x (19|20)\d x 1[45]\d mm.*says 330 x 200 x 150 mm"):
        calibrate_recording(recording)


def test_a_recording_without_a_stated_size_or_box_frames_is_refused(tmp_path: Path) -> None:
    recording = recorded(tmp_path / "rec", count=1, box_frames=1)
    with pytest.raises(CalibrationError, match="does not say how large"):
        calibrate_recording(replace(recording, box_size_m=None))
    bare = tuple(replace(sensor, box_frames=()) for sensor in recording.sensors)
    with pytest.raises(CalibrationError, match="sensor1: there are no images of the calibration box"):
        calibrate_recording(replace(recording, sensors=bare))


@pytest.mark.parametrize("scene", ["nothing", "a limb", "a wall"])
def test_where_no_box_is_in_view_none_is_found(scene: str) -> None:
    frames, faces, _ = arm_motion(1)
    pose = random_rig(0).sensors[0].world_from_sensor
    seen = {
        "nothing": np.zeros((480, 640)),
        "a limb": image((frames[0], faces), pose),
        "a wall": image(block((5.0, 5.0, 0.1), (0.0, 0.0, 1.5), (0.2, 0.1, 0.0)), np.eye(4)),
    }[scene]
    with pytest.raises(CalibrationError, match=r"no box in view.*corner of three faces towards the sensor"):
        find_box(seen, CAMERA, SIZE)


def test_two_faces_are_not_enough() -> None:
    edge_on = block(SIZE, (0.0, 0.0, 1.2), (0.0, 0.0, 0.0))
    turned = apply(transform(exp_so3(np.array([0.0, 0.8, 0.0])), np.array([0.0, 0.0, 1.2])), box_mesh(SIZE)[0])
    with pytest.raises(CalibrationError, match="only two faces"):
        find_box(image((turned, edge_on[1]), np.eye(4)), CAMERA, SIZE)


def test_a_box_that_is_not_square_is_refused() -> None:
    vertices, faces = box_mesh(SIZE)
    sheared = vertices @ np.array([[1.0, 0.0, 0.0], [0.09, 1.0, 0.0], [0.0, 0.0, 1.0]])
    rig = default_rig(vertices)
    turned = apply(rig.world_from_box, sheared)
    with pytest.raises(CalibrationError, match="instead of 90"):
        find_box(image((turned, faces), rig.sensors[0].world_from_sensor), CAMERA, SIZE)


def test_a_wrong_focal_length_shows_in_the_angles_of_the_box() -> None:
    vertices, faces = box_mesh(SIZE)
    rig = default_rig(vertices)
    depth = image((apply(rig.world_from_box, vertices), faces), rig.sensors[0].world_from_sensor)
    with pytest.raises(CalibrationError, match=r"instead of 90.*check the camera's focal length"):
        find_box(depth, replace(CAMERA, fx=1.08 * CAMERA.fx), SIZE)


def test_sides_too_alike_to_be_told_apart_are_refused() -> None:
    with pytest.raises(CalibrationError, match="200 and 190 mm are too alike"):
        find_box(np.zeros((480, 640)), CAMERA, (0.3, 0.2, 0.19))


@pytest.mark.parametrize("seed", range(4))
def test_the_box_is_found_on_a_table_in_a_furnished_room(seed: int) -> None:
    rng = np.random.default_rng(seed)
    turn = (0.0, float(rng.uniform(0.5, 1.1)), 0.0)
    box = block(SIZE, (0.0, 0.1, 0.0), turn)
    room = joined(
        box,
        block((0.8, 0.04, 1.2), (0.0, -0.02, 0.0), (0.0, 0.0, 0.0)),  # the table
        block((6.0, 0.02, 6.0), (0.0, -0.75, 0.0), (0.0, 0.0, 0.0)),  # the floor
        block((0.02, 4.0, 6.0), (-1.2, 0.0, 0.0), (0.0, 0.0, 0.0)),  # two walls
        block((6.0, 4.0, 0.02), (0.0, 0.0, -1.5), (0.0, 0.0, 0.0)),
        block((0.10, 0.25, 0.08), (-0.15, 0.125, 0.4), (0.0, 0.3, 0.0)),  # another box
    )
    elevation, distance = float(rng.uniform(20.0, 40.0)), float(rng.uniform(0.9, 1.4))
    pose = default_rig(box[0], elevations_deg=(elevation,), distance_m=distance).sensors[0].world_from_sensor
    found = find_box(image(room, pose, seed=seed), CAMERA, SIZE)
    true = inverse(transform(exp_so3(np.array(turn)), np.array([0.0, 0.1, 0.0]))) @ pose
    degrees, millimetres = error_against_box(found.box_from_sensor, true)
    assert degrees < 0.3
    assert millimetres < 4.0


def test_a_room_around_box_and_subject_does_not_mislead(tmp_path: Path) -> None:
    rig = random_rig(1)
    x, y, z = (float(c) for c in rig.world_from_box[:3, 3])
    still = (0.0, 0.0, 0.0)
    room = joined(
        block((6.0, 0.02, 6.0), (x, y - 0.8, z), still),
        block((0.02, 4.0, 6.0), (x - 1.0, y, z), still),
        block((6.0, 4.0, 0.02), (x, y, z - 1.5), still),
    )
    vertices, faces = box_mesh(SIZE)
    box_scene = joined((apply(rig.world_from_box, vertices), faces), room)
    frames, limb_faces, times = arm_motion(2)
    sensors = [Sensor(sensor.name, sensor.camera, depth_range_m=(0.35, 3.0)) for sensor in rig.sensors]
    with RecordingWriter(tmp_path / "rec", sensors=sensors, created_by="test") as writer:
        writer.set_box(SIZE)
        poses = np.stack([sensor.world_from_sensor for sensor in rig.sensors])
        writer.set_truth({"world_from_sensor": poses, "world_from_box": rig.world_from_box})
        for sensor in rig.sensors:
            for index in range(3):
                writer.add_box_frame(sensor.name, image(box_scene, sensor.world_from_sensor, seed=index), float(index))
            for limb, time_s in zip(frames, times, strict=True):
                seen = image(joined((limb, limb_faces), room), sensor.world_from_sensor, seed=9)
                writer.add_frame(sensor.name, seen, time_s)
    recording = open_recording(tmp_path / "rec")
    degrees, _, at_the_middle = errors_against_truth(recording, calibrate_recording(recording))
    assert degrees < 0.3
    assert at_the_middle < 1.0


def cut_off(depth: Floats, side: str, share: float) -> tuple[Floats, Camera]:
    """The image and camera without what is beyond a line that cuts a share off what is seen."""
    (top, bottom), (left, right) = ((i.min(), i.max()) for i in np.nonzero(depth))
    row, column = int(share * (bottom - top)), int(share * (right - left))
    first_row, last_row, first_column, last_column = {
        "top": (top + row, 480, 0, 640),
        "bottom": (0, bottom - row, 0, 640),
        "left": (0, 480, left + column, 640),
        "right": (0, 480, 0, right - column),
    }[side]
    kept = depth[first_row:last_row, first_column:last_column]
    height, width = kept.shape
    cx, cy = CAMERA.cx - float(first_column), CAMERA.cy - float(first_row)
    return kept, replace(CAMERA, width=width, height=height, cx=cx, cy=cy)


def box_seen(*, scale: float = 1.0, size: tuple[float, float, float] = SIZE, away_m: float = 1.2) -> Floats:
    rig = default_rig(np.concatenate(arm_motion(1)[0]), distance_m=away_m)
    vertices, faces = box_mesh(size)
    return scale * image((apply(rig.world_from_box, vertices), faces), rig.sensors[0].world_from_sensor)


@pytest.mark.parametrize("side", ["top", "bottom", "left", "right"])
def test_a_box_cut_off_by_the_images_border_is_not_taken_for_a_smaller_one(side: str) -> None:
    depth, camera = cut_off(box_seen(), side, 0.35)
    with pytest.raises(CalibrationError, match="reaches over the border of the image") as caught:
        find_box(depth, camera, SIZE)
    assert "correct the size" not in str(caught.value)
    assert "whole in the image" in caught.value.remedy


@pytest.mark.parametrize(("scale", "saying"), [(1.03, r"(2|3)\.\d % too large"), (0.97, r"(2|3)\.\d % too small")])
def test_depths_that_are_all_too_large_or_too_small_show_in_the_size_of_the_box(scale: float, saying: str) -> None:
    with pytest.raises(CalibrationError, match=f"all sides of the box are {saying}.*check the depth unit"):
        find_box(box_seen(scale=scale), CAMERA, SIZE)


def test_a_box_seen_at_a_low_angle_is_not_taken_for_a_smaller_one() -> None:
    points = np.concatenate(arm_motion(1)[0])
    rig = default_rig(points, spread_deg=270.0, elevations_deg=(24.0, 12.0, 24.0, 12.0))
    box = (apply(rig.world_from_box, box_mesh(SIZE)[0]), box_mesh(SIZE)[1])
    found = [find_box(image(box, sensor.world_from_sensor), CAMERA, SIZE) for sensor in rig.sensors]
    smallest = min(sum(fit.measured_size_m) / sum(SIZE) for fit in found)
    assert smallest < 0.98  # its edges are lost


def test_a_box_too_far_away_is_told_to_come_nearer_not_that_it_is_crooked() -> None:
    with pytest.raises(CalibrationError, match=r"the box, 2\.\d m away.*0\.6 to 1\.5 m away") as caught:
        find_box(box_seen(away_m=2.5), CAMERA, SIZE)
    assert "rigid" not in caught.value.remedy


def test_a_box_too_small_to_have_enough_points_is_not_found() -> None:
    size = (0.08, 0.06, 0.04)
    with pytest.raises(CalibrationError, match=r"(no box in view|too few points|only two faces).*stand the box free"):
        find_box(box_seen(size=size, away_m=1.5), CAMERA, size)


def with_moved_box(path: Path, rig: SensorRig, moves: dict[str, list[Floats]]) -> Recording:
    """A recording whose box stands elsewhere, by moves (4, 4) of the world, in each sensor's images of it."""
    vertices, faces = box_mesh(rig.box_size_m)
    frames, limb_faces, times = arm_motion(2 if len(moves) > 1 else 0)
    sensors = [Sensor(sensor.name, sensor.camera, depth_range_m=(0.35, 3.0)) for sensor in rig.sensors]
    with RecordingWriter(path, sensors=sensors, created_by="test") as writer:
        writer.set_box(rig.box_size_m)
        for sensor in rig.sensors:
            for index, move in enumerate(moves[sensor.name]):
                moved = apply(move @ rig.world_from_box, vertices), faces
                writer.add_box_frame(sensor.name, image(moved, sensor.world_from_sensor, seed=index), index / 30.0)
            for limb, time_s in zip(frames, times, strict=True):
                writer.add_frame(sensor.name, image((limb, limb_faces), sensor.world_from_sensor, seed=99), time_s)
    return open_recording(path)


def turned_about_y(degrees: float, centre: Floats) -> Floats:
    rotation = exp_so3(np.array([0.0, np.deg2rad(degrees), 0.0]))
    return transform(rotation, centre - rotation @ centre)


def pushed(metres: float) -> Floats:
    return transform(np.eye(3), np.array([0.0, 0.0, metres]))


@pytest.mark.parametrize("how", ["pushed 8 mm", "turned 3 degrees", "kicked at the end", "moved once"])
def test_a_box_that_moves_while_it_is_recorded_is_refused(tmp_path: Path, how: str) -> None:
    rig = random_rig(2)
    rig = replace(rig, sensors=rig.sensors[:1])
    along = np.linspace(0.0, 1.0, 4)
    moves = {
        "pushed 8 mm": [pushed(0.008 * t) for t in along],
        "turned 3 degrees": [turned_about_y(3.0 * t, rig.world_from_box[:3, 3]) for t in along],
        "kicked at the end": [pushed(0.1 * (t == 1.0)) for t in along],
        "moved once": [pushed(0.1 * (t > 0.5)) for t in along],
    }[how]
    recording = with_moved_box(tmp_path / "rec", rig, {"sensor1": moves})
    with pytest.raises(CalibrationError, match=r"sensor1: the box, or the sensor, moved .*leave both alone"):
        calibrate_recording(recording)


@pytest.mark.parametrize("seed", [0, 4, 7])
def test_a_far_box_is_not_called_moved_for_its_noise(tmp_path: Path, seed: int) -> None:
    rig = random_rig(seed)
    near, box = rig.sensors[0], rig.world_from_box[:3, 3]
    away = near.world_from_sensor[:3, 3] - box
    far = transform(near.world_from_sensor[:3, :3], box + 2.4 * away / np.linalg.norm(away))
    rig = replace(rig, sensors=(replace(near, world_from_sensor=far),))
    calibration = calibrate_recording(with_moved_box(tmp_path / "rec", rig, {near.name: [np.eye(4)] * 5}))
    assert calibration.sensors[near.name].residual_mm < 4.0


def test_a_box_moved_between_the_sensors_images_is_refused(tmp_path: Path) -> None:
    rig = random_rig(2)
    moves = {"sensor1": [np.eye(4)], "sensor2": [pushed(0.04)]}
    with pytest.raises(CalibrationError, match=r"'sensor2' saw does not lie on what the others saw.*leave box and"):
        calibrate_recording(with_moved_box(tmp_path / "rec", rig, moves))


@pytest.mark.parametrize("seed", [0, 4, 7])
def test_a_box_moved_by_a_centimetre_between_the_sensors_images_is_refused(tmp_path: Path, seed: int) -> None:
    way = np.random.default_rng(seed).normal(size=3)
    moved = transform(np.eye(3), 0.01 * way / np.linalg.norm(way))
    moves = {"sensor1": [np.eye(4)], "sensor2": [moved]}
    with pytest.raises(
        CalibrationError, match=r"'sensor2' saw lies \d+ mm .* from what 'sensor1' saw.*all sensors at"
    ) as e:
        calibrate_recording(with_moved_box(tmp_path / "rec", random_rig(seed), moves))
    assert "clocks" in e.value.remedy


def test_a_box_that_stood_still_leaves_the_clouds_on_each_other(tmp_path: Path) -> None:
    still = {"sensor1": [np.eye(4)], "sensor2": [np.eye(4)]}
    calibration = calibrate_recording(with_moved_box(tmp_path / "rec", random_rig(4), still))
    assert calibration.sensors["sensor1"].details["apart_mm"] is None
    assert calibration.sensors["sensor2"].details["apart_mm"] < 1000.0 * DOUBTFUL_APART_M


def test_clouds_that_lie_apart_by_less_are_warned_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recording = recorded(tmp_path / "rec", count=2)
    quiet = CliRunner().invoke(calibrate_command, [str(recording.path)])
    monkeypatch.setattr("capture.calibration.calibrate.DOUBTFUL_APART_M", 0.0)
    told = CliRunner().invoke(calibrate_command, [str(recording.path)])
    assert "warning" not in quiet.output
    assert "warning: the clouds of sensor2 lie apart" in told.output


def test_a_known_motion_between_two_clouds_is_found() -> None:
    rig = random_rig(0)
    limbs, faces, _ = arm_motion(2)
    seen = [
        [
            surface(image((limb, faces), s.world_from_sensor, noise=EXACT).astype(np.float32), CAMERA)
            for s in rig.sensors
        ]
        for limb in limbs
    ]
    true = inverse(rig.sensors[1].world_from_sensor) @ rig.sensors[0].world_from_sensor
    pairs = [(first, second) for first, second in seen]
    right, moved = (
        cloud_offset(pairs, true),
        cloud_offset(pairs, transform(np.eye(3), np.array([0.0, 0.0, 0.01])) @ true),
    )
    assert right is not None
    assert right.distance_m < 0.001
    assert moved is not None
    assert moved.distance_m == pytest.approx(0.01, abs=0.003)
    assert cloud_offset(pairs, transform(np.eye(3), np.array([5.0, 0.0, 0.0])) @ true) is None
    assert cloud_offset(pairs[:1], true) is None  # one instant cannot tell how sure it is


def test_sensors_that_face_each_other_see_no_face_in_common_and_are_still_calibrated(tmp_path: Path) -> None:
    points = np.concatenate(arm_motion(3)[0])
    rig = default_rig(points, spread_deg=180.0, elevations_deg=(20.0, -20.0))
    axes = [(rig.world_from_box[:3, :3].T @ (s.world_from_sensor[:3, 3] - points.mean(axis=0))) for s in rig.sensors]
    assert (np.sign(axes[0]) != np.sign(axes[1])).all()
    recording = recorded(tmp_path / "rec", rig=rig, count=2, box_frames=2)
    degrees, _, at_the_middle = errors_against_truth(recording, calibrate_recording(recording))
    assert degrees < 0.3
    assert at_the_middle < 0.8


def test_symmetries_are_rotations_that_lay_the_box_upon_itself() -> None:
    for size, count in (((0.3, 0.2, 0.1), 4), ((0.2, 0.2, 0.1), 8), ((0.2, 0.2, 0.2), 24)):
        turns = symmetries(size)
        assert len({turn.tobytes() for turn in turns}) == count
        for turn in turns:
            assert np.linalg.det(turn) == pytest.approx(1.0)
            assert np.abs(turn) @ size == pytest.approx(size)
        assert np.array_equal(turns[0], np.eye(3))


def test_planes_are_found_as_they_stand() -> None:
    mesh = joined(
        block((0.6, 0.6, 0.02), (-0.35, 0.0, 1.5), (0.0, 0.5, 0.0)),
        block((0.6, 0.6, 0.02), (0.45, 0.0, 1.2), (0.4, -0.3, 0.0)),
    )
    planes = find_planes(backproject(CAMERA, image(mesh, np.eye(4), noise=EXACT)))
    normals = [-exp_so3(np.array(turn))[:, 2] for turn in ((0.0, 0.5, 0.0), (0.4, -0.3, 0.0))]
    for normal in normals:
        assert max(float(plane.normal @ normal) for plane in planes) > np.cos(np.deg2rad(0.1))
    assert len(planes) == 2


def test_averaging_keeps_to_the_usual_reading(tmp_path: Path) -> None:
    camera = replace(CAMERA, width=4, height=1)
    readings = ((1000, 1000, 0, 0), (1002, 1000, 0, 1000), (1004, 1900, 900, 1000))
    with RecordingWriter(tmp_path / "rec", sensors=[Sensor("one", camera)], created_by="test") as writer:
        for index, row in enumerate(readings):
            writer.add_box_frame("one", np.array([row], dtype=np.uint16), float(index))
    sensor = open_recording(tmp_path / "rec").sensors[0]
    assert averaged_depth(sensor, sensor.box_frames)[0] == pytest.approx([1.002, 1.0, 0.0, 1.0])
