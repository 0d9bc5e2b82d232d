import json
import struct
import zlib

import cv2
import numpy as np
import pytest

from capture.camera import Camera
from capture.errors import CalibrationError, RecordingError
from capture.recording import (
    RecordingWriter,
    Region,
    Sensor,
    instants,
    open_recording,
    read_depth,
    world_from_sensor,
)
from tests.two_sensors import FRAMES, poses, write_limb

CAMERA = Camera(40, 30, 50.0, 50.0, 19.5, 14.5)


@pytest.fixture
def written(tmp_path):
    readings = np.random.default_rng(0).integers(400, 4000, (2, 30, 40)).astype(np.uint16)
    with RecordingWriter(tmp_path / "rec", sensors=[Sensor("left", CAMERA)], created_by="test") as writer:
        writer.add_frame("left", readings[0], 0.0)
        writer.add_frame("left", readings[1], 0.5)
        writer.add_box_frame("left", readings[0], 0.0)
        writer.set_box((0.3, 0.2, 0.15))
        writer.set_region(Region(np.zeros(3), np.ones(3)))
        writer.set_truth({"pose_rad": np.arange(3.0)})
    return tmp_path / "rec", readings


def change(path, edit):
    content = json.loads(path.read_text())
    edit(content)
    path.write_text(json.dumps(content))


def test_what_was_written_is_read_back(written):
    path, readings = written
    recording = open_recording(path)
    (sensor,) = recording.sensors
    assert sensor.camera == CAMERA
    assert [frame.time_s for frame in sensor.frames] == [0.0, 0.5]
    assert recording.box_size_m == (0.3, 0.2, 0.15)
    np.testing.assert_array_equal(recording.region.maximum, np.ones(3))
    np.testing.assert_allclose(read_depth(sensor, sensor.frames[1]), readings[1] * 1e-3, rtol=1e-6)
    np.testing.assert_allclose(read_depth(sensor, sensor.box_frames[0]), readings[0] * 1e-3, rtol=1e-6)
    np.testing.assert_array_equal(np.load(recording.truth_path)["pose_rad"], np.arange(3.0))


def test_metres_are_rounded_to_units_and_nonsense_is_no_reading(tmp_path):
    depth = np.full((30, 40), 1.23449)
    depth[0, :4] = np.nan, np.inf, -1.0, 70.0
    with RecordingWriter(tmp_path / "rec", sensors=[Sensor("s", CAMERA)], created_by="test") as writer:
        writer.add_frame("s", depth, 0.0)
    (sensor,) = open_recording(tmp_path / "rec").sensors
    back = read_depth(sensor, sensor.frames[0])
    assert (back[0, :4] == 0.0).all()
    assert back[5, 5] == pytest.approx(1.234)


def test_readings_outside_the_range_do_not_count(tmp_path):
    readings = np.full((30, 40), 1000, dtype=np.uint16)
    readings[0, :4] = 399, 400, 4000, 4001
    with RecordingWriter(tmp_path / "rec", sensors=[Sensor("s", CAMERA)], created_by="test") as writer:
        writer.add_frame("s", readings, 0.0)
    (sensor,) = open_recording(tmp_path / "rec").sensors
    np.testing.assert_allclose(read_depth(sensor, sensor.frames[0])[0, :4], [0.0, 0.4, 4.0, 0.0])


def test_a_writer_that_was_stopped_leaves_no_recording(tmp_path):
    def stopped():
        with RecordingWriter(tmp_path / "rec", sensors=[Sensor("s", CAMERA)], created_by="test") as writer:
            writer.add_frame("s", np.ones((30, 40)), 0.0)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped()
    with pytest.raises(RecordingError, match="never finished"):
        open_recording(tmp_path / "rec")


def test_only_a_recording_is_overwritten_and_only_on_request(written):
    path, _ = written
    (path / "notes.txt").write_text("mine")
    sensors = [Sensor("other", CAMERA)]
    with pytest.raises(RecordingError, match="already"):
        RecordingWriter(path, sensors=sensors, created_by="test")
    with RecordingWriter(path, sensors=sensors, created_by="test", overwrite=True) as writer:
        writer.add_frame("other", np.ones((30, 40)), 0.0)
    assert [sensor.name for sensor in open_recording(path).sensors] == ["other"]
    assert not list((path / "left").glob("*"))
    assert not (path / "truth.npz").exists()
    assert (path / "notes.txt").read_text() == "mine"


def test_a_folder_of_something_else_is_never_overwritten(tmp_path):
    (tmp_path / "thesis.txt").write_text("years of work")
    with pytest.raises(RecordingError, match="not a recording"):
        RecordingWriter(tmp_path, sensors=[Sensor("s", CAMERA)], created_by="test", overwrite=True)


