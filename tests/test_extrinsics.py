"""A rig that somebody calibrated already needs no box: its matrices come in, if they are rigid and the clouds agree."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from capture.calibration.calibrate import known_calibration
from capture.calibration.extrinsics import read_extrinsics
from capture.commands import calibrate_command, import_command
from capture.errors import CalibrationError
from capture.recording import open_recording, world_from_sensor
from capture.rigid import exp_so3, inverse, transform
from tests.test_calibrate import recorded
from tests.two_sensors import poses

NAMES = ["left", "right"]


def as_json(path: Path, matrices) -> Path:
    path.write_text(json.dumps({label: np.asarray(matrix).tolist() for label, matrix in matrices.items()}))
    return path


def as_text(path: Path, matrices) -> Path:
    rows = {label: "\n".join(" ".join(f"{x:.9f}" for x in row) for row in m) for label, m in matrices.items()}
    path.write_text("# a rig\n" + "".join(f"{label}:\n{text}\n\n" for label, text in rows.items()))
    return path


def as_yaml(path: Path, matrices) -> Path:
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_FORMAT_YAML)
    for label, matrix in matrices.items():
        storage.write(label, matrix)
    storage.release()
    return path


@pytest.mark.parametrize("write", [as_json, as_text, as_yaml])
def test_each_matrix_says_which_way_it_maps(write, tmp_path):
    known = poses()
    path = write(tmp_path / "rig.yml", {"world_from_left": known["left"], "right_from_world": inverse(known["right"])})
    found = read_extrinsics(path, NAMES)
    for name in NAMES:
        np.testing.assert_allclose(found[name], known[name], atol=1e-8)


def test_rounded_matrices_become_rigid(tmp_path):
    path = as_json(tmp_path / "rig.json", {f"world_from_{name}": pose.round(3) for name, pose in poses().items()})
    rotation = read_extrinsics(path, NAMES)["left"][:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)


LEFT = poses()["left"]


@pytest.mark.parametrize(
    ("left", "match"),
    [
        (LEFT @ np.diag([-1.0, 1.0, 1.0, 1.0]), "mirrors: its axes are left-handed"),
        (LEFT.T, "made for row vectors"),
        (LEFT * [[1000.0], [1000.0], [1000.0], [1.0]], "scales by 1000"),
        (LEFT + np.diag([0.1, 0.0, 0.0, 0.0]), "not a rotation and a shift"),
        (LEFT[:3], "not 4 rows of 4 numbers"),
        (LEFT * np.nan, "not 4 rows of 4 numbers|not a file"),
        (transform(LEFT[:3, :3], 1000.0 * LEFT[:3, 3]), "m apart; lengths must be metres"),
    ],
)
def test_matrices_that_are_none_are_refused_with_what_is_wrong(left, match, tmp_path):
    path = as_json(tmp_path / "rig.json", {"world_from_left": left, "world_from_right": poses()["right"]})
    with pytest.raises(CalibrationError, match=rf"rig\.json: .*({match})") as raised:
        read_extrinsics(path, NAMES)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("", "does not say where sensor 'left' stands"),
        ("{", "not a file of named"),
        ("1 0 0 0", "no name"),
        ('{"left": []}', "'left' does not tell which way it maps; call it world_from_left or left_from_world"),
        ('{"world_from_other": []}', "a sensor that the recording does not have"),
        ("%YAML:1.0\n---\n a: [", "not a file of named|does not say"),
        ("%YAML:1.0\n---\nworld_from_left: 3\n", "not 4 rows|not a file"),
        (
            "%YAML:1.0\n---\nworld_from_left: !!opencv-matrix\n   rows: 60000\n   cols: 60000\n   dt: d\n"
            "   data: [ 1. ]\n",
            "not 4 rows of 4 numbers",
        ),
        ("[" * 100_000, "not a file|does not|no name"),
        (" " * (2**20 + 1), "larger than"),
    ],
)
def test_files_that_are_none_are_one_clear_line(text, match, tmp_path):
    (tmp_path / "rig.txt").write_text(text)
    with pytest.raises(CalibrationError, match=match) as raised:
        read_extrinsics(tmp_path / "rig.txt", NAMES)
    assert "\n" not in str(raised.value)


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """A recording of a box and a subject, and where its two sensors truly stand."""
    return recorded(tmp_path_factory.mktemp("rig") / "rec", box_frames=1)


def truth(recording):
    with np.load(recording.truth_path) as known:
        return dict(zip((sensor.name for sensor in recording.sensors), known["world_from_sensor"], strict=True))


def test_true_matrices_make_a_calibration_without_a_box(rig, tmp_path):
    calibration = known_calibration(rig, truth(rig), where=tmp_path)
    for name, pose in truth(rig).items():
        np.testing.assert_array_equal(calibration.sensors[name].world_from_sensor, pose)
    apart = [sensor.details["apart_mm"] for sensor in calibration.sensors.values()][1:]
    assert max(apart) < 2.5


def test_matrices_that_map_the_other_way_are_refused_with_the_remedy(rig, tmp_path):
    swapped = {name: inverse(pose) for name, pose in truth(rig).items()}
    with pytest.raises(CalibrationError, match=r"does not lie on .*by the inverse matrices .*map the other way"):
        known_calibration(rig, swapped, where=tmp_path / "rig.json")


@pytest.mark.parametrize("what", ["turned", "pushed", "exchanged"])
def test_matrices_of_another_rig_are_refused(rig, what, tmp_path):
    known = truth(rig)
    first, second = known
    if what == "exchanged":
        known[first], known[second] = known[second], known[first]
    turn = exp_so3(np.radians([0.0, 6.0 if what == "turned" else 0.0, 0.0]))
    known[second] = known[second] @ transform(turn, np.array([0.0, 0.0, 0.03 if what == "pushed" else 0.0]))
    with pytest.raises(CalibrationError, match=r"matrices are of this rig|map the other way"):
        known_calibration(rig, known, where=tmp_path / "rig.json")


def test_the_commands_take_matrices_in_place_of_a_box(rig, tmp_path):
    path = as_text(tmp_path / "rig.txt", {f"world_from_{name}": pose for name, pose in truth(rig).items()})
    result = CliRunner().invoke(calibrate_command, [str(rig.path), "--extrinsics", str(path)])
    assert result.exit_code == 0, result.output
    written = open_recording(rig.path)
    for name, pose in truth(rig).items():
        np.testing.assert_allclose(world_from_sensor(written, name), pose, atol=1e-6)
        assert written.calibration.sensors[name].residual_mm is None
        assert written.calibration.sensors[name].details["given_by"] == "rig.txt"


def test_import_takes_matrices_and_refuses_wrong_ones(rig, tmp_path):
    from tests.two_sensors import CAMERA, write_limb

    limb = write_limb(tmp_path / "limb", calibrated=False)
    folders = []
    for sensor in limb.sensors:
        (tmp_path / sensor.name).mkdir()
        for frame in sensor.frames:
            (tmp_path / sensor.name / frame.path.name).write_bytes(frame.path.read_bytes())
        folders.append(str(tmp_path / sensor.name))
    path = as_json(tmp_path / "rig.json", {f"world_from_{name}": pose for name, pose in poses().items()})
    arguments = [*folders, "--out", str(tmp_path / "rec"), "--fx", str(CAMERA.fx), "--unit-mm", "0.5"]
    arguments += [
        "--offset",
        "clock",
        "--sensor",
        "left",
        "--sensor",
        "right",
        "--overwrite",
        "--extrinsics",
        str(path),
    ]
    result = CliRunner().invoke(import_command, arguments)
    assert result.exit_code == 0, result.output
    np.testing.assert_allclose(world_from_sensor(open_recording(tmp_path / "rec"), "right"), poses()["right"])
    as_json(path, {f"{name}_from_world": pose for name, pose in poses().items()})
    result = CliRunner().invoke(import_command, arguments)
    assert result.exit_code != 0
    assert "map the other way" in str(result.exception)
    assert open_recording(tmp_path / "rec").calibration is None
