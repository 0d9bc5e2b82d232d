"""A camera of the RealSense SDK, played by its software device, is recorded as it looks."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
from click.testing import CliRunner

from capture.commands import record_command
from capture.errors import RecordingError
from capture.importers import ShownBox
from capture.libusb import load_libusb
from capture.live import connected, record
from tests.sensor_files import scene
from tests.test_import_files import images

load_libusb()
rs = pytest.importorskip("pyrealsense2")


class Player:
    """A software device that shows the scene, 50 frames a second, until it is stopped."""

    def __init__(self, domain=None, *, start_s: float = 5.0, skip_every: int = 10**6):
        from tests.sensor_files.make_realsense import _sensor

        self.device = rs.software_device()
        self.sensor, self.profile = _sensor(self.device, "Depth", rs.stream.depth, rs.format.z16, 2, 0)
        self.sensor.add_read_only_option(rs.option.depth_units, scene.DEPTH_UNIT_M)
        self.domain = domain or rs.timestamp_domain.hardware_clock
        self.start_s, self.skip_every, self.done = start_s, skip_every, threading.Event()
        self.thread = threading.Thread(target=self._play)

    def __enter__(self):
        self.thread.start()
        return self.device

    def __exit__(self, *_):
        self.done.set()
        self.thread.join()

    def _play(self):
        number = 0
        while not self.done.is_set():
            time.sleep(0.02)
            number += 1
            if number % self.skip_every == 0:
                continue
            frame = rs.software_video_frame()
            image = scene.readings(number % 3)
            frame.pixels, frame.stride, frame.bpp = image, image.strides[0], 2
            frame.timestamp, frame.domain, frame.frame_number = (
                1000.0 * self.start_s + 20.0 * number,
                self.domain,
                number,
            )
            frame.profile, frame.depth_units = self.profile.as_video_stream_profile(), scene.DEPTH_UNIT_M
            self.sensor.on_video_frame(frame)


def test_frames_reach_the_recording_with_times_unit_and_camera(tmp_path):
    told = []
    with Player() as device:
        recording = record([device], tmp_path / "rec", seconds=0.3, progress=lambda *now: told.append(now))
    (sensor,) = recording.sensors
    assert (sensor.camera.fx, sensor.camera.cx, sensor.depth_unit_m) == (scene.FX, scene.CX, scene.DEPTH_UNIT_M)
    times = np.array([frame.time_s for frame in sensor.frames])
    assert times[0] == 0.0
    np.testing.assert_allclose(np.diff(times), 0.02, atol=1e-6)
    assert len(times) == 15
    shown = [scene.readings(frame) for frame in range(3)]
    first = next(index for index in range(3) if (images(recording)[0] == shown[index]).all())
    for index, image in enumerate(images(recording)):
        np.testing.assert_array_equal(image, shown[(first + index) % 3])
    assert told[-1][1:] == (15, 0)


def test_what_is_shown_first_is_the_boxs(tmp_path):
    with Player() as device:
        box = ShownBox((0.3, 0.2, 0.15), seconds=(0.0, 0.09))
        recording = record([device], tmp_path / "rec", seconds=0.2, box=box)
    (sensor,) = recording.sensors
    assert recording.box_size_m == (0.3, 0.2, 0.15)
    assert (len(sensor.box_frames), len(sensor.frames)) == (5, 5)
    assert sensor.frames[0].time_s == pytest.approx(0.1)


def test_two_cameras_with_one_clock_become_two_sensors(tmp_path):
    domain = rs.timestamp_domain.system_time
    with Player(domain) as left, Player(domain, start_s=5.005) as right:
        recording = record([left, right], tmp_path / "rec", seconds=0.2, sensor_names=["left", "right"])
    assert [sensor.name for sensor in recording.sensors] == ["left", "right"]
    assert all(len(sensor.frames) >= 5 for sensor in recording.sensors)


def test_cameras_without_a_common_clock_are_refused(tmp_path):
    with Player() as left, Player() as right, pytest.raises(RecordingError, match="share no clock"):
        record([left, right], tmp_path / "rec", seconds=0.2)
    assert (tmp_path / "rec" / "recording.unfinished.json").exists()


def test_frames_that_never_came_are_counted(tmp_path):
    told = []
    with Player(skip_every=7) as device:
        recording = record([device], tmp_path / "rec", seconds=0.4, progress=lambda *now: told.append(now))
    gaps = np.diff([frame.time_s for frame in recording.sensors[0].frames]) / 0.02
    assert told[-1][2] == round(gaps.sum()) - len(gaps) >= 2


def test_what_was_recorded_stays_when_it_is_ended_early(tmp_path):
    def stop(_: float, written: int, __: int) -> None:
        if written == 4:
            raise KeyboardInterrupt

    with Player() as device:
        assert len(record([device], tmp_path / "rec", seconds=60.0, progress=stop).sensors[0].frames) == 4


def test_no_camera_is_one_clear_line(tmp_path):
    with pytest.raises(RecordingError, match="no RealSense camera"):
        connected(tmp_path / "rec")


def test_the_command_says_how_much_it_recorded(tmp_path, monkeypatch):
    with Player() as device:
        monkeypatch.setattr("capture.live.connected", lambda _: [device])
        result = CliRunner().invoke(record_command, ["--out", str(tmp_path / "rec"), "--seconds", "0.2"])
    assert result.exit_code == 0, result.output
    assert "10 frames of 64 x 48 px, unit 0.5 mm, fx 60.0 px" in result.output


def test_a_box_without_the_time_it_is_shown_is_refused_by_what_record_has(tmp_path):
    told = ["--out", str(tmp_path / "rec"), "--seconds", "1", "--box", "0.3", "0.2", "0.1"]
    result = CliRunner().invoke(record_command, told)
    assert result.exit_code == 2
    assert "--box-seconds" in result.output
    assert "--box-source" not in result.output
