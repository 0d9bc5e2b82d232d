"""Tracking: a subject is followed through time, loss is said and overcome, and a killed run goes on."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

import track.tracker
from adapt.fit.pose import fit_pose
from adapt.fit.posterior import pose_covariance
from adapt.match.correspondences import Target
from adapt.match.skin_sample import sample_skin
from adapt.model.body import joint_centres
from adapt.model.pose_space import advance, pose_difference
from adapt.model.size import resized
from adapt.subject import save_subject
from capture.cloud.fuse import Region, region_of_interest
from capture.journal import BEGUN_ANEW
from capture.recording import open_recording
from capture.rigid import exp_so3, log_so3
from tests.known_limb import FPS, FRAMES, bent, exact_cloud, exact_target, known_subject
from track.motion import MotionError, load_motion
from track.options import TrackOptions
from track.poses_by_hand import HandPose
from track.prediction import predict
from track.track_recording import JOURNAL, track_recording
from track.tracked_frame import TrackerState
from track.tracker import make_tracker


@pytest.fixture(scope="module")
def tracker(limb):
    return make_tracker(limb.subject)


@pytest.fixture(scope="module")
def tracked(limb, tmp_path_factory):
    """The motion of an undisturbed run, and its folder."""
    folder = tmp_path_factory.mktemp("tracked") / "motion"
    return track_recording(limb.recording, limb.subject, folder), folder


def state_of(limb, frame):
    """The state after a frame that was tracked without error."""
    velocity = pose_difference(limb.subject.anatomy, limb.thetas[frame], limb.thetas[frame - 1]) * FPS
    return known_state(limb.subject.anatomy, float(limb.times[frame]), limb.thetas[frame], velocity)


def known_state(anatomy, time_s, theta, velocity):
    """The state after a frame in which every bone showed."""
    shown = np.ones(len(anatomy.bones), dtype=bool)
    return TrackerState(time_s, theta, velocity, shown, np.full(len(theta), time_s))


def test_a_performance_is_followed_without_loss(limb, tracked):
    motion, _ = tracked
    assert motion.lost == ("",) * FRAMES
    i = [limb.subject.anatomy.coordinate_index(name) for name in ("elbow_flexion", "pro_sup")]
    errors = np.rad2deg(np.abs(motion.thetas[:, i] - limb.thetas[:, i]))
    assert (errors.mean(axis=0) < [2.0, 6.0]).all(), errors.mean(axis=0)
    for t in range(FRAMES):
        for name, centre in joint_centres(limb.subject.body, limb.thetas[t]).items():
            assert np.linalg.norm(motion.centres[name][t] - centre) < 0.015, (t, name)


@pytest.mark.parametrize(("merged", "lost"), [(0.6, True), (0.2, False)])
def test_a_limb_found_anew_whose_outline_lies_on_other_surface_is_lost(limb, tracker, monkeypatch, merged, lost):
    """A person's trunk has points near all the skin of an arm laid on it: only the outline tells."""
    scored = track.tracker.score_pose
    monkeypatch.setattr(track.tracker, "score_pose", lambda *given: replace(scored(*given), merged_outline=merged))
    frame, state = tracker.first(limb.targets[0], 0.0)
    assert ("outline lies on other surface" in frame.lost) == lost
    assert np.isnan(frame.theta).all() == lost
    assert (state is None) == lost


@pytest.mark.parametrize(("elbow", "twist", "began"), [(20.0, -50.0, 85.0), (70.0, 0.0, 85.0), (70.0, 50.0, -85.0)])
def test_a_childs_forearm_found_anew_is_turned_into_its_place(limb, elbow, twist, began):
    """A thin forearm turned by half its range has points near all its skin: that is no pose to begin with."""
    child = resized(limb.subject.body, 0.6)
    target = exact_target(child, bent(child, elbow, twist))
    subject = known_subject(child, bent(child, elbow + 15.0, began)[None], np.zeros(1))
    as_adapted = {"median_distance_mm": 0.2, "skin_to_cloud_mm": 2.6}
    frame, _ = make_tracker(replace(subject, report=subject.report | {"poses": [as_adapted]})).first(target, 0.0)
    turn = child.anatomy.coordinate_index("pro_sup")
    assert abs(np.rad2deg(frame.theta[turn]) - twist) < 5.0


def test_a_motion_says_how_sure_it_is(tracked):
    motion, _ = tracked
    assert (motion.deviations > 0.0).all()
    assert (motion.residuals < 0.004).all()
    assert (motion.coverage > 0.8).all()
    assert (motion.matches > 100).all()