def test_time_must_increase_while_writing(tmp_path):
    with RecordingWriter(tmp_path / "rec", sensors=[Sensor("s", CAMERA)], created_by="test") as writer:
        writer.add_frame("s", np.ones((30, 40)), 1.0)
        for time_s in (1.0, 0.5, float("nan")):
            with pytest.raises(RecordingError, match="does not come after"):
                writer.add_frame("s", np.ones((30, 40)), time_s)
        with pytest.raises(RecordingError, match="expected an image"):
            writer.add_frame("s", np.ones((40, 30)), 2.0)


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda c: c["sensors"][0]["camera"].pop("fx"), "camera.fx' is missing"),
        (lambda c: c["sensors"][0]["camera"].update(fx=float("nan")), "finite"),
        (lambda c: c["sensors"][0]["camera"].update(fy=-5), "greater than 0"),
        (lambda c: c["sensors"][0]["camera"].update(width=10**9), "whole number"),
        (lambda c: c["sensors"][0]["camera"].update(distortion=[1, 2, 3]), "distortion"),
        (lambda c: c["sensors"][0].update(depth_unit_m=0), "greater than 0"),
        (lambda c: c["sensors"][0].update(depth_range_m=[2, 1]), "near < far"),
        (lambda c: c["sensors"][0].update(name="../left"), "letters"),
        (lambda c: c["sensors"].append(c["sensors"][0]), "same name"),
        (lambda c: c.update(sensors=[]), "not empty"),
        (lambda c: c.pop("sensors"), "'sensors' is missing"),
        (lambda c: c.update(version=2), "newer"),
        (lambda c: c.update(format="other"), "is not a bonetrack-recording"),
        (lambda c: c.update(box={"size_m": [0.1, 0.2]}), "list of 3"),
        (lambda c: c.update(region={"min": [0, 0, 0], "max": [1, 0, 1]}), "smaller"),
    ],
)
def test_a_wrong_header_is_named(written, edit, message):
    path, _ = written
    change(path / "recording.json", edit)
    with pytest.raises(RecordingError, match=message) as raised:
        open_recording(path)
    assert "recording.json" in str(raised.value)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("file,time_s\n000000.png,1\n000001.png,0\n", "does not come after"),
        ("file,time_s\n000000.png,2\n000001.png,2\n", "line 3: the time 2 s stands twice, for 000000.png and 000001"),
        ("file,time_s\n000000.png,nan\n", "not a finite"),
        ("file,time_s\n000000.png,soon\n", "not a finite"),
        ("file,time_s\nlost.png,0\n", "missing"),
        ("file,time_s\n../left/000000.png,0\n", "inside"),
        ("file,time_s\n/etc/hostname,0\n", "inside"),
        ("file,time_s\n000000.png\n", "expected"),
        ("000000.png,0\n", "first line"),
        ("", "first line"),
    ],
)
def test_a_wrong_list_of_frames_is_named(written, lines, message):
    path, _ = written
    (path / "left" / "frames.csv").write_text(lines)
    with pytest.raises(RecordingError, match=message):
        open_recording(path)


def test_what_is_not_a_recording_is_told_apart(tmp_path):
    (tmp_path / "file.txt").write_text("x")
    for path, message in (
        (tmp_path, "no recording.json"),
        (tmp_path / "no", "exist"),
        (tmp_path / "file.txt", "not a"),
    ):
        with pytest.raises(RecordingError, match=message):
            open_recording(path)
    (tmp_path / "recording.json").write_text("{")
    with pytest.raises(RecordingError, match="not valid JSON"):
        open_recording(tmp_path)


def _cut(data):
    return data[: len(data) // 2]


def _without_end(data):
    return data[:-12]


def _flipped(data):
    return data[:60] + bytes([data[60] ^ 0xFF]) + data[61:]


def _huge(data):
    header = struct.pack(">IIBBBBB", 2**31 - 1, 2**31 - 1, 16, 0, 0, 0, 0)
    return data[:16] + header + struct.pack(">I", zlib.crc32(b"IHDR" + header)) + data[33:]


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (_cut, "truncated"),
        (_without_end, "truncated"),
        (_flipped, "damaged"),
        (_huge, "impossible size"),
        (lambda data: b"", "empty"),
        (lambda data: data[:20], "truncated"),
        (lambda data: b"GIF89a" + data, "not a PNG"),
        (lambda data: cv2.imencode(".png", np.zeros((30, 40), np.uint8))[1].tobytes(), "8-bit grey"),
        (lambda data: cv2.imencode(".png", np.zeros((30, 40, 3), np.uint16))[1].tobytes(), "colour"),
        (lambda data: cv2.imencode(".png", np.zeros((40, 30), np.uint16))[1].tobytes(), "camera has 40 x 30"),
    ],
)
def test_a_damaged_image_is_never_half_read(written, damage, message):
    path, _ = written
    (sensor,) = open_recording(path).sensors
    image = sensor.frames[0].path
    image.write_bytes(damage(image.read_bytes()))
    with pytest.raises(RecordingError, match=message) as raised:
        read_depth(sensor, sensor.frames[0])
    assert "000000.png" in str(raised.value)


