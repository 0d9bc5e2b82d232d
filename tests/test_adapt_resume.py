"""An adaptation that was cut short goes on where it stopped, to the same subject, and leaves nothing behind."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import adapt.adapt_recording as fitting
import adapt.search.candidates as finding
from adapt.adapt_to_file import adapt_into, journal_path
from adapt.options import AdaptOptions
from adapt.search.first_pose import try_pose
from adapt.search.search_journal import FoundPoses
from adapt.subject import load_subject
from capture.cloud.fuse import Region
from capture.errors import FitError
from capture.journal import BEGUN_ANEW, resume_journal

FRAMES = (0, 3, 6, 9)


class Stopped(Exception):
    pass


@pytest.fixture
def searched(limb, monkeypatch):
    """The frames that were searched for the limb; the search itself is replaced by a fit near the truth."""
    calls = []

    def locate(body, target, sample, starts, *, good_m=0.0):
        frame = next(k for k, other in enumerate(limb.targets) if same_cloud(other, target))
        calls.append(frame)
        pose = try_pose(body, target, sample, limb.thetas[frame] + 0.02)
        assert pose is not None
        return pose

    monkeypatch.setattr(finding, "locate", locate)
    monkeypatch.setattr(fitting, "adapt_body", partial(fitting.adapt_body, outer_rounds=1, optimise_skin=False))
    return calls


def same_cloud(one, other):
    return np.array_equal(one.cloud.points, other.cloud.points)


def stop_at(text):
    def progress(said, share):
        assert 0.0 <= share < 1.0
        if said == text:
            raise Stopped

    return progress


OPTIONS = AdaptOptions(frames=FRAMES, poses=4)


def adapted(limb, out, **how):
    return adapt_into(out, limb.recording, limb.subject.anatomy, OPTIONS, **how)


def test_an_adaptation_that_was_cut_short_does_not_search_again(limb, tmp_path, searched):
    whole = adapted(limb, tmp_path / "whole.npz")
    order = searched.copy()
    assert len(order) > len(FRAMES)  # some frames are searched before the poses are carried on
    searched.clear()
    for stop in ("searching the limb in frame 2 of 2", "first pose 2 of 4", "first pose 3 of 4"):
        with pytest.raises(Stopped):
            adapted(limb, tmp_path / "again.npz", progress=stop_at(stop))
        assert {path.name for path in tmp_path.iterdir()} == {"whole.npz", journal_path(tmp_path / "again.npz").name}
    again = adapted(limb, tmp_path / "again.npz")
    assert searched == order
    assert {path.name for path in tmp_path.iterdir()} == {"whole.npz", "again.npz"}
    for subject in (again, load_subject(tmp_path / "again.npz")):
        np.testing.assert_array_equal(subject.body.shape, whole.body.shape)
        np.testing.assert_array_equal(subject.thetas, whole.thetas)
    np.testing.assert_array_equal(again.body.v_hat, whole.body.v_hat)
    np.testing.assert_array_equal(again.covariance, whole.covariance)
    assert again.report == whole.report
    kept = load_subject(tmp_path / "again.npz").report["settings"]
    assert (kept["region"], kept["frames_given"]) == ("automatic", list(FRAMES))
    assert {"bonetrack", "Python", "numpy"} <= set(kept["versions"])


@pytest.mark.parametrize("what", ["anatomy", "options", "first poses", "region", "recording"])
def test_what_was_found_with_other_inputs_is_not_used(limb, tmp_path, searched, what):
    out, recording, anatomy = tmp_path / "subject.npz", limb.recording, limb.subject.anatomy
    with pytest.raises(Stopped):
        adapted(limb, out, progress=stop_at("first pose 3 of 4"))
    options, told = OPTIONS, []
    if what == "anatomy":
        anatomy = replace(anatomy, landmarks=anatomy.landmarks + 1e-6)
    elif what == "options":
        options = replace(options, poses=5)
    elif what == "first poses":
        options = replace(options, first_poses={FRAMES[1]: limb.thetas[FRAMES[1]]})
    elif what == "region":
        options = replace(options, region=Region(np.full(3, -9.0), np.full(3, 9.0)))
    else:
        first, *others = recording.sensors
        moved = replace(first, camera=replace(first.camera, fx=first.camera.fx + 0.1))
        recording = replace(recording, sensors=(moved, *others))

    def at_once(said, share):
        raise Stopped

    assert journal_path(out).read_text().count("\n") > 1
    with pytest.raises(Stopped):
        adapt_into(out, recording, anatomy, options, progress=at_once, told=told.append)
    assert told == [f"{journal_path(out)}: {BEGUN_ANEW}"]
    assert journal_path(out).read_text().count("\n") == 1  # the key alone


def test_a_search_that_found_nothing_is_not_done_again_either(tmp_path):
    def nothing():
        raise FitError("nothing there", where="here", remedy="look elsewhere")

    def never():
        raise AssertionError("searched again")

    with pytest.raises(FitError):
        FoundPoses(resume_journal(tmp_path / "journal", "0" * 64)).find("frame 1", nothing)
    with pytest.raises(FitError, match="here: nothing there; look elsewhere"):
        FoundPoses(resume_journal(tmp_path / "journal", "0" * 64)).find("frame 1", never)


def test_an_adaptation_that_fails_leaves_nothing_behind(limb, tmp_path, monkeypatch):
    def nothing(*_, **__):
        raise FitError("nothing there")

    monkeypatch.setattr(finding, "locate", nothing)
    with pytest.raises(FitError, match="nothing there"):
        adapted(limb, tmp_path / "subject.npz")
    assert not list(tmp_path.iterdir())
