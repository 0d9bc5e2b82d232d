"""Floor and walls are left out of the clouds of a recording, and a person who is all there is stays whole."""

from __future__ import annotations

import numpy as np

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