def test_an_image_that_vanished_is_named(written):
    path, _ = written
    (sensor,) = open_recording(path).sensors
    sensor.frames[0].path.unlink()
    with pytest.raises(RecordingError, match=r"000000\.png"):
        read_depth(sensor, sensor.frames[0])


def _timed(path, times):
    with RecordingWriter(path, sensors=[Sensor(name, CAMERA) for name in times], created_by="test") as writer:
        for name, values in times.items():
            for time_s in values:
                writer.add_frame(name, np.ones((30, 40)), time_s)
    return open_recording(path)


def test_an_instant_takes_the_nearest_frames_of_the_other_sensors(tmp_path):
    recording = _timed(tmp_path / "rec", {"a": [0.005, 0.040, 0.300], "b": [0.0, 0.033, 0.067, 0.100]})
    got = instants(recording)
    assert [instant.time_s for instant in got] == [0.0, 0.033, 0.067, 0.100, 0.300]
    assert set(got[-1].frames) == {"a"}  # the clock has ended; nothing else saw that time
    assert [instant.frames["a"].time_s if "a" in instant.frames else None for instant in got] == [
        0.005,
        0.040,
        None,
        None,
        0.300,
    ]


def test_no_frame_serves_two_instants(tmp_path):
    recording = _timed(tmp_path / "rec", {"a": [0.011], "b": [0.0, 0.02]})
    assert ["a" in instant.frames for instant in instants(recording)] == [False, True]


def test_one_sensor_needs_no_calibration_and_says_so(tmp_path):
    recording = write_limb(tmp_path / "rec", calibrated=False, sensors=("left",))
    assert recording.common_frame_is_sensor
    np.testing.assert_array_equal(world_from_sensor(recording, "left"), np.eye(4))


def test_two_sensors_need_a_calibration(tmp_path):
    recording = write_limb(tmp_path / "rec", calibrated=False)
    with pytest.raises(CalibrationError, match="bonetrack calibrate"):
        world_from_sensor(recording, "left")


def test_a_calibration_is_read_back_and_checked(tmp_path):
    recording = write_limb(tmp_path / "rec")
    assert len(instants(recording)) == FRAMES
    assert not recording.common_frame_is_sensor
    np.testing.assert_allclose(world_from_sensor(recording, "right"), poses()["right"])
    file = recording.path / "calibration.json"
    change(file, lambda c: c["sensors"]["left"]["world_from_sensor"][0].__setitem__(0, 2.0))
    with pytest.raises(RecordingError, match="rigid"):
        open_recording(recording.path)
    change(file, lambda c: c["sensors"].update(ghost=c["sensors"].pop("left")))
    with pytest.raises(RecordingError, match="ghost"):
        open_recording(recording.path)


def test_where_the_clock_stands_still_the_other_sensors_frames_count(tmp_path):
    """The sensor with the most frames dies first."""
    sensors = [Sensor(name, CAMERA) for name in ("fast", "slow", "slower")]
    with RecordingWriter(tmp_path / "rec", sensors=sensors, created_by="test") as writer:
        for k in range(30):
            writer.add_frame("fast", np.ones((30, 40)), k / 30.0)
        for k in range(20):
            writer.add_frame("slow", np.ones((30, 40)), k / 10.0)
        for k in range(10):
            writer.add_frame("slower", np.ones((30, 40)), k / 5.0)
    moments = instants(open_recording(tmp_path / "rec"))
    times = [moment.time_s for moment in moments]
    assert times == sorted(times)
    assert len(times) == 40
    assert set(moments[0].frames) == {"fast", "slow", "slower"}
    assert set(moments[1].frames) == {"fast"}
    assert set(moments[-2].frames) == {"slow", "slower"}
    assert set(moments[-1].frames) == {"slow"}


def test_a_recording_that_was_never_finished_is_begun_anew(tmp_path):
    """So that the same command goes on after it was killed."""

    def write(count):
        with RecordingWriter(tmp_path / "rec", sensors=[Sensor("s", CAMERA)], created_by="test") as writer:
            for k in range(count):
                writer.add_frame("s", np.ones((30, 40)), float(k))
            if count == 2:
                (tmp_path / "rec" / "s" / ".000002.partial-1.png").write_bytes(b"cut sh")
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write(2)
    write(1)
    assert len(open_recording(tmp_path / "rec").sensors[0].frames) == 1
    assert {path.name for path in (tmp_path / "rec" / "s").iterdir()} == {"000000.png", "frames.csv"}
    with pytest.raises(RecordingError, match="holds a recording already"):
        write(1)