def test_a_motion_keeps_what_it_was_tracked_with(limb, tracked, tracker, tmp_path):
    motion, folder = tracked
    assert motion.settings is not None
    assert motion.settings.options["recording"] == limb.recording.path.name
    assert motion.settings.options["region"] == "automatic"
    automatic = region_of_interest(limb.recording)
    np.testing.assert_array_equal(motion.settings.region.minimum, automatic.minimum)
    assert motion.settings.thresholds["largest_residual_found_anew_m"] == tracker.usual_m
    assert "numpy" in motion.settings.versions
    assert load_motion(folder).settings == motion.settings
    hand = HandPose("raised", 1, limb.thetas[1])
    given = track_recording(
        limb.recording,
        limb.subject,
        tmp_path,
        TrackOptions(region=wide(limb), poses=[hand], world_from_thorax=np.eye(4)),
    ).settings
    assert given.options["region"] == "given"
    np.testing.assert_array_equal(given.region.maximum, wide(limb).maximum)
    assert given.options["poses_by_hand"] == [{"name": "raised", "frame": 1}]
    assert given.options["world_from_thorax"] == np.eye(4).tolist()
    assert load_motion(tmp_path).settings == given


def test_frames_with_nothing_in_them_are_lost_and_the_next_ones_tracked(limb, tmp_path):
    shutil.copytree(limb.recording.path, tmp_path / "recording")
    for sensor in limb.recording.sensors:
        for lost in (0, 4):
            blank(tmp_path / "recording" / sensor.frames[lost].path.relative_to(limb.recording.path))
    motion = track_recording(
        open_recording(tmp_path / "recording"), limb.subject, tmp_path / "motion", TrackOptions(region=wide(limb))
    )
    assert [t for t in range(FRAMES) if motion.lost[t]] == [0, 4]
    assert "no sensor saw anything" in motion.lost[4]
    assert np.isnan(motion.thetas[[0, 4]]).all()
    assert np.isnan(motion.deviations[[0, 4]]).all()
    assert all(np.isnan(centres[[0, 4]]).all() for centres in motion.centres.values())
    assert np.isfinite(np.delete(motion.thetas, [0, 4], axis=0)).all()
    elbow = limb.subject.anatomy.coordinate_index("elbow_flexion")
    assert abs(motion.thetas[5, elbow] - limb.thetas[5, elbow]) < np.deg2rad(4.0)


def wide(limb):
    points = np.concatenate([target.cloud.points for target in limb.targets])
    return Region(points.min(axis=0) - 0.05, points.max(axis=0) + 0.05)


def blank(image):
    """Overwrite a depth image with one without any reading."""
    from capture.recording.depth_png import image_size, write_readings

    width, height = image_size(image)
    write_readings(image, np.zeros((height, width), np.uint16))


def test_a_cloud_of_something_else_is_refused_as_lost(limb, tracker):
    state = state_of(limb, 3)
    vertices, faces = ball(0.12)
    vertices = vertices + limb.targets[4].cloud.points.mean(axis=0)
    frame, after = tracker.follow(Target(exact_cloud(vertices, faces)), state.time_s + 1 / FPS, state)
    assert frame.lost
    assert np.isnan(frame.theta).all()
    assert (after.time_s, after.theta.tolist()) == (state.time_s, state.theta.tolist())


def ball(radius):
    from capture._open3d import open3d

    mesh = open3d().geometry.TriangleMesh.create_sphere(radius, resolution=40)
    return np.asarray(mesh.vertices), np.asarray(mesh.triangles).astype(np.int64)


def test_a_limb_that_jumped_while_nobody_looked_is_found_again(limb, tracker):
    state = replace(state_of(limb, 1), velocity=np.zeros(len(limb.thetas[0])))
    frame, _ = tracker.follow(limb.targets[7], state.time_s + 2.0, state)
    assert not frame.lost
    elbow = limb.subject.anatomy.coordinate_index("elbow_flexion")
    assert abs(frame.theta[elbow] - limb.thetas[7, elbow]) < np.deg2rad(4.0)


def test_an_arm_is_followed_past_half_a_turn_of_its_rotation_vector(limb, tracker):
    """There the vector's sign turns over from one frame to the next, though the arm hardly moves."""
    anatomy, body = limb.subject.anatomy, limb.subject.body
    axis = np.array([0.0, 1.0, 0.0])
    poses = np.tile(limb.thetas[0], (5, 1))
    for theta, angle in zip(poses, np.deg2rad([172.0, 176.0, 180.0, 184.0, 188.0]), strict=True):
        theta[:3] = log_so3(exp_so3(angle * axis))
    step = pose_difference(anatomy, poses[1], poses[0])
    state = known_state(anatomy, 0.0, poses[0], step * 15.0)
    for k in range(1, len(poses)):
        frame, state = tracker.follow(exact_target(body, poses[k]), k / 15.0, state)
        assert not frame.lost, (k, frame.lost)
        error = pose_difference(anatomy, frame.theta, poses[k])
        assert np.linalg.norm(error[:3]) < np.deg2rad(2.0), (k, np.rad2deg(error[:3]))


