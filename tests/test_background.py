"""Floor and walls are left out of the clouds of a recording, and a person who is all there is stays whole."""

from __future__ import annotations

import numpy as np

from capture.camera import backproject
from capture.cloud.background import LargePlane, large_planes, without_planes
from capture.cloud.fuse import fuse
from capture.cloud.preprocess import clean_depth
from capture.recording import Instant, Recording, RecordingWriter, Region, instants, open_recording, read_depth
from tests.analytic_depth import plane
from tests.test_region import FLOOR, SENSOR, WALL, ball, scene
from tests.two_sensors import write_limb

EVERYWHERE = Region(np.full(3, -5.0), np.full(3, 5.0))
RADIUS_M, CENTRE = 0.25, np.array([0.0, 0.6, 2.0])  # the ball reaches into the floor, 0.8 m below the sensor


def recorded(path, image) -> tuple[Recording, Instant]:
    with RecordingWriter(path, sensors=[SENSOR], created_by="test") as writer:
        writer.add_frame("s", image, 0.0)
    recording = open_recording(path)
    return recording, instants(recording)[0]


def test_floor_and_wall_are_not_in_the_cloud_and_who_stands_on_the_floor_is(tmp_path):
    recording, instant = recorded(tmp_path / "rec", scene(FLOOR, WALL, ball(*CENTRE, RADIUS_M)))
    cloud = fuse(recording, instant, region=EVERYWHERE)
    assert np.abs(np.linalg.norm(cloud.points - CENTRE, axis=1) - RADIUS_M).max() < 0.03
    assert cloud.points[:, 1].max() > 0.72  # down to a few centimetres above the floor
    assert 0.5 < len(cloud.points) * 0.0075**2 / (np.pi * RADIUS_M**2) < 3.0


def test_an_image_without_floor_or_wall_stays_as_it_is(tmp_path):
    recording = write_limb(tmp_path / "rec")
    instant = instants(recording)[0]
    cloud = fuse(recording, instant, region=EVERYWHERE)
    for view in cloud.views:
        sensor = recording.sensor(view.sensor)
        assert np.array_equal(view.depth, clean_depth(read_depth(sensor, instant.frames[view.sensor]), sensor.camera))


def test_a_noisy_wall_far_away_goes_and_who_stands_before_it_stays(tmp_path):
    random = np.random.default_rng(0)
    camera = SENSOR.camera
    image = scene(plane(camera, np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, 3.6])), ball(0.0, 0.0, 2.4, RADIUS_M))
    noisy = np.where(image > 0.0, image + random.normal(0.0, 0.0015, image.shape) * image**2, 0.0)
    recording, instant = recorded(tmp_path / "rec", noisy.astype(np.float32))
    cloud = fuse(recording, instant, region=EVERYWHERE)
    assert cloud.points[:, 2].max() < 2.6
    assert len(cloud.points) * 0.0075**2 > 0.5 * np.pi * RADIUS_M**2


def wall(*, tilt_rad: float = 0.0, away_m: float = 2.5):
    return plane(SENSOR.camera, np.array([np.sin(tilt_rad), 0.0, np.cos(tilt_rad)]), np.array([0.0, 0.0, away_m]))


def clouds_of(path, walls, *, close=()):
    """What is left of a recording of somebody before a wall, frame by frame; in those of ``close`` he hides it."""
    with RecordingWriter(path, sensors=[SENSOR], created_by="test") as writer:
        for number, behind in enumerate(walls):
            aside = 0.001 * number  # equal images would count as one that was delivered twice
            somebody = ball(aside, 0.0, 1.05, 0.5) if number in close else ball(aside, 0.0, 1.6, RADIUS_M)
            writer.add_frame("s", scene(behind, somebody), number / 10.0)
    recording = open_recording(path)
    every = instants(recording)
    assert len(every) == len(walls)
    return [fuse(recording, instant, region=EVERYWHERE).points for instant in every]


def test_a_wall_goes_in_every_frame_though_the_sensor_is_turned(tmp_path):
    for points in clouds_of(tmp_path / "rec", [wall(tilt_rad=0.02 * k) for k in range(16)]):
        assert points[:, 2].max() < 1.7
        assert len(points) > 500


def test_a_wall_goes_though_the_sensor_is_knocked_for_a_moment(tmp_path):
    for points in clouds_of(tmp_path / "rec", [wall(away_m=2.8 if k == 12 else 2.5) for k in range(17)]):
        assert points[:, 2].max() < 1.7


def test_a_wall_that_is_hidden_half_way_goes_in_the_other_frames(tmp_path):
    for points in clouds_of(tmp_path / "rec", [WALL] * 11, close=(4, 5, 6)):
        assert points[:, 2].max() < 1.7


def test_what_little_somebody_leaves_of_a_wall_goes(tmp_path):
    assert clouds_of(tmp_path / "rec", [WALL] * 11, close=(3,))[3][:, 2].max() < 1.7


def test_a_quiet_sensor_keeps_what_lies_flat_on_a_table_and_a_noisy_one_still_loses_the_table(tmp_path):
    table, plate = wall(away_m=1.5), wall(away_m=1.482)
    rows, columns = np.indices(table.shape)
    image = np.where((abs(rows - 120) < 40) & (abs(columns - 160) < 40), plate, table)
    recording, instant = recorded(tmp_path / "quiet", image)
    assert fuse(recording, instant, region=EVERYWHERE).points[:, 2].max() < 1.49
    noisy = image + np.random.default_rng(3).normal(0.0, 0.009, image.shape)
    camera, noisy = SENSOR.camera, noisy.astype(np.float32)
    left = [
        np.count_nonzero(without_planes(noisy, camera, planes))
        for planes in (large_planes(noisy, camera), (LargePlane(np.array([0.0, 0.0, -1.0, 1.5])),))
    ]
    assert left[0] < 0.3 * left[1]


def test_what_is_compiled_takes_out_what_a_plane_says_is_on_it():
    image, planes = scene(FLOOR, WALL, ball(0.0, 0.0, 1.6, RADIUS_M)), []
    for equation, noise in (([0.0, -0.78, -0.62, 0.62], 0.7), ([0.05, 0.0, -1.0, 2.45], 1.3)):
        planes.append(LargePlane(np.array(equation), noise))
    points = backproject(SENSOR.camera, image)
    expected = np.where(np.any([np.abs(one.off(points)) < 1.0 for one in planes], axis=0), 0.0, image)
    left = without_planes(image, SENSOR.camera, tuple(planes))
    assert 0 < np.count_nonzero(expected) < np.count_nonzero(image)
    assert np.array_equal(left, clean_depth(expected.astype(np.float32), SENSOR.camera))


def test_a_plane_through_somebody_is_no_wall():
    row = [ball(x, 0.1 * (-1.0) ** k, 2.0, 0.25) for k, x in enumerate(np.linspace(-0.7, 0.7, 5))]
    image = scene(*row, *[ball(x, 0.5, 2.1, 0.25) for x in np.linspace(-0.7, 0.7, 5)])
    assert not large_planes(image, SENSOR.camera)
