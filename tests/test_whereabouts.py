"""A motion knows its subject and its recording: commands need not be told, and say so where one is gone."""

from __future__ import annotations

import shutil
from dataclasses import replace

import pytest

from adapt.subject import load_subject, save_subject
from tests.command_line import bonetrack
from tests.known_motion import reported_subject
from tests.test_cli import fails
from track.motion import load_motion
from track.track_recording import track_recording
from track.whereabouts import recording_of, subject_of


@pytest.fixture(scope="module")
def results(limb, tmp_path_factory):
    """A folder with a recording, its subject and the motion tracked, which a test copies or leaves as it is."""
    folder = tmp_path_factory.mktemp("results") / "walk"
    shutil.copytree(limb.recording.path, folder / "recording")
    save_subject(reported_subject(limb), folder / "subject.npz")
    bonetrack("track", folder / "recording", "--subject", folder / "subject.npz", "--out", folder / "motion")
    return folder


def test_results_are_taken_out_without_naming_what_they_were_made_from(results, tmp_path):
    motion = results / "motion"
    assert bonetrack("export", motion, "--out", tmp_path / "exported").code == 0
    assert bonetrack("report", motion, "--out", tmp_path / "report.html").code == 0
    assert "Errors against the truth" in (tmp_path / "report.html").read_text(encoding="utf-8")
    ran = bonetrack("evaluate", motion)
    assert ran.code == 0, ran.err
    assert "errors against the truth" in ran.out
    assert bonetrack("view", motion, "--html", tmp_path / "view.html").code == 0


def test_results_that_were_moved_as_a_whole_still_know_each_other(results, tmp_path):
    moved = shutil.copytree(results, tmp_path / "elsewhere")
    motion = load_motion(moved / "motion")
    assert subject_of(motion, moved / "motion").resolve() == (moved / "subject.npz").resolve()
    assert recording_of(motion, moved / "motion").resolve() == (moved / "recording").resolve()


def test_a_motion_that_was_moved_alone_finds_both_where_they_were(results, tmp_path):
    shutil.copytree(results / "motion", tmp_path / "alone")
    motion = load_motion(tmp_path / "alone")
    assert subject_of(motion, tmp_path / "alone") == results / "subject.npz"
    assert recording_of(motion, tmp_path / "alone") == results / "recording"


def test_a_subject_that_is_gone_is_asked_for_by_where_it_was(limb, tmp_path):
    save_subject(limb.subject, tmp_path / "subject.npz")
    track_recording(limb.recording, load_subject(tmp_path / "subject.npz"), tmp_path / "motion")
    (tmp_path / "subject.npz").unlink()
    said = fails("export", tmp_path / "motion", "--out", tmp_path / "out", saying=str(tmp_path / "subject.npz"))
    assert "give --subject" in said
    assert not (tmp_path / "out").exists()


def test_a_recording_that_is_gone_is_told_and_the_report_goes_without(results, limb, tmp_path):
    moved = shutil.copytree(results, tmp_path / "first")
    bonetrack("track", moved / "recording", "--subject", moved / "subject.npz", "--out", tmp_path / "first" / "again")
    shutil.rmtree(moved / "recording")
    ran = bonetrack("report", moved / "again", "--out", tmp_path / "report.html")
    assert ran.code == 0, ran.err
    assert f"its recording is not at {moved / 'recording'} any more" in ran.out
    assert "Errors against the truth" not in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "give --truth" in fails("evaluate", moved / "again", saying="recording")


def test_a_motion_of_an_older_version_is_asked_for_its_subject(limb, tmp_path):
    in_no_file = replace(limb.subject, path=None)
    motion = track_recording(limb.recording, in_no_file, tmp_path / "motion")
    assert "subject" not in motion.settings.places
    fails("export", tmp_path / "motion", "--out", tmp_path / "out", saying="give --subject")
