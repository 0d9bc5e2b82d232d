"""Import looks at what the readings are, and says or refuses what they cannot be."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from capture.commands import import_command
from capture.importers import ImportOptions, UserCamera, import_recording
from capture.recording import open_recording, read_depth
from tests.test_import_files import images, refused

STATED = UserCamera(fx=60.0)
METRES = np.tile(np.linspace(0.6, 2.4, 64), (48, 1))


def folder(tmp_path, image, name="images"):
    (tmp_path / name).mkdir()
    for frame in range(3):
        cv2.imwrite(str(tmp_path / name / f"{frame}.png"), image.astype(np.uint16))
    return tmp_path / name


def raw_disparity(metres):
    """The inverse of the OpenKinect page's relation; a strip at the right and a shadow have none."""
    image = np.rint(2842.5 * (np.arctan(metres / 0.1236) - 1.1863))
    image[:, -8:] = 2047
    image[10:20, 20:25] = 2047
    return image


@pytest.mark.parametrize(
    ("image", "match"),
    [
        (0 * METRES, r"no reading in any of its 3 depth images: every pixel is 0;.*empty"),
        (0 * METRES + 65535, r"every pixel is 0 or 65535"),
        (METRES * 1e5 / 4, r"from 15.* to 60 m by its unit of 1 mm, of which 0%.*--unit-mm"),
        (METRES * 50, r"from 0\.03.* to 0\.12 m .*--unit-mm"),
        (4500 + 0 * METRES, r"--depth-range"),
        (raw_disparity(METRES), r"raw disparities of a Kinect.*--kinect-disparity"),
        (0 * METRES + 2047, r"raw disparities"),
        (
            np.where(raw_disparity(METRES) == 2047, 1023, raw_disparity(METRES)),
            r"of 10 bits \(1023 for none\).*record mill",
        ),
        (raw_disparity(METRES) // 2, r"of 10 bits"),
    ],
)
def test_readings_of_no_use_are_refused_with_the_likely_cause(image, match, tmp_path):
    refused(folder(tmp_path, image), tmp_path, match, cameras=STATED)


def test_a_file_whose_first_images_are_empty_comes_in(tmp_path):
    path = folder(tmp_path, 1000 * METRES)
    cv2.imwrite(str(path / "0.png"), np.zeros((48, 64), np.uint16))
    assert len(images(import_recording(path, tmp_path / "rec", ImportOptions(cameras=STATED)))) == 3


@pytest.mark.parametrize("largest", [2047, 1023])
def test_a_person_in_millimetres_up_to_the_largest_disparity_is_none(largest, tmp_path):
    path = folder(tmp_path, np.minimum(np.linspace(600, 2400, 48 * 64).reshape(48, 64), largest))
    assert len(images(import_recording(path, tmp_path / "rec", ImportOptions(cameras=STATED)))) == 3


def test_raw_disparities_become_distances_on_request(tmp_path):
    raw = raw_disparity(METRES)
    recording = import_recording(
        folder(tmp_path, raw), tmp_path / "rec", ImportOptions(cameras=UserCamera(fx=60.0, disparity=True))
    )
    (sensor,) = recording.sensors
    depth = read_depth(sensor, sensor.frames[0])
    assert (depth[raw == 2047] == 0.0).all()
    # Half a step of a disparity is 6 mm at 2.4 m.
    np.testing.assert_allclose(depth[raw < 2047], METRES[raw < 2047], atol=0.009)
    # The ROS page's relation, of another origin, agrees to 2 %.
    np.testing.assert_allclose(depth[raw < 2047], 348.0 / (1090.0 - raw[raw < 2047]), rtol=0.02)


def test_disparities_of_10_bits_are_not_converted_as_if_they_were_of_11(tmp_path):
    stated = UserCamera(fx=60.0, disparity=True)
    refused(folder(tmp_path, raw_disparity(METRES) // 2), tmp_path, r"of 10 bits.*FREENECT_DEPTH_MM", cameras=stated)


def test_the_range_that_is_stated_is_the_recordings(tmp_path):
    path = folder(tmp_path, 3000 * METRES)  # up to 7.2 m
    recording = import_recording(
        path, tmp_path / "rec", ImportOptions(cameras=UserCamera(fx=60.0, depth_range_m=(0.1, 8.0)))
    )
    (sensor,) = recording.sensors
    assert sensor.depth_range_m == (0.1, 8.0)
    assert read_depth(sensor, sensor.frames[0]).max() == pytest.approx(7.2)


def test_the_command_says_what_the_readings_are_like(tmp_path):
    image = 1000 * METRES
    image[:, :32] = 0
    path = folder(tmp_path, np.where(image > 0, np.rint(image / 5) * 5, 0))
    arguments = [str(path), "--out", str(tmp_path / "rec"), "--fx", "60"]
    result = CliRunner().invoke(import_command, arguments)
    assert result.exit_code == 0, result.output
    words = " ".join(result.output.split())
    assert "50% of all pixels usable (100% of the readings), 1.52 to 2.40 m, in steps of 25 mm" in words

    result = CliRunner().invoke(import_command, [*arguments, "--overwrite", "--depth-range", "1.0", "2.0"])
    assert result.exit_code == 0, result.output
    assert open_recording(tmp_path / "rec").sensors[0].depth_range_m == (1.0, 2.0)
    wrong = CliRunner().invoke(import_command, [*arguments, "--overwrite", "--depth-range", "2.0", "1.0"])
    assert wrong.exit_code == 2
