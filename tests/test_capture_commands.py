import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from capture.commands import calibrate_command, fuse_command, import_command
from capture.commands.region_options import as_region
from capture.errors import BonetrackError, RecordingError
from capture.recording import open_recording
from tests.two_sensors import limb_depth, poses, write_limb


def run(command, *arguments):
    result = CliRunner().invoke(command, [str(argument) for argument in arguments])
    if isinstance(result.exception, BonetrackError):
        raise result.exception
    return result


def test_import_finds_the_image_size_and_says_what_it_made(tmp_path):
    depth = (limb_depth(poses()["left"]) * 1000).astype(np.uint16)
    for index in range(2):
        cv2.imwrite(str(tmp_path / f"{index}.png"), depth)
    result = run(import_command, tmp_path, "--out", tmp_path / "rec", "--fx", 287.5, "--fps", 15)
    assert result.exit_code == 0, result.output
    assert "2 frames of 320 x 240 px" in result.output
    assert "nominal rate of 15 Hz" in result.output
    camera = open_recording(tmp_path / "rec").sensors[0].camera
    assert (camera.width, camera.fy, camera.cx) == (320, 287.5, 159.5)


def test_import_reads_one_raw_file(tmp_path):
    (tmp_path / "a.raw").write_bytes((limb_depth(poses()["left"]) * 1000).astype("<u2").tobytes())
    options = ("--out", tmp_path / "rec", "--fx", 287.5, "--width", 320, "--height", 240)
    assert run(import_command, tmp_path / "a.raw", *options).exit_code == 0
    with pytest.raises(RecordingError, match="already"):
        run(import_command, tmp_path / "a.raw", *options)
    assert run(import_command, tmp_path / "a.raw", *options, "--overwrite").exit_code == 0


def test_import_refuses_wrong_options(tmp_path):
    (tmp_path / "a.raw").write_bytes(bytes(10))
    assert run(import_command, tmp_path / "a.raw").exit_code == 2
    assert run(import_command, tmp_path / "a.raw", "--out", tmp_path / "rec", "--cx", 10).exit_code == 2
    with pytest.raises(RecordingError, match="--fx"):
        run(import_command, tmp_path / "a.raw", "--out", tmp_path / "rec")
    options = ("--out", tmp_path / "rec", "--fx", 500)
    assert run(import_command, tmp_path / "a.raw", *options, "--distortion", "1,2,3").exit_code == 2
    assert run(import_command, tmp_path / "a.raw", *options, "--distortion", "a,b,c,d").exit_code == 2
    with pytest.raises(RecordingError, match="10 bytes"):
        run(import_command, tmp_path / "a.raw", *options)


def test_fuse_writes_the_cloud_and_says_how_large_it_is(tmp_path):
    write_limb(tmp_path / "rec")
    result = run(fuse_command, tmp_path / "rec", "--frame", 1, "--out", tmp_path / "c.ply")
    assert result.exit_code == 0, result.output
    assert "points from 2 sensor(s) at 0.033 s" in result.output
    assert (tmp_path / "c.ply").read_bytes().startswith(b"ply\n")


def test_fuse_says_when_nobody_calibrated_and_which_frames_there_are(tmp_path):
    write_limb(tmp_path / "rec", calibrated=False, sensors=("left",))
    assert "not calibrated" in run(fuse_command, tmp_path / "rec", "--frame", 0, "--out", tmp_path / "c.ply").output
    with pytest.raises(RecordingError, match="frames are 0 to 2"):
        run(fuse_command, tmp_path / "rec", "--frame", 3, "--out", tmp_path / "c.ply")


def test_calibrate_without_a_box_is_a_clear_error(tmp_path):
    write_limb(tmp_path / "rec", calibrated=False)
    with pytest.raises(BonetrackError, match="box"):
        run(calibrate_command, tmp_path / "rec")


def test_six_numbers_make_a_region(tmp_path):
    assert as_region(None) is None
    np.testing.assert_array_equal(as_region((0, 1, 2, 3, 4, 5)).maximum, [3, 4, 5])
    arguments = (tmp_path, "--frame", 0, "--out", tmp_path / "c.ply", "--region", 0, 0, 0, 1, 0, 1)
    write_limb(tmp_path / "rec")
    assert run(fuse_command, tmp_path / "rec", *arguments[1:]).exit_code == 2
