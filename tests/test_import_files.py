"""Files of sensors become recordings; what is wrong with one is told in one line."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from capture.camera import Camera, backproject
from capture.commands import import_command
from capture.commands.import_files import _FORMAT_NAMES
from capture.errors import BonetrackError, RecordingError
from capture.importers import FORMATS, ImportOptions, UserCamera, import_recording
from capture.importers.azure_kinect import has_rays
from capture.importers.realsense import Lens, camera_of
from capture.projection import project
from capture.recording import Recording, colour_image, depth_png, open_recording, read_depth
from tests.sensor_files import scene

FILES = Path(__file__).parent / "sensor_files"
KINECT_MKV = Path(__file__).parents[2] / "shared" / "recordings" / "k4a_mkv_fixture" / "recording.mkv"


def images(recording: Recording) -> list[np.ndarray]:
    (sensor,) = recording.sensors
    size = {"width": sensor.camera.width, "height": sensor.camera.height}
    return [depth_png.read_readings(frame.path, **size) for frame in sensor.frames]


def refused(path: Path, tmp_path: Path, match: str, **options) -> None:
    with pytest.raises(BonetrackError, match=match) as raised:
        import_recording(path, tmp_path / "refused", ImportOptions(overwrite=True, **options))
    assert "\n" not in str(raised.value)
    assert path.name in str(raised.value)


def test_the_command_line_names_the_formats_of_the_table():
    assert tuple(format.name for format in FORMATS) == _FORMAT_NAMES


@pytest.mark.parametrize("name", ["realsense.bag", "realsense.db3"])
class TestRealSense:
    """The files were written by the RealSense SDK itself (sensor_files/make_realsense.py)."""

    @pytest.fixture(autouse=True)
    def _library(self, name):
        if name.endswith(".bag"):
            pytest.importorskip("rosbags")

    def test_every_frame_comes_once_with_its_own_time_and_unit(self, name, tmp_path):
        recording = import_recording(FILES / name, tmp_path / "rec")
        (sensor,) = recording.sensors
        assert sensor.depth_unit_m == scene.DEPTH_UNIT_M
        for frame, image in enumerate(images(recording)):
            np.testing.assert_array_equal(image, scene.readings(frame))
        times = [frame.time_s for frame in sensor.frames]
        np.testing.assert_allclose(times, [scene.time_s(frame) for frame in range(scene.FRAMES)], atol=1e-6)

    def test_whose_clock_the_times_are_by_is_told(self, name, tmp_path):
        recording = import_recording(FILES / name, tmp_path / "rec")
        assert "times by the file (the camera's own clock, which no other camera shares)" in recording.created_by

    def test_the_camera_and_where_the_colour_camera_stands_are_the_sdks(self, name, tmp_path):
        sensor = import_recording(FILES / name, tmp_path / "rec").sensors[0]
        camera = sensor.camera
        assert (camera.width, camera.height, camera.fx, camera.fy) == (scene.WIDTH, scene.HEIGHT, scene.FX, scene.FY)
        assert (camera.cx, camera.cy, camera.distortion) == (scene.CX, scene.CY, ())
        turn = np.deg2rad(scene.COLOUR_FROM_DEPTH_TURN_DEG)
        expected = np.eye(4)
        expected[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
        expected[:3, 3] = scene.COLOUR_FROM_DEPTH_SHIFT_M
        np.testing.assert_allclose(sensor.colour.colour_from_depth, expected, atol=1e-5)
        assert sensor.colour.camera.fx == scene.FX

    def test_colour_is_kept(self, name, tmp_path):
        colour = import_recording(FILES / name, tmp_path / "rec").sensors[0].colour
        assert len(colour.frames) == scene.FRAMES
        for index, frame in enumerate(colour.frames):
            np.testing.assert_array_equal(cv2.imread(str(frame.path))[..., ::-1], scene.colour(index))

    def test_a_file_without_depth_says_what_it_has(self, name, tmp_path):
        path = FILES / name.replace("realsense", "realsense-colour-only")
        refused(path, tmp_path, "no depth stream .*Color_0")

    def test_a_truncated_file_is_one_clear_line(self, name, tmp_path):
        data = (FILES / name).read_bytes()
        for part in (0.3, 0.9):
            cut = tmp_path / name
            cut.write_bytes(data[: int(part * len(data))])
            refused(cut, tmp_path, "truncated or damaged")

    def test_another_file_by_that_name_is_refused(self, name, tmp_path):
        (tmp_path / name).write_bytes(b"something else, and long enough to be looked at")
        refused(tmp_path / name, tmp_path, "not what its name says")
        refused(tmp_path / name, tmp_path, "damaged", format_name=name.replace(".", "-"))


def test_a_stated_camera_overrides_the_files(tmp_path):
    stated = UserCamera(fx=70.0, depth_unit_m=0.002)
    sensor = import_recording(FILES / "realsense.db3", tmp_path / "rec", ImportOptions(cameras=stated)).sensors[0]
    assert (sensor.camera.fx, sensor.camera.fy, sensor.camera.cx) == (70.0, 70.0, 31.5)
    assert sensor.depth_unit_m == 0.002


def test_a_file_with_several_depth_streams_is_refused(tmp_path):
    import sqlite3

    shutil.copy(FILES / "realsense.db3", tmp_path / "two.db3")
    with sqlite3.connect(tmp_path / "two.db3") as database:
        name = "/device_1/sensor_0/Depth_0/image/data/compressedDepth"
        database.execute("INSERT INTO topics VALUES (99, ?, 'x', 'cdr', '')", (name,))
    database.close()
    refused(tmp_path / "two.db3", tmp_path, "has 2 depth streams; record each sensor")
    data = (FILES / "openni.oni").read_bytes()
    image = b"\x06\x00\x00\x00Image\x00\x03\x00\x00\x00"
    assert image in data
    (tmp_path / "two.oni").write_bytes(data.replace(image, image[:-4] + b"\x02\x00\x00\x00"))
    refused(tmp_path / "two.oni", tmp_path, "has 2 depth streams; record each sensor")


def test_a_database_of_something_else_is_refused(tmp_path):
    import sqlite3

    with sqlite3.connect(tmp_path / "other.db3") as database:
        database.execute("CREATE TABLE people (name TEXT)")
    database.close()
    refused(tmp_path / "other.db3", tmp_path, "not a RealSense recording")


def test_an_inverse_distortion_is_undone_by_a_forward_one():
    coefficients = (0.12, -0.05, 0.002, -0.001, 0.01)
    camera = camera_of(Lens(640, 480, 476.0, 476.0, 313.0, 242.0, "Inverse Brown Conrady", coefficients), Path("x"))
    u, v = np.array([20.0, 320.0, 600.0]), np.array([30.0, 200.0, 460.0])
    x, y = (u - 313.0) / 476.0, (v - 242.0) / 476.0
    r2 = x * x + y * y
    k1, k2, p1, p2, k3 = coefficients
    scale = 1.0 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    ray_x = x * scale + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    ray_y = y * scale + 2.0 * p2 * x * y + p1 * (r2 + 2.0 * y * y)
    pixels, _ = project(camera, np.stack([ray_x, ray_y, np.ones(3)], axis=-1))
    np.testing.assert_allclose(pixels, np.stack([u, v], axis=-1), atol=0.2)


def test_a_lens_model_that_cannot_be_told_is_refused():
    with pytest.raises(RecordingError, match=r"Kannala.*--fx"):
        camera_of(Lens(640, 480, 476.0, 476.0, 313.0, 242.0, "Kannala Brandt4", (0.1, 0, 0, 0, 0)), Path("x"))


class TestAzureKinect:
    @pytest.fixture(autouse=True)
    def _library(self):
        pytest.importorskip("av")

    def write(self, tmp_path, **options) -> Path:
        from tests.sensor_files import azure_kinect

        return azure_kinect.write(tmp_path / "k4a.mkv", **options)

    def test_depth_times_and_colour_come_as_they_were_written(self, tmp_path):
        from tests.sensor_files import azure_kinect

        recording = import_recording(self.write(tmp_path), tmp_path / "rec")
        for frame, image in enumerate(images(recording)):
            np.testing.assert_array_equal(image, azure_kinect.readings(frame))
        (sensor,) = recording.sensors
        np.testing.assert_allclose([frame.time_s for frame in sensor.frames], [0.0, 0.033, 0.067], atol=1e-9)
        assert [frame.time_s for frame in sensor.colour.frames] == [frame.time_s for frame in sensor.frames]
        assert cv2.imread(str(sensor.colour.frames[0].path)).shape == (36, 64, 3)
        np.testing.assert_allclose(sensor.colour.colour_from_depth[:3, 3], [-0.032, -0.002, 0.004])

    def test_files_of_devices_joined_by_a_sync_cable_are_on_one_clock(self, tmp_path):
        from tests.sensor_files import azure_kinect

        def tags(sync, start_s):
            return {"K4A_WIRED_SYNC_MODE": sync, "K4A_START_OFFSET_NS": str(round(start_s * 1e9))}

        paths = [tmp_path / "master.mkv", tmp_path / "subordinate.mkv"]
        azure_kinect.write(paths[0], tags=tags("MASTER", 0.336277))
        azure_kinect.write(paths[1], tags=tags("SUBORDINATE", 0.380277))
        recording = import_recording(paths, tmp_path / "rec", ImportOptions(offset="clock"))
        first, second = (sensor.frames[0].time_s for sensor in recording.sensors)
        assert second - first == pytest.approx(0.044, abs=1e-6)
        assert "from 0.336277 s on, wired sync MASTER" in recording.created_by
        colour = recording.sensors[1].colour.frames[0].time_s
        assert colour == pytest.approx(second, abs=1e-6)

    def test_a_device_without_a_sync_cable_shares_no_clock(self, tmp_path):
        from tests.sensor_files import azure_kinect

        path = azure_kinect.write(tmp_path / "alone.mkv", tags={"K4A_WIRED_SYNC_MODE": "STANDALONE"})
        with pytest.raises(RecordingError, match=r"STANDALONE, .* shares no clock .*--offset motion"):
            import_recording([path, path], tmp_path / "rec", ImportOptions(offset="clock"))

    def test_the_lens_is_that_of_the_mode(self, tmp_path):
        camera = import_recording(self.write(tmp_path), tmp_path / "rec").sensors[0].camera
        # Half the sensor's resolution, begun 96 and 90 px in; OpenCV counts from the corner pixel's centre.
        assert (camera.fx, camera.fy) == pytest.approx((0.49 * 512, 0.48 * 512))
        assert (camera.cx, camera.cy) == pytest.approx((0.51 * 512 - 96.5, 0.52 * 512 - 90.5))
        assert camera.distortion == (0.5, -0.02, 2e-5, -7e-5, -0.003, 0.9, 0.08, -0.01)

    def test_without_depth_it_says_which_tracks_there_are(self, tmp_path):
        refused(self.write(tmp_path, tracks=("COLOR",)), tmp_path, "no depth stream .*COLOR")

    def test_without_calibration_the_focal_length_is_asked_for(self, tmp_path):
        path = self.write(tmp_path, calibration=None)
        refused(path, tmp_path, "focal length.*--fx")
        stated = UserCamera(fx=252.0)
        assert import_recording(path, tmp_path / "rec", ImportOptions(cameras=stated)).sensors[0].camera.fx == 252.0

    @pytest.mark.parametrize(
        ("lens", "match"),
        [
            ({"ModelType": "something"}, "lens model"),
            ({"ModelParameters": [1, 2]}, "2 parameters"),
            ({"ModelParameters": "x"}, "list of numbers"),
            ({"ModelParameters": [0.5, 0.5, -1.0, 0.5] + [0.0] * 10}, "focal length"),
            ({"delete": ("ModelParameters",)}, "missing"),
        ],
    )
    def test_a_wrong_calibration_is_one_clear_line(self, tmp_path, lens, match):
        from tests.sensor_files import azure_kinect

        refused(self.write(tmp_path, calibration=azure_kinect.changed(**lens)), tmp_path, match)

    @pytest.mark.parametrize("text", ["{", "[1]", '{"CalibrationInformation": 3}', "[" * 100_000])
    def test_a_calibration_that_is_none_is_one_clear_line(self, tmp_path, text):
        refused(self.write(tmp_path, calibration=text), tmp_path, "JSON|must be an object")

    def test_truncated_or_empty_files_are_one_clear_line(self, tmp_path):
        path = self.write(tmp_path)
        data = path.read_bytes()
        for size in (40, 3000, len(data) // 2):
            path.write_bytes(data[:size])
            refused(path, tmp_path, "damaged|no depth|focal length")
        refused(self.write(tmp_path, with_frames=False), tmp_path, "no depth frames|damaged")

    def test_corners_of_wide_images_that_the_lens_does_not_reach_have_no_depth(self):
        # The factory's numbers of a real sensor, in its wide mode.
        lens = (0.547940, -0.0209714, 2.0558e-05, -7.2104e-05, -0.00265223, 0.889679, 0.0861302, -0.0139104)
        camera = Camera(512, 512, 252.304, 252.366, 262.141, 264.165, lens)
        known = has_rays(camera, 1.74)
        assert not known[[0, 0, -1, -1], [0, -1, 0, -1]].any()
        v, u = np.mgrid[:512, :512]
        assert known[np.hypot((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy) < 1.01].all()

    @pytest.mark.skipif(not KINECT_MKV.is_file(), reason="the real recording is not at hand")
    def test_a_real_recording_becomes_points_that_project_back(self, tmp_path):
        recording = import_recording(KINECT_MKV, tmp_path / "rec")
        (sensor,) = recording.sensors
        assert (sensor.camera.fx, sensor.camera.fy) == pytest.approx((504.608, 504.733), abs=1e-3)
        assert (sensor.camera.cx, sensor.camera.cy) == pytest.approx((332.781, 348.830), abs=1e-3)
        depth = read_depth(sensor, sensor.frames[0])
        assert (depth > 0).mean() > 0.7
        points = backproject(sensor.camera, depth)
        seen = depth > 0
        pixels, _ = project(sensor.camera, points[seen])
        v, u = np.nonzero(seen)
        assert np.abs(pixels - np.stack([u, v], axis=-1)).max() < 0.01
        assert len(sensor.colour.frames) == 1


def test_a_folder_in_place_of_a_file_is_refused(tmp_path):
    (tmp_path / "empty").mkdir()
    refused(tmp_path / "empty", tmp_path, "empty folder")
    for name in ("azure-kinect", "realsense-bag", "realsense-db3"):
        refused(tmp_path / "empty", tmp_path, "is a folder; name the", format_name=name)


def test_an_empty_file_and_a_missing_one_are_refused(tmp_path):
    for format in FORMATS:
        path = tmp_path / f"empty{(*format.suffixes, '.raw')[0]}"
        path.write_bytes(b"")
        refused(path, tmp_path, "is an empty file")
    refused(tmp_path / "nowhere.bag", tmp_path, "does not exist")


@pytest.mark.parametrize(
    ("suffix", "library", "extra"), [("bag", "rosbags.rosbag1", "realsense"), ("mkv", "av", "azure-kinect")]
)
def test_a_missing_library_is_named_with_its_extra(tmp_path, monkeypatch, suffix, library, extra):
    monkeypatch.setitem(__import__("sys").modules, library, None)
    path = tmp_path / f"x.{suffix}"
    path.write_bytes(b"#ROSBAG V2.0\n" if suffix == "bag" else b"\x1a\x45\xdf\xa3\x80\x18\x53\x80\x67\xff")
    refused(path, tmp_path, rf"needs the Python package .* pip install 'bonetrack\[{extra}\]'")


def test_the_command_tells_what_it_made(tmp_path):
    result = CliRunner().invoke(import_command, [str(FILES / "realsense.db3"), "--out", str(tmp_path / "rec")])
    assert result.exit_code == 0, result.output
    assert "6 frames of 64 x 48 px, unit 0.5 mm, fx 60.0 px, 6 colour images" in result.output
    assert "times by the file" in result.output


class TestColourInARecording:
    def test_a_recording_without_colour_reads_as_before(self, tmp_path):
        shutil.copytree(import_recording(FILES / "realsense.db3", tmp_path / "rec").path, tmp_path / "old")
        header = json.loads((tmp_path / "old" / "recording.json").read_text())
        del header["sensors"][0]["colour"]
        (tmp_path / "old" / "recording.json").write_text(json.dumps(header))
        assert open_recording(tmp_path / "old").sensors[0].colour is None

    def test_overwriting_removes_old_colour(self, tmp_path):
        from tests.two_sensors import write_limb

        import_recording(FILES / "realsense.db3", tmp_path / "rec", ImportOptions(sensor_names=["left"]))
        assert (tmp_path / "rec" / "left" / "colour.csv").exists()
        import_recording(
            FILES / "realsense.db3", tmp_path / "rec", ImportOptions(sensor_names=["other"], overwrite=True)
        )
        assert not list((tmp_path / "rec" / "left").iterdir())
        assert write_limb(tmp_path / "new").sensors[0].colour is None

    @pytest.mark.parametrize(
        ("data", "match"),
        [
            (b"", "no whole JPEG"),
            (b"\xff\xd8\xff\xe0\x00\x10", "no whole JPEG"),
            (b"\xff\xd8\xff\xc0\x00\x11\x08\xff\xff\xff\xff\x03", "impossible size, 65535 x 65535"),
            (b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR" + b"\x7f" * 17, "impossible size"),
        ],
    )
    def test_an_image_that_is_none_or_claims_to_be_enormous_is_refused(self, data, match):
        with pytest.raises(RecordingError, match=match):
            colour_image.encoded(data, where=Path("x"))


def test_a_depth_image_that_claims_more_than_it_can_hold_is_refused_before_memory_is_reserved(tmp_path):
    import struct
    import zlib

    def chunk(name, content):
        body = name + content
        return struct.pack(">I", len(content)) + body + struct.pack(">I", zlib.crc32(body))

    def png(width, height):
        header = struct.pack(">IIBBBBB", width, height, 16, 0, 0, 0, 0)
        content = zlib.compress(bytes(1000))
        return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", content) + chunk(b"IEND", b"")

    path = tmp_path / "bomb.png"
    path.write_bytes(png(16384, 16384))
    refused(path, tmp_path, "impossible size", cameras=UserCamera(fx=500.0))
    path.write_bytes(png(5000, 5000))
    refused(path, tmp_path, "too short for the size", cameras=UserCamera(fx=500.0))
