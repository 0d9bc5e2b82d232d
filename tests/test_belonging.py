"""A motion and a subject know what they were made from, and another recording or subject is told."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from adapt.model.body import make_body
from adapt.subject import load_subject, save_subject
from capture.calibration.calibrate import write_calibration
from capture.provenance import recording_used
from capture.recording import open_recording
from capture.recording.fingerprint import fingerprint
from capture.recording.types import SensorCalibration
from tests.known_motion import known_motion, reported_subject
from track.belonging import adapted_elsewhere, refuse_other_subject, subject_fingerprint, tracked_elsewhere
from track.commands import track_command
from track.evaluation.random_bodies import random_body
from track.export.files import export_motion
from track.motion import MotionError, load_motion, save_motion
from track.options import TrackOptions
from track.view.report import write_report
from track.view.scene import motion_scene, subject_scene


@pytest.fixture(scope="module")
def subject(limb):
    """The known subject as it is since results know their recording."""
    settings = {"versions": {}, **recording_used(limb.recording)}
    return replace(limb.subject, report=reported_subject(limb).report | {"settings": settings})


@pytest.fixture(scope="module")
def motion(limb, subject):
    settings = TrackOptions().used(limb.recording, subject=subject_fingerprint(subject), thresholds={})
    return replace(known_motion(limb), settings=settings)


@pytest.fixture(scope="module")
def other(limb, tmp_path_factory):
    """A recording of the same sensors, times and sizes that shows something else."""
    folder = tmp_path_factory.mktemp("other") / "leg"
    shutil.copytree(limb.recording.path, folder)
    for sensor in open_recording(folder).sensors:
        sensor.frames[0].path.write_bytes(sensor.frames[3].path.read_bytes())
    return open_recording(folder)


@pytest.fixture(scope="module")
def stranger(subject):
    body = make_body(subject.anatomy, shape=random_body(subject.anatomy, 8).shape)
    return replace(subject, body=body)


def test_a_copy_under_another_name_with_another_calibration_region_and_camera_is_the_same_recording(limb, tmp_path):
    shutil.copytree(limb.recording.path, tmp_path / "kept elsewhere")
    copy = open_recording(tmp_path / "kept elsewhere")
    moved = np.eye(4)
    moved[0, 3] = 0.1
    sensors = {
        name: SensorCalibration(moved @ known.world_from_sensor, known.residual_mm)
        for name, known in copy.calibration.sensors.items()
    }
    write_calibration(copy, replace(copy.calibration, sensors=sensors))
    description = json.loads((copy.path / "recording.json").read_text())
    description["region"] = {"min": [0.0, 0.0, 0.0], "max": [1.0, 1.0, 1.0]}
    for sensor in description["sensors"]:
        sensor["camera"]["fx"] *= 1.01
    (copy.path / "recording.json").write_text(json.dumps(description))
    again = open_recording(copy.path)
    assert again.sensors[0].camera != limb.recording.sensors[0].camera
    assert fingerprint(again) == fingerprint(limb.recording)


def test_other_images_another_number_of_them_or_other_sensors_make_another_recording(limb, other):
    mine = limb.recording
    fewer = replace(mine, sensors=(replace(mine.sensors[0], frames=mine.sensors[0].frames[:-1]), *mine.sensors[1:]))
    alone = replace(mine, sensors=mine.sensors[:1])
    assert len({fingerprint(one) for one in (mine, other, fewer, alone)}) == 4


def test_a_motion_with_another_recording_is_refused_by_view_and_report_and_says_which_is_right(
    limb, subject, motion, other, tmp_path
):
    pytest.importorskip("plotly", reason="the report needs plotly")
    motion_scene(motion, subject, limb.recording, title="motion")
    said = r"leg: is not the recording that the motion was tracked in, which was called recording; give the recording"
    with pytest.raises(MotionError, match=said):
        motion_scene(motion, subject, other, title="motion")
    with pytest.raises(MotionError, match=said):
        write_report(motion, subject, other, tmp_path / "report.html", title="motion")
    assert not list(tmp_path.iterdir())


def test_a_subject_with_another_recording_is_refused_by_view(limb, subject, other):
    subject_scene(subject, limb.recording, title="subject")
    with pytest.raises(MotionError, match=r"leg: is not the recording that the subject was adapted in"):
        subject_scene(subject, other, title="subject")


def test_tracking_a_subject_in_another_recording_is_allowed_and_said(limb, subject, motion, other, tmp_path):
    assert adapted_elsewhere(subject, limb.recording) is None
    assert "was adapted in another recording (recording)" in adapted_elsewhere(subject, other)
    assert tracked_elsewhere(motion, subject) is None
    settings = TrackOptions().used(other, subject=subject_fingerprint(subject), thresholds={})
    elsewhere = replace(motion, settings=settings)
    assert "was adapted in another recording" in tracked_elsewhere(elsewhere, subject)
    pytest.importorskip("plotly", reason="the report needs plotly")
    write_report(elsewhere, subject, None, tmp_path / "report.html", title="motion")
    assert "adapted in another recording (recording)" in (tmp_path / "report.html").read_text()


def test_the_track_command_says_that_the_subject_is_of_another_recording(subject, other, tmp_path):
    save_subject(subject, tmp_path / "subject.npz")
    few = tmp_path / "few"
    shutil.copytree(other.path, few)
    for sensor in open_recording(few).sensors:
        listed = few / sensor.name / "frames.csv"
        listed.write_text("\n".join(listed.read_text().splitlines()[:3]) + "\n")
    command = [str(few), "--subject", str(tmp_path / "subject.npz"), "--out", str(tmp_path / "motion")]
    ran = CliRunner().invoke(track_command, command)
    assert ran.exit_code == 0, ran.output
    assert "adapted in another recording (recording)" in re.sub(r"\s+", " ", ran.output)
    assert (
        fingerprint(open_recording(few)) == load_motion(tmp_path / "motion").settings.options["recording_fingerprint"]
    )


def test_a_motion_is_exported_and_shown_with_the_subject_that_was_tracked_alone(subject, motion, stranger, tmp_path):
    save_subject(subject, tmp_path / "subject.npz")
    refuse_other_subject(motion, load_subject(tmp_path / "subject.npz"))
    for show in (
        lambda: export_motion(motion, stranger, tmp_path / "out"),
        lambda: motion_scene(motion, stranger, None, title="motion"),
    ):
        with pytest.raises(MotionError, match="is one of another subject; give the subject that was tracked"):
            show()
    assert not (tmp_path / "out").exists()


def test_of_an_older_motion_the_subject_is_told_by_how_it_poses_the_bones(limb, subject, stranger, other):
    older = replace(known_motion(limb), settings=None)
    refuse_other_subject(older, subject)
    with pytest.raises(MotionError, match="another subject"):
        refuse_other_subject(older, stranger)
    motion_scene(older, limb.subject, other, title="motion")  # it does not say where it was tracked


def test_a_motion_keeps_what_it_was_made_from_in_its_folder(motion, subject, tmp_path):
    save_motion(motion, tmp_path)
    options = load_motion(Path(tmp_path)).settings.options
    assert options["subject_fingerprint"] == subject_fingerprint(subject)
    assert len(options["recording_fingerprint"]) == 32
