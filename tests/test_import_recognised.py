"""What a file is, is found out by what it holds, after the pattern; what it is not, is said by name."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from capture.commands import import_command
from capture.importers import ImportOptions, UserCamera, import_recording
from capture.recording import open_recording
from tests.sensor_files import scene
from tests.test_import_files import images, refused
from tests.test_import_folders import write_images

STATED = UserCamera(fx=60.0)
TABLE = scene.readings(0)


def test_the_pattern_holds_before_the_format_is_recognised(tmp_path):
    folder = tmp_path / "dumps"
    folder.mkdir()
    cv2.imwrite(str(folder / "preview.png"), np.zeros((8, 8, 3), np.uint8))
    for frame in range(3):
        (folder / f"depth-{frame}").write_bytes(scene.readings(frame).astype("<u2").tobytes())
    stated = UserCamera(fx=60.0, size=(64, 48), pattern="depth-*")
    recording = import_recording(folder, tmp_path / "rec", ImportOptions(cameras=stated))
    np.testing.assert_array_equal(images(recording)[2], scene.readings(2))
    refused(folder, tmp_path, r"no files like \*\.tif", cameras=UserCamera(fx=60.0, pattern="*.tif"))


def test_a_recording_is_recognised_as_one(tmp_path):
    import_recording(write_images(tmp_path / "images"), tmp_path / "rec", ImportOptions(cameras=STATED))
    refused(tmp_path / "rec", tmp_path, "is a recording already", cameras=STATED)
    refused(tmp_path / "rec" / "recording.json", tmp_path, "description of a recording", cameras=STATED)


@pytest.mark.parametrize("name", ["a.bag", "a.mkv", "a.ply", "images/0.png", "images/depth"])
def test_a_git_lfs_pointer_is_called_one(tmp_path, name):
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    path.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n")
    source = path if path.parent == tmp_path else path.parent
    with pytest.raises(Exception, match=r"is a Git LFS pointer.*git lfs pull"):
        import_recording(source, tmp_path / "rec", ImportOptions(cameras=STATED))


def table(path, values, *, separator=" "):
    np.savetxt(path, values, fmt="%.4f" if values.dtype.kind == "f" else "%d", delimiter=separator)


@pytest.mark.parametrize("separator", [" ", ",", ";", "\t"])
def test_tables_of_readings_come_in(tmp_path, separator):
    (tmp_path / "tables").mkdir()
    for frame in range(3):
        table(tmp_path / "tables" / f"{frame}.csv", scene.readings(frame), separator=separator)
    recording = import_recording(tmp_path / "tables", tmp_path / "rec", ImportOptions(cameras=STATED))
    np.testing.assert_array_equal(images(recording), [scene.readings(frame) for frame in range(3)])
    assert "nominal rate" in recording.created_by


def test_tables_of_metres_ask_for_their_unit(tmp_path):
    metres = np.where(TABLE > 0, TABLE * 1e-3, np.nan)
    table(tmp_path / "depth.txt", metres)
    refused(tmp_path / "depth.txt", tmp_path, r"decimals.*--unit-mm 1000 for metres", cameras=STATED)
    stated = UserCamera(fx=60.0, depth_unit_m=1.0)
    (image,) = images(import_recording(tmp_path / "depth.txt", tmp_path / "rec", ImportOptions(cameras=stated)))
    np.testing.assert_array_equal(image, TABLE * 10)


def test_tables_that_are_no_images_are_refused(tmp_path):
    table(tmp_path / "points.txt", np.random.default_rng(0).uniform(0.1, 1.0, (500, 3)))
    refused(tmp_path / "points.txt", tmp_path, "3 x 500 numbers, no image", cameras=STATED)
    (tmp_path / "ragged.txt").write_text("\n".join(["1 2 3 4 5 6 7 8"] * 9 + ["1 2 3"]))
    refused(tmp_path / "ragged.txt", tmp_path, "damaged .*table of numbers", cameras=STATED)


@pytest.mark.parametrize("kind", ["P2", "P5"])
def test_pgm_images_come_in(tmp_path, kind):
    (tmp_path / "pgm").mkdir()
    for frame in range(2):
        values = scene.readings(frame)
        body = values.astype(">u2").tobytes() if kind == "P5" else "\n".join(map(str, values.ravel())).encode()
        header = f"{kind}\n# by a program\n64 48\n65535\n".encode()
        (tmp_path / "pgm" / f"{frame}.pgm").write_bytes(header + body)
    recording = import_recording(tmp_path / "pgm", tmp_path / "rec", ImportOptions(cameras=STATED))
    np.testing.assert_array_equal(images(recording), [scene.readings(frame) for frame in range(2)])
    cut = tmp_path / "cut.pgm"
    cut.write_bytes((header + body)[:-3000])
    refused(cut, tmp_path, "its end is missing", cameras=STATED)
    cut.write_bytes(header.replace(b"65535", b"255") + body)
    refused(cut, tmp_path, "a picture, not depth", cameras=STATED)


def test_each_source_may_have_a_camera_of_its_own(tmp_path):
    folders = [write_images(tmp_path / name) for name in ("a", "b")]
    arguments = [*map(str, folders), "--out", str(tmp_path / "rec"), "--offset", "clock"]
    result = CliRunner().invoke(import_command, [*arguments, "--fx", "60", "--fx", "70", "--cx", "30", "--cx", "33"])
    assert result.exit_code == 0, result.output
    cameras = [sensor.camera for sensor in open_recording(tmp_path / "rec").sensors]
    assert [(camera.fx, camera.fy, camera.cx) for camera in cameras] == [(60.0, 60.0, 30.0), (70.0, 70.0, 33.0)]
    result = CliRunner().invoke(import_command, [*arguments, "--overwrite", *["--fx", "60"] * 3])
    assert result.exit_code == 2
    assert "once for each of 2 sources" in " ".join(result.output.split())