def test_a_pose_difference_leads_from_one_pose_to_the_other(limb):
    anatomy, rng = limb.subject.anatomy, np.random.default_rng(0)
    for _ in range(20):
        start, end = rng.normal(size=(2, len(anatomy.coordinates)))
        start[:3], end[:3] = rng.uniform(-3.0, 3.0, (2, 3))
        reached = advance(anatomy, start, pose_difference(anatomy, end, start))
        np.testing.assert_allclose(exp_so3(reached[:3]), exp_so3(end[:3]), atol=1e-9)
        np.testing.assert_allclose(reached[3:], end[3:], atol=1e-12)
        assert np.linalg.norm(reached[:3]) <= np.pi + 1e-12


def test_a_small_turn_across_half_a_turn_is_a_small_difference(limb):
    anatomy = limb.subject.anatomy
    before, after = np.zeros((2, len(anatomy.coordinates)))
    before[:3], after[:3] = [0.0, np.pi - 0.02, 0.0], [0.0, -np.pi + 0.03, 0.0]
    np.testing.assert_allclose(pose_difference(anatomy, after, before)[:3], [0.0, 0.05, 0.0], atol=1e-9)
    np.testing.assert_allclose(advance(anatomy, before, pose_difference(anatomy, after, before)), after, atol=1e-9)


def test_predictions_go_on_with_constant_velocity_and_grow_unsure(limb):
    state = state_of(limb, 3)
    soon, later = (predict(limb.subject.anatomy, state, state.time_s + dt) for dt in (1 / 30, 1 / 10))
    expected = advance(limb.subject.anatomy, state.theta, state.velocity / 30.0)
    np.testing.assert_allclose(soon.mean, expected, atol=1e-12)
    assert (np.diag(later.precision) < np.diag(soon.precision)).all()
    assert (np.linalg.eigvalsh(soon.precision) > 0.0).all()
    long_after = predict(limb.subject.anatomy, state, state.time_s + 60.0)
    np.testing.assert_allclose(long_after.mean, state.theta, atol=1e-6)


def test_a_pose_is_less_sure_the_fewer_points_it_rests_on(limb):
    sample = sample_skin(limb.subject.anatomy, at_most=1500)
    fit = fit_pose(limb.subject.body, limb.targets[2], limb.thetas[2], sample)
    of_known_shape = replace(limb.subject, covariance=np.zeros_like(limb.subject.covariance))
    covariance = pose_covariance(of_known_shape, fit, sample)
    np.testing.assert_allclose(covariance, covariance.T, atol=1e-12)
    assert (np.linalg.eigvalsh(covariance) > 0.0).all()
    matches = fit.matches.at(slice(None, None, 4))
    fewer = pose_covariance(of_known_shape, replace(fit, matches=matches, distances=fit.distances[::4]), sample)
    assert (np.diag(fewer) > 1.5 * np.diag(covariance)).all()


def test_a_shape_that_is_less_sure_makes_poses_less_sure(limb):
    sample = sample_skin(limb.subject.anatomy, at_most=1500)
    fit = fit_pose(limb.subject.body, limb.targets[2], limb.thetas[2], sample)
    vaguer = replace(limb.subject, covariance=100.0 * limb.subject.covariance)
    sure, unsure = (np.diag(pose_covariance(subject, fit, sample)) for subject in (limb.subject, vaguer))
    assert (unsure > sure).all()


class Stopped(Exception):
    pass


def stop_after(count):
    def progress(done, total):
        if done == count:
            raise Stopped

    return progress


