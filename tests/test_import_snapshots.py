"""Snapshots of RealSense's viewer come in with the times and the camera of the tables beside them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from capture.importers import ImportOptions, UserCamera, import_recording
from tests.sensor_files import scene
from tests.test_import_files import images, refused

WIDTH, HEIGHT = scene.WIDTH, scene.HEIGHT


def table(frame, *, time_ms=None, stream="Depth", kind="Z16", fx=61.25, model="Brown Conrady"):
    """As the SDK's frame_metadata_to_csv writes it."""
    time_ms = 1606470000000.0 + 33.33 * frame if time_ms is None else time_ms
    return (
        f"Frame Info: \nType,{stream}\nFormat,{kind}\nFrame Number,{frame}\nTimestamp (ms),{time_ms:.2f}\n"
        f"Resolution x,{WIDTH}\nResolution y,{HEIGHT}\nBytes per pixel,2\n\nIntrinsic:,\nFx,{fx:.6f}\nFy,60.500000\n"
        f"PPx,31.750000\nPPy,23.250000\nDistorsion,{model}\n"
    )


def snapshot(folder, name, frame, **told):
    (folder / f"{name}_Depth.raw").write_bytes(scene.readings(frame).astype("<u2").tobytes())
    (folder / f"{name}_Depth_metadata.csv").write_text(table(frame, **told))
    cv2.imwrite(str(folder / f"{name}_Depth.png"), np.zeros((HEIGHT, WIDTH, 3), np.uint8))


@pytest.fixture
def folder(tmp_path):
    home = tmp_path / "snapshots"
    home.mkdir()
    for frame, name in enumerate(("one", "again", "last")):  # the order of times is not that of names
        snapshot(home, name, frame)
    (home / "one_Infrared.raw").write_bytes(bytes(WIDTH * HEIGHT))
    (home / "one_Infrared_metadata.csv").write_text(table(0, stream="Infrared 1", kind="Y8"))
    return home


@pytest.mark.parametrize("pattern", [None, "*_Depth.raw"])
def test_times_size_and_camera_are_the_tables(folder, tmp_path, pattern):
    recording = import_recording(folder, tmp_path / "rec", ImportOptions(cameras=UserCamera(pattern=pattern)))
    (sensor,) = recording.sensors
    camera = sensor.camera
    assert (camera.width, camera.height, camera.fx, camera.fy) == (WIDTH, HEIGHT, 61.25, 60.5)
    assert (camera.cx, camera.cy, camera.distortion) == (31.75, 23.25, ())
    np.testing.assert_allclose([frame.time_s for frame in sensor.frames], [0.0, 0.03333, 0.06666], atol=2e-5)
    for frame, image in enumerate(images(recording)):
        np.testing.assert_array_equal(image, scene.readings(frame))
    assert "the tables beside the images" in (recording.path / "recording.json").read_text()


def test_what_is_stated_goes_before_the_tables(folder, tmp_path):
    recording = import_recording(folder, tmp_path / "rec", ImportOptions(cameras=UserCamera(fx=70.0, fps=10.0)))
    (sensor,) = recording.sensors
    assert sensor.camera.fx == 70.0
    assert [frame.time_s for frame in sensor.frames] == [0.0, 0.1, 0.2]


@pytest.mark.parametrize(
    ("told", "match"),
    [
        ({"fx": 62.0}, r"another_Depth\.raw: is of another camera, or mode, than one_Depth\.raw"),
        ({"kind": "Y16"}, r"another_Depth_metadata\.csv: has depth in the format Y16"),
        ({"fx": 0.0}, r"another_Depth_metadata\.csv: .*no camera"),
        ({"time_ms": float("nan")}, r"another_Depth_metadata\.csv: .*no camera"),
    ],
)
def test_a_table_that_does_not_belong_is_refused_by_name(folder, tmp_path, told, match):
    snapshot(folder, "another", 3, **told)
    refused(folder, tmp_path, match)


def test_a_lens_without_its_coefficients_is_refused_unless_stated(tmp_path):
    home = tmp_path / "sr300"
    home.mkdir()
    for frame in range(3):
        snapshot(home, f"{frame}", frame, model="Inverse Brown Conrady")
    refused(home, tmp_path, r"Inverse Brown Conrady\) without its coefficients.*--fx and --distortion")
    assert (
        import_recording(home, tmp_path / "rec", ImportOptions(cameras=UserCamera(fx=60.0))).sensors[0].camera.fx
        == 60.0
    )


def test_faults_of_dumps_and_tables_are_one_clear_line(folder, tmp_path):
    dump, told = folder / "last_Depth.raw", folder / "last_Depth_metadata.csv"
    whole, text = dump.read_bytes(), told.read_text()
    dump.write_bytes(whole[:-2])
    refused(folder, tmp_path, rf"last_Depth\.raw: is truncated .*less than {WIDTH} x {HEIGHT} readings")
    dump.write_bytes(whole + b"\0\0")
    refused(folder, tmp_path, r"last_Depth\.raw: is larger than")
    dump.write_bytes(whole)
    told.write_text(text.replace("PPx", "PPz"))
    refused(folder, tmp_path, r"last_Depth_metadata\.csv: is truncated or damaged \('PPx'\)")
    told.unlink()
    refused(folder, tmp_path, r"last_Depth\.raw: has no last_Depth_metadata\.csv beside it.*--pattern")
    for kept in folder.glob("*_Depth*"):
        kept.unlink()
    refused(folder, tmp_path, "no depth among its snapshots")
