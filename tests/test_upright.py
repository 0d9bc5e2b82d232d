"""Which way is up: sensors tell it of a recording, a motion remembers it, and exports say what they took for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from adapt.subject import save_subject
from capture.upright import AXES, up_direction, upward
from tests.known_motion import known_motion
from track.accuracy.truth import read_truth, world_from_common
from track.export.commands import export_command
from track.export.upright import told_up, y_up
from track.motion import save_motion
from track.options import AS_USUAL


def test_up_is_away_from_the_floor_though_the_box_stands_askew_and_sensors_look_down(limb):
    up = up_direction(limb.recording)
    truth = read_truth(limb.recording)
    assert (world_from_common(limb.recording, truth)[:3, :3] @ up)[1] > np.cos(np.deg2rad(1.5))
    assert max(float(axis @ up) for axis in AXES.values()) < np.cos(np.deg2rad(10.0))  # the box stands askew


def looking(azimuth, elevation):
    """The turn of a level sensor in a frame with y up: x right, y down, z forward."""
    turn = Rotation.from_euler("YX", [azimuth, -elevation], degrees=True).as_matrix()
    return turn @ np.diag([1.0, -1.0, -1.0])


@pytest.mark.parametrize("elevations", [(0.0, 0.0), (-30.0, -50.0), (20.0, -40.0)])
def test_two_sensors_tell_up_however_far_they_look_down(elevations):
    turns = np.array(
        [looking(azimuth, elevation) for azimuth, elevation in zip((-40.0, 35.0), elevations, strict=True)]
    )
    frame = Rotation.from_euler("XZ", [25.0, -70.0], degrees=True).as_matrix()
    np.testing.assert_allclose(upward(frame @ turns), frame @ [0.0, 1.0, 0.0], atol=1e-9)


def test_a_flat_box_knows_better_than_sensors_that_are_a_little_askew():
    turns = np.array([looking(-40.0, -20.0), looking(40.0, -20.0) @ Rotation.from_euler("z", 2.0, True).as_matrix()])
    np.testing.assert_array_equal(upward(turns), [0.0, 1.0, 0.0])


def test_one_sensor_tells_its_own_up():
    np.testing.assert_allclose(upward(looking(0.0, -30.0)[None]), -looking(0.0, -30.0)[:, 1])


def test_a_motion_remembers_which_way_is_up(limb):
    used = AS_USUAL.used(limb.recording, subject="0", thresholds={})
    np.testing.assert_array_equal(told_up(replace(known_motion(limb), settings=used)), up_direction(limb.recording))
    assert told_up(known_motion(limb)) is None  # an older one


@pytest.mark.parametrize("up", [*AXES.values(), np.array([0.6, -0.8, 0.0]), np.array([0.48, 0.6, 0.64])])
def test_turned_upright_nothing_is_mirrored(up):
    turn = y_up(up)[:3, :3]
    np.testing.assert_allclose(turn @ up, AXES["y"], atol=1e-12)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1.0)


@pytest.fixture
def exports(limb, tmp_path):
    """Exports the known motion with options; what was said, and the folder."""
    (tmp_path / "motion").mkdir()
    save_motion(known_motion(limb), tmp_path / "motion")
    save_subject(limb.subject, tmp_path / "subject.npz")

    def export(*options):
        common = [str(tmp_path / "motion"), "--subject", str(tmp_path / "subject.npz"), "--out", str(tmp_path / "out")]
        return CliRunner().invoke(export_command, [*common, *options]), tmp_path / "out"

    return export


def test_exports_say_what_they_took_for_up_and_what_became_of_lost_frames(exports):
    ran, out = exports("--bvh", "--gaps", "hold")
    assert "motion.bvh: 2 lost frame(s) are the pose before, which nobody saw" in ran.output
    assert "motion.bvh: bones that do not show are guessed in 1 frame(s)" in ran.output
    assert "does not know which way is up: its y is taken for it; --up states another axis" in ran.output
    assert (out / "motion.bvh").is_file()
    ran, _ = exports("--bvh", "--gaps", "split", "--up", "-z")
    assert "2 lost frame(s) are left out" in ran.output
    assert "up is -z in the recording, and y in these files" in ran.output


def test_nothing_is_written_where_a_gap_is_not_spoken_of_or_a_library_is_missing(exports, monkeypatch):
    ran, out = exports("--bvh")
    assert "BVH cannot leave out 2 lost frame(s) between others; say what becomes of them" in str(ran.exception)
    assert not out.exists()
    monkeypatch.setattr("track.export.animations.find_spec", lambda name: None)
    for option, extra in (("--c3d", "c3d"), ("--usd", "usd")):
        ran, out = exports(option)
        assert f"pip install 'bonetrack[{extra}]'" in str(ran.exception)
        assert not out.exists()
