import re

import numpy as np
import pytest

from capture.camera import Camera
from capture.cloud.background import largest_plane
from capture.cloud.motion import gone_share
from capture.cloud.region import automatic_region, find_region, person_points
from capture.errors import CloudError
from capture.provenance import region_used, sensors_in_words
from capture.recording import (
    Calibration,
    RecordingWriter,
    Sensor,
    SensorCalibration,
    open_recording,
    read_depth,
    write_calibration_file,
)
from capture.rigid import apply, inverse
from tests.analytic_depth import plane, quantised, sphere
from tests.two_sensors import AXIS, HALF_LENGTH, RADIUS, limb_depth, poses, write_limb

CAMERA = Camera(320, 240, 260.0, 260.0, 159.5, 119.5)
SENSOR = Sensor("s", CAMERA)


def scene(*surfaces):
    """The nearest of several depth images (0 = nothing)."""
    stack = np.stack([np.where(surface > 0, surface, np.inf) for surface in surfaces])
    nearest = stack.min(axis=0)
    return quantised(np.where(np.isfinite(nearest) & (nearest < 4.0), nearest, 0.0))


def ball(x, y, z, radius):
    return sphere(CAMERA, np.array([x, y, z]), radius)


FLOOR = plane(CAMERA, np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.8, 1.0]))
WALL = plane(CAMERA, np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, 2.5]))


def test_a_limb_that_is_alone_in_view_is_found_with_a_margin(tmp_path):
    region = automatic_region(write_limb(tmp_path / "rec"))
    ends = np.array([-1.0, 1.0])[:, None] * HALF_LENGTH * AXIS
    assert (region.minimum < ends.min(axis=0)).all()
    assert (region.maximum > ends.max(axis=0)).all()
    assert (region.maximum - region.minimum < 2 * (HALF_LENGTH + RADIUS) + 0.25).all()


def test_floor_and_wall_are_not_the_person():
    points = person_points(scene(FLOOR, WALL, ball(0.0, 0.0, 1.5, 0.25)), SENSOR)
    assert len(points)
    assert np.abs(np.linalg.norm(points - [0.0, 0.0, 1.5], axis=1) - 0.25).max() < 0.02


def test_a_fist_towards_the_sensor_belongs_to_the_person():
    points = person_points(scene(ball(0.0, 0.0, 1.5, 0.25), ball(0.0, 0.1, 0.9, 0.05)), SENSOR)
    assert points[:, 2].min() < 0.9
    assert points[:, 2].max() > 1.3


def test_somebody_behind_is_left_out():
    points = person_points(scene(ball(-0.3, 0.0, 1.4, 0.25), ball(0.5, 0.0, 2.6, 0.3)), SENSOR)
    assert points[:, 2].max() < 1.6


@pytest.mark.parametrize("radius", [0.09, 0.07])
def test_a_bystander_nearer_to_one_sensor_is_not_in_the_region(tmp_path, radius):
    camera, bystander = Camera(320, 240, 160.0, 160.0, 159.5, 119.5), np.array([0.70, 0.0, -0.11])
    where = poses()
    with RecordingWriter(
        tmp_path / "rec", sensors=[Sensor(name, camera) for name in where], created_by="test"
    ) as writer:
        for name, pose in where.items():
            other = sphere(camera, apply(inverse(pose), bystander[None])[0], radius)
            writer.add_frame(name, scene(limb_depth(pose, camera), other), 0.0)
    write_calibration_file(
        tmp_path / "rec", Calibration({name: SensorCalibration(pose, 0.5) for name, pose in where.items()})
    )
    recording = open_recording(tmp_path / "rec")
    sensor = recording.sensor("left")
    assert person_points(read_depth(sensor, sensor.frames[0]), sensor)[:, 2].max() < 1.0  # the bystander
    region = automatic_region(recording)
    assert region.maximum[0] < bystander[0] - radius
    assert (region.minimum < -HALF_LENGTH * AXIS).all()
    assert (region.maximum > HALF_LENGTH * AXIS).all()


def test_a_recording_of_an_empty_room_is_an_error(tmp_path):
    with RecordingWriter(tmp_path / "rec", sensors=[SENSOR], created_by="test") as writer:
        writer.add_frame("s", scene(WALL), 0.0)
    with pytest.raises(CloudError, match=r"rec: no person found .* 0\.00 s"):
        automatic_region(open_recording(tmp_path / "rec"))


def test_the_plane_with_the_most_points_is_found():
    random = np.random.default_rng(2)
    on_plane = np.column_stack([random.uniform(-1, 1, (400, 2)), 0.5 + random.normal(0, 0.003, 400)])
    found = largest_plane(np.concatenate([on_plane, random.uniform(-1, 1, (300, 3))]))
    np.testing.assert_allclose(found * np.sign(found[2]), [0.0, 0.0, 1.0, -0.5], atol=0.02)


def two_people(path):
    with RecordingWriter(path, sensors=[SENSOR], created_by="test") as writer:
        writer.add_frame("s", scene(ball(-0.6, 0.0, 1.4, 0.25), ball(0.7, 0.0, 1.8, 0.25)), 0.0)
    return open_recording(path)


def test_of_two_people_the_one_near_the_stated_point_is_kept(tmp_path):
    recording = two_people(tmp_path / "rec")
    for x, z in ((-0.6, 1.4), (0.7, 1.8)):
        region = automatic_region(recording, near=np.array([x, 0.0, z]))
        assert region.minimum[0] < x < region.maximum[0]
        assert region.maximum[0] - region.minimum[0] < 0.8