def same_motion(one, other):
    for name in ("times", "thetas", "deviations", "shown", "residuals", "coverage", "matches"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert one.lost == other.lost


def test_a_run_that_was_stopped_goes_on_to_the_same_motion(limb, tracked, tmp_path):
    with pytest.raises(Stopped):
        track_recording(limb.recording, limb.subject, tmp_path / "motion", progress=stop_after(5))
    assert {path.name for path in (tmp_path / "motion").iterdir()} == {JOURNAL}
    seen, told = [], []
    motion = track_recording(
        limb.recording,
        limb.subject,
        tmp_path / "motion",
        progress=lambda done, total: seen.append(done),
        told=told.append,
    )
    assert not told
    assert seen == list(range(6, FRAMES + 2))  # the first frame is looked at again from the second
    same_motion(motion, tracked[0])
    same_motion(load_motion(tmp_path / "motion"), tracked[0])
    for name in ("angles.mot", "centres.trc", "quality.csv"):
        assert (tmp_path / "motion" / name).read_text() == (tracked[1] / name).read_text()
    assert not (tmp_path / "motion" / JOURNAL).exists()


RUN = """
import sys
from pathlib import Path
from adapt.subject import load_subject
from capture.recording import open_recording
from track.track_recording import track_recording
recording, subject, out = map(Path, sys.argv[1:])
track_recording(open_recording(recording), load_subject(subject), out)
"""


def test_a_run_that_was_killed_goes_on_to_the_same_motion(limb, tracked, tmp_path):
    save_subject(limb.subject, tmp_path / "subject.npz")
    out = tmp_path / "motion"
    command = [sys.executable, "-c", RUN, str(limb.recording.path), str(tmp_path / "subject.npz"), str(out)]
    process = subprocess.Popen(command)
    deadline = time.monotonic() + 60.0
    while lines_of(out / JOURNAL) < 6 and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    assert 6 <= lines_of(out / JOURNAL) <= FRAMES
    assert not (out / "motion.npz").exists()
    (out / ".motion.partial-1.npz").write_bytes(b"cut short")  # as if killed while writing
    seen = []
    track_recording(limb.recording, limb.subject, out, progress=lambda done, total: seen.append(done))
    assert seen[0] == 6  # what to go on from stands in every fifth line
    same_motion(load_motion(out), tracked[0])
    assert {path.name for path in out.iterdir()} == {path.name for path in tracked[1].iterdir()}


def lines_of(path):
    return path.read_bytes().count(b"\n") if path.is_file() else 0


@pytest.fixture(scope="module")
def journal(limb, tmp_path_factory):
    """The journal of a run that was stopped after six frames."""
    folder = tmp_path_factory.mktemp("stopped") / "motion"
    with pytest.raises(Stopped):
        track_recording(limb.recording, limb.subject, folder, progress=stop_after(6))
    return folder / JOURNAL


@pytest.fixture
def stopped(journal, tmp_path):
    """A folder with that journal in it."""
    (tmp_path / "motion").mkdir()
    shutil.copy(journal, tmp_path / "motion" / JOURNAL)
    return tmp_path / "motion"


@pytest.mark.parametrize("damage", ["cut off", "unreadable", "not text"])
def test_a_journal_line_that_is_cut_off_or_damaged_is_tracked_again(limb, tracked, stopped, damage):
    lines = (stopped / JOURNAL).read_bytes().split(b"\n")
    if damage == "cut off":
        lines = [*lines[:6], lines[6][:100]]
    else:
        lines[5] = b"{]" if damage == "unreadable" else b"\xff\xfe\x00"
    (stopped / JOURNAL).write_bytes(b"\n".join(lines))
    seen = []
    motion = track_recording(limb.recording, limb.subject, stopped, progress=lambda done, total: seen.append(done))
    assert seen[0] == (6 if damage == "cut off" else 1)  # what to go on from stands in every fifth line
    same_motion(motion, tracked[0])


@pytest.mark.parametrize("what", ["subject", "covariance", "region", "images", "camera"])
def test_a_journal_made_from_other_inputs_is_not_continued(limb, stopped, tmp_path, what):
    recording, subject, region = limb.recording, limb.subject, None
    if what == "subject":
        body = replace(subject.body, v_hat=subject.body.v_hat + 1e-4)
        subject = replace(subject, body=body)
    elif what == "covariance":
        subject = replace(subject, covariance=2.0 * subject.covariance)
    elif what == "region":
        region = wide(limb)
    elif what == "images":
        shutil.copytree(recording.path, tmp_path / "recording")
        recording = open_recording(tmp_path / "recording")
        blank(recording.sensors[0].frames[2].path)
    else:
        first, *others = recording.sensors
        moved = replace(first, camera=replace(first.camera, fx=first.camera.fx + 0.1))
        recording = replace(recording, sensors=(moved, *others))
    seen, told = [], []

    def progress(done, total):
        seen.append(done)
        raise Stopped

    with pytest.raises(Stopped):
        track_recording(recording, subject, stopped, TrackOptions(region=region), progress=progress, told=told.append)
    assert seen == [1]
    assert told == [f"{stopped / JOURNAL}: {BEGUN_ANEW}"]


def test_a_folder_with_other_things_in_it_is_left_alone(limb, tmp_path):
    (tmp_path / "diary.txt").write_text("dear diary")
    with pytest.raises(MotionError, match=r"diary\.txt"):
        track_recording(limb.recording, limb.subject, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["diary.txt"]
    with pytest.raises(MotionError, match="is a file"):
        track_recording(limb.recording, limb.subject, tmp_path / "diary.txt")
