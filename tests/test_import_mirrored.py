"""Images that a driver mirrored come in true: a point of the scene is where it is, and a right hand is a right hand."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from capture.camera import Camera, backproject
from capture.commands import import_command
from capture.errors import RecordingError
from capture.importers import ImportOptions, UserCamera, import_recording
from capture.importers.mirror import unmirrored_camera
from capture.projection import project
from capture.recording import RecordingWriter, Sensor, open_recording, read_depth
from tests.sensor_files import scene
from tests.test_import_files import FILES, images
from tests.test_import_folders import STATED, write_images

LENS = (0.1, -0.05, 0.01, -0.02, 0.03, 0.02, 0.01, -0.01, 0.005, -0.004, 0.006, 0.003, 0.05, -0.07)


@pytest.mark.parametrize("count", [0, 4, 5, 8, 12, 14])
def test_a_mirrored_point_falls_on_the_mirrored_pixel_whatever_the_lens(count):
    camera = Camera(64, 48, 60.0, 62.0, 30.0, 25.0, LENS[:count])
    points = np.random.default_rng(0).uniform((-0.4, -0.3, 0.8), (0.4, 0.3, 1.2), (50, 3))
    seen, _ = project(camera, points)
    mirrored, _ = project(unmirrored_camera(camera), points * (-1.0, 1.0, 1.0))
    np.testing.assert_allclose(mirrored, [63.0, 0.0] + seen * [-1.0, 1.0], atol=1e-9)
    assert unmirrored_camera(unmirrored_camera(camera)) == camera


def test_mirrored_images_come_in_true_with_the_camera_and_a_note(tmp_path):
    folder = tmp_path / "mirrored"
    folder.mkdir()
    for frame in range(3):
        cv2.imwrite(str(folder / f"{frame}.png"), scene.readings(frame)[:, ::-1])
    stated = UserCamera(fx=60.0, cx=30.0, distortion=(0.1, 0.0, 0.01, -0.02), mirrored=True)
    recording = import_recording(folder, tmp_path / "rec", ImportOptions(cameras=stated))
    (sensor,) = recording.sensors
    for frame, image in enumerate(images(recording)):
        np.testing.assert_array_equal(image, scene.readings(frame))
    assert sensor.mirrored
    assert (sensor.camera.cx, sensor.camera.distortion) == (33.0, (0.1, 0.0, 0.01, 0.02))
    assert "turned back" in recording.created_by

    plain = import_recording(
        folder, tmp_path / "plain", ImportOptions(cameras=UserCamera(fx=60.0, cx=30.0, distortion=stated.distortion))
    )
    assert not plain.sensors[0].mirrored
    true, false = (backproject(one.camera, read_depth(one, one.frames[0])) for one in (sensor, plain.sensors[0]))
    np.testing.assert_allclose(true, false[:, ::-1] * (-1.0, 1.0, 1.0), atol=1e-6)


def test_the_colour_images_beside_mirrored_depth_are_turned_too(tmp_path):
    folder = write_images(tmp_path / "folder", colour="color")
    recording = import_recording(
        folder, tmp_path / "rec", ImportOptions(cameras=UserCamera(fx=scene.FX, mirrored=True))
    )
    colour = recording.sensors[0].colour
    np.testing.assert_array_equal(cv2.imread(str(colour.frames[0].path))[..., ::-1], scene.colour(0)[:, ::-1])
    assert colour.camera == recording.sensors[0].camera


def test_clouds_are_mirrored_in_x(tmp_path):
    camera = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
    points = backproject(camera, scene.readings(0).astype(float) * 1e-3).reshape(-1, 3)
    points = points[np.isfinite(points).all(axis=1)]
    lines = "\n".join(" ".join(f"{value:.9f}" for value in point) for point in points * (-1.0, 1.0, 1.0))
    header = f"ply\nformat ascii 1.0\nelement vertex {len(points)}\n" + "".join(
        f"property float {axis}\n" for axis in "xyz"
    )
    (tmp_path / "cloud.ply").write_text(f"{header}end_header\n{lines}\n")
    stated = UserCamera(fx=60.0, size=(64, 48), mirrored=True)
    (image,) = images(import_recording(tmp_path / "cloud.ply", tmp_path / "rec", ImportOptions(cameras=stated)))
    np.testing.assert_array_equal(image, scene.readings(0) * 10)


def test_a_file_that_says_that_it_is_mirrored_is_turned_once(tmp_path):
    name = FILES / "openni-mirrored-jpeg.oni"
    by_itself = import_recording(name, tmp_path / "a")
    asked = import_recording(name, tmp_path / "b", ImportOptions(cameras=UserCamera(mirrored=True)))
    assert by_itself.sensors[0].mirrored
    assert by_itself.sensors[0].camera == asked.sensors[0].camera
    np.testing.assert_array_equal(images(by_itself)[0], images(asked)[0])
    assert not import_recording(FILES / "openni.oni", tmp_path / "c").sensors[0].mirrored


def test_a_camera_stated_for_a_mirrored_file_is_that_of_its_images(tmp_path):
    stated = UserCamera(fx=60.0, cx=40.0)
    camera = (
        import_recording(FILES / "openni-mirrored-jpeg.oni", tmp_path / "rec", ImportOptions(cameras=stated))
        .sensors[0]
        .camera
    )
    assert camera.cx == scene.WIDTH - 1 - 40.0


def test_the_command_turns_them(tmp_path):
    folder = write_images(tmp_path / "folder")
    arguments = [str(folder), "--out", str(tmp_path / "rec"), "--fx", "60", "--mirrored"]
    result = CliRunner().invoke(import_command, arguments)
    assert result.exit_code == 0, result.output
    assert "turned back" in " ".join(result.output.split())
    np.testing.assert_array_equal(images(open_recording(tmp_path / "rec"))[0], scene.readings(0)[:, ::-1])


def test_the_note_is_read_back_checked_and_false_where_it_is_not_there(tmp_path):
    sensors = [Sensor("a", scene_camera(), mirrored=True), Sensor("b", scene_camera())]
    with RecordingWriter(tmp_path / "rec", sensors=sensors, created_by="test") as writer:
        writer.add_frame("a", scene.readings(0), 0.0)
    header = tmp_path / "rec" / "recording.json"
    assert [sensor.mirrored for sensor in open_recording(tmp_path / "rec").sensors] == [True, False]
    written = json.loads(header.read_text())
    assert "mirrored" not in written["sensors"][1]
    written["sensors"][0]["mirrored"] = "yes"
    header.write_text(json.dumps(written))
    with pytest.raises(RecordingError, match=r"mirrored' must be true or false, got 'yes'"):
        open_recording(tmp_path / "rec")


def scene_camera():
    return Camera(scene.WIDTH, scene.HEIGHT, STATED.fx, STATED.fx, 31.5, 23.5)