def test_a_room_that_grew_together_with_the_person_is_refused_with_its_size(tmp_path):
    row = [ball(0.35 * k, 0.0, 2.6, 0.25) for k in range(-4, 5)]
    with RecordingWriter(tmp_path / "rec", sensors=[SENSOR], created_by="test") as writer:
        writer.add_frame("s", scene(*row), 0.0)
    with pytest.raises(CloudError, match=r"larger than a person; .*--region"):
        automatic_region(open_recording(tmp_path / "rec"))


def swinging(path, *centres, frames=6, sway=(0.06, 0.06)):
    """Balls that swing to and fro, each as far as is stated (m), before one sensor."""
    with RecordingWriter(path, sensors=[SENSOR], created_by="test") as writer:
        for frame in range(frames):
            aside = [far if frame % 2 else -far for far in sway]
            balls = [ball(x + a, y, z, r) for (x, y, z, r), a in zip(centres, aside, strict=True)]
            writer.add_frame("s", scene(*balls), frame / 10.0)
    return open_recording(path)


LEFT, RIGHT = (-0.6, 0.0, 1.5, 0.25), (0.6, 0.0, 1.8, 0.25)


def test_two_who_move_are_asked_about_and_each_is_found_by_the_place_that_is_named(tmp_path):
    recording = swinging(tmp_path / "rec", LEFT, RIGHT)
    with pytest.raises(CloudError, match=r"2 could be meant, at .*--near X Y Z.*--region") as raised:
        automatic_region(recording)
    places = [np.array(found.split(), float) for found in re.findall(r"at ((?:-?\d\.\d\d ?){3})", str(raised.value))]
    for (x, *_), place in zip((LEFT, RIGHT), places, strict=True):
        region = automatic_region(recording, near=place)
        assert region.minimum[0] < x < region.maximum[0]
        assert region.maximum[0] - region.minimum[0] < 1.0


@pytest.mark.parametrize("still", [0, 1])
def test_of_two_the_one_who_moves_is_taken_and_the_other_is_told_of(tmp_path, still):
    sway = [0.06, 0.06]
    sway[still] = 0.0
    found = find_region(swinging(tmp_path / "rec", LEFT, RIGHT, sway=sway))
    x = (RIGHT, LEFT)[still][0]
    assert found.region.minimum[0] < x < found.region.maximum[0]
    assert found.region.maximum[0] - found.region.minimum[0] < 1.0
    (line,) = found.left_out
    told = re.match(r"what does not move at (-?\d\.\d\d)", line)
    assert told
    assert abs(float(told[1]) - (LEFT, RIGHT)[still][0]) < 0.05


def test_an_arm_before_somebody_much_larger_who_moves_is_asked_about(tmp_path):
    big = [(0.6, y, 2.6, 0.4) for y in (-0.3, 0.3)]
    recording = swinging(tmp_path / "rec", (-0.3, 0.0, 1.2, 0.14), *big, sway=(0.06, 0.06, 0.06))
    with pytest.raises(CloudError, match="2 could be meant"):
        automatic_region(recording)


def test_what_is_small_or_rarely_there_is_not_asked_about(tmp_path):
    assert not find_region(swinging(tmp_path / "small", LEFT, (0.6, 0.0, 1.8, 0.1))).left_out
    recording = swinging(tmp_path / "passing", LEFT, RIGHT, frames=12)
    with RecordingWriter(tmp_path / "rare", sensors=[SENSOR], created_by="test") as writer:
        for number, frame in enumerate(recording.sensors[0].frames):
            alone = scene(ball(-0.6 + (0.06 if number % 2 else -0.06), 0.0, 1.5, 0.25))
            shown = read_depth(recording.sensors[0], frame) if number < 2 else alone
            writer.add_frame("s", shown, number / 10.0)
    assert not find_region(open_recording(tmp_path / "rare")).left_out


def test_noise_and_what_hides_it_for_a_while_are_not_motion():
    random = np.random.default_rng(1)
    first, second = scene(ball(0.3, 0.0, 2.5, 0.3)), scene(ball(0.3, 0.0, 2.5, 0.3), ball(0.15, 0.0, 1.2, 0.1))
    points = person_points(first, SENSOR)
    noisy = np.where(second > 0.0, second + random.normal(0.0, 0.003, second.shape) * second**2, 0.0)
    noisy[random.random(second.shape) < 0.1] = 0.0
    assert gone_share(points, CAMERA, noisy.astype(np.float32)) < 0.01
    assert gone_share(points, CAMERA, scene(ball(0.5, 0.0, 2.5, 0.3))) > 0.2


def test_settings_tell_what_was_left_out(tmp_path):
    recording = swinging(tmp_path / "rec", LEFT, RIGHT, sway=(0.06, 0.0))
    (line,) = sensors_in_words(region_used(recording, None))
    assert line.startswith("left out of the region: what does not move at 0.5")
    assert not sensors_in_words(region_used(recording, find_region(recording).region))


def test_a_cup_on_a_table_is_nobody(tmp_path):
    with RecordingWriter(tmp_path / "rec", sensors=[SENSOR], created_by="test") as writer:
        writer.add_frame("s", scene(FLOOR, WALL, ball(0.0, 0.0, 0.8, 0.055)), 0.0)
    with pytest.raises(CloudError, match=r"\d+ x \d+ x \d+ cm, smaller than a limb; .*--unit-mm"):
        automatic_region(open_recording(tmp_path / "rec"))
