from pathlib import Path

import cv2
import numpy as np
import pytest

from capture.camera import Camera
from capture.cloud.fuse import fuse
from capture.errors import RecordingError
from capture.importers import import_images, natural_order, source_files
from capture.recording import instants, read_depth

CAMERA = Camera(40, 30, 50.0, 50.0, 19.5, 14.5)
SHARED = Path(__file__).parents[2] / "shared" / "recordings"
KINECT, SR305 = SHARED / "upperbody_arms_kinect1_skeltrack", SHARED / "forearm_sr305" / "20210326-230536"


def readings(count):
    return np.random.default_rng(0).integers(2000, 8000, (count, 30, 40)).astype(np.uint16)


def test_numbers_in_names_decide_the_order():
    names = ["100.png", "20.png", "a2.png", "a10.png", "3.png"]
    ordered = [file.name for file in natural_order([Path(name) for name in names])]
    assert ordered == ["3.png", "20.png", "100.png", "a2.png", "a10.png"]


def test_a_folder_of_images_becomes_a_recording(tmp_path):
    images = readings(3)
    for name, image in zip(("2.png", "10.png", "1.png"), images, strict=True):
        cv2.imwrite(str(tmp_path / name), image)
    files = natural_order(source_files(tmp_path, "*.png"))
    recording = import_images(files, tmp_path / "rec", kind="png", camera=CAMERA, depth_unit_m=0.000125, fps=10.0)
    (sensor,) = recording.sensors
    assert [frame.time_s for frame in sensor.frames] == [0.0, 0.1, 0.2]
    expected = images[2] * 0.000125
    expected[expected < 0.2] = 0.0
    np.testing.assert_allclose(read_depth(sensor, sensor.frames[0]), expected, rtol=1e-5)
    assert "nominal rate of 10 Hz" in (recording.path / "recording.json").read_text()


def test_raw_dumps_hold_one_or_more_little_endian_images(tmp_path):
    images = readings(3)
    (tmp_path / "a.raw").write_bytes(images[:2].astype("<u2").tobytes())
    (tmp_path / "b.raw").write_bytes(images[2].astype("<u2").tobytes())
    files = [tmp_path / "a.raw", tmp_path / "b.raw"]
    recording = import_images(files, tmp_path / "rec", kind="raw", camera=CAMERA, depth_unit_m=0.0005)
    (sensor,) = recording.sensors
    got = [read_depth(sensor, frame) for frame in sensor.frames]
    np.testing.assert_allclose(got, images * 0.0005, rtol=1e-5)


@pytest.mark.parametrize("size", [0, 2399, 2401, 1200])
def test_a_raw_file_of_the_wrong_size_is_one_clear_line(tmp_path, size):
    file = tmp_path / "depth.raw"
    file.write_bytes(bytes(size))
    with pytest.raises(RecordingError, match=rf"depth\.raw: has {size} bytes, .*40 x 30.*2400") as raised:
        import_images([file], tmp_path / "rec", kind="raw", camera=CAMERA, depth_unit_m=0.001)
    assert "\n" not in str(raised.value)


def test_a_folder_without_images_is_an_error(tmp_path):
    with pytest.raises(RecordingError, match=r"no files like \*\.png"):
        source_files(tmp_path, "*.png")
    with pytest.raises(RecordingError, match="does not exist"):
        source_files(tmp_path / "nowhere", "*")


@pytest.mark.skipif(not KINECT.is_dir(), reason="the real recording is not at hand")
def test_a_real_kinect_recording_becomes_a_cloud(tmp_path):
    files = natural_order(source_files(KINECT, "depth-data-*"))
    camera = Camera(640, 480, 585.0, 585.0, 320.0, 240.0)
    recording = import_images(files, tmp_path / "rec", kind="raw", camera=camera, depth_unit_m=0.001)
    assert len(recording.sensors[0].frames) == 12
    every = instants(recording)
    cloud = fuse(recording, every[4])
    assert len(cloud.points) > 5000
    width, height, depth = np.ptp(cloud.points, axis=0)
    assert 0.9 < width < 1.5
    assert 0.8 < height < 1.2
    assert depth < 0.6
    assert 0.05 < cloud.boundary.mean() < 0.3
    # The first frame has somebody else 0.5 m behind.
    assert fuse(recording, every[0]).points[:, 2].max() < 1.65


@pytest.mark.skipif(not SR305.is_dir(), reason="the real recording is not at hand")
def test_a_real_close_recording_shows_the_hand_at_its_size(tmp_path):
    camera = Camera(640, 480, 476.007, 476.007, 313.683, 242.755)
    files = natural_order(source_files(SR305, "*.png"))
    recording = import_images(files, tmp_path / "rec", kind="png", camera=camera, depth_unit_m=0.000125)
    cloud = fuse(recording, instants(recording)[1])
    hand = cloud.points[cloud.points[:, 0] < 0.0]
    assert 0.08 < np.ptp(hand[:, 1]) < 0.16
    assert 0.3 < np.median(hand[:, 2]) < 0.6
