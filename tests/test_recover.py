"""A lost limb is found again at little cost, and the gap is gone into from behind, or from a pose set by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import track.tracker
from capture.errors import FitError
from tests.test_track import Stopped, same_motion, stop_after
from track.backward_pass import anchors, go_back
from track.cloud_change import look_of, looks_changed
from track.motion import MotionError, load_motion
from track.options import TrackOptions
from track.poses_by_hand import HandPose
from track.track_recording import track_recording
from track.tracked_frame import BACKWARD, BY_HAND, FOLLOWED, FOUND, TrackerState
from track.tracker import Tracker, make_tracker

FPS = 30.0


@pytest.fixture(scope="module")
def tracker(limb):
    return make_tracker(limb.subject)


@pytest.fixture(scope="module")
def true_frames(limb, tracker):
    """Frames as if they had been tracked without error."""
    shown = np.ones(len(limb.subject.anatomy.bones), dtype=bool)
    some = tracker.missed(0.0, "")
    return [
        replace(some, time_s=float(time), theta=theta, shown=shown, residual_m=0.001)
        for time, theta in zip(limb.times, limb.thetas, strict=True)
    ]


def lost_at(tracker, frames, gap):
    return [tracker.missed(f.time_s, "hidden") if k in gap else f for k, f in enumerate(frames)]


def flexion_error(limb, theta, frame):
    elbow = limb.subject.anatomy.coordinate_index("elbow_flexion")
    return np.rad2deg(abs(theta[elbow] - limb.thetas[frame, elbow]))


def test_a_gap_is_gone_into_from_where_the_limb_was_found_again(limb, tracker, true_frames):
    frames = lost_at(tracker, true_frames, {3, 4})
    frames[5] = replace(frames[5], how=FOUND)
    assert anchors(frames) == [5, 6]
    asked = []

    def step(k, state):
        asked.append(k)
        return tracker.follow(limb.targets[k], -float(limb.times[k]), state, searching=False)

    revised = go_back(tracker, frames, 5, step)
    assert asked == [4, 3, 2]  # at 2 they meet
    assert [frame.how for frame in revised[:6]] == [FOLLOWED] * 3 + [BACKWARD] * 2 + [FOUND]
    assert [frame.time_s for frame in revised] == [frame.time_s for frame in frames]
    for k in (3, 4):
        assert flexion_error(limb, revised[k].theta, k) < 3.0
        assert (np.diag(revised[k].covariance) > 0.0).all()


def test_a_limb_that_is_not_there_is_not_looked_for_far_back(tracker, true_frames):
    frames = [replace(true_frames[0], time_s=k / FPS) for k in range(60)]
    frames = lost_at(tracker, frames, range(5, 50))
    asked = []

    def step(k, state):
        asked.append(k)
        return tracker.missed(-frames[k].time_s, "nothing"), state

    revised = go_back(tracker, frames, 50, step)
    assert 10 <= len(asked) <= 16
    assert [frame.lost for frame in revised] == [frame.lost for frame in frames]


def test_of_two_poses_the_one_nearer_to_the_cloud_is_kept(tracker, true_frames):
    frames = lost_at(tracker, true_frames[:6], {3})
    frames[4] = replace(frames[4], how=FOUND)
    frames[1] = replace(frames[1], residual_m=0.0006)
    elsewhere = true_frames[0].theta + 0.3

    def step(k, state):
        return replace(true_frames[k], time_s=-true_frames[k].time_s, theta=elsewhere, residual_m=0.0007), state

    assert [frame.how for frame in go_back(tracker, frames, 4, step)[:4]] == [BACKWARD, FOLLOWED, BACKWARD, BACKWARD]


def test_from_a_pose_set_by_hand_the_way_back_is_preferred_up_to_the_gap(tracker, true_frames):
    frames = lost_at(tracker, true_frames[:8], {2})
    frames[6] = replace(frames[6], how=BY_HAND)
    elsewhere = true_frames[0].theta + 0.3

    def step(k, state):
        return replace(true_frames[k], time_s=-true_frames[k].time_s, theta=elsewhere, residual_m=0.004), state

    told = [frame.how for frame in go_back(tracker, frames, 6, step)]
    assert told == [FOLLOWED] * 2 + [BACKWARD] * 4 + [BY_HAND, FOLLOWED]


def test_a_pose_found_anew_is_held_against_the_frame_after_it(limb, tracker):
    """A forearm that was found turned in the first frame, and followed rightly from the second."""
    frames, state = [], tracker.nothing_known()
    for k in range(3):
        frame, state = tracker.follow(limb.targets[k], float(limb.times[k]), state)
        frames.append(frame)
    turn = limb.subject.anatomy.coordinate_index("pro_sup")
    turned = frames[0].theta.copy()
    turned[turn] -= np.deg2rad(60.0)
    frames[0] = replace(frames[0], theta=turned, skin_m=1.3 * frames[0].skin_m)
    assert anchors(frames) == [1]

    def step(k, state):
        return tracker.follow(limb.targets[k], -float(limb.times[k]), state, searching=False)

    revised = go_back(tracker, frames, 1, step)
    assert [frame.how for frame in revised] == [BACKWARD, FOLLOWED, FOLLOWED]
    assert abs(np.rad2deg(revised[0].theta[turn] - limb.thetas[0, turn])) < 6.0


def test_a_pose_set_by_hand_is_where_tracking_starts(limb, tracker):
    theta = limb.thetas[4] + np.where(np.arange(len(limb.thetas[4])) < 6, 0.01, 0.1)
    frame, state = tracker.given(limb.targets[4], 0.0, theta, tracker.nothing_known())
    assert frame.how == BY_HAND
    assert flexion_error(limb, frame.theta, 4) < 3.0
    assert state.time_s == 0.0
    far = theta.copy()
    far[5] += 0.5
    frame, state = tracker.given(limb.targets[4], 0.0, far, tracker.nothing_known())
    assert frame.lost.startswith("from the pose set by hand ")
    assert state.time_s == -np.inf


@pytest.fixture
def nothing_is_found(monkeypatch):
    def nothing(*_, **__):
        raise FitError("nothing there")

    monkeypatch.setattr(track.tracker, "locate", nothing)


@pytest.mark.usefixtures("nothing_is_found")
def test_with_one_pose_set_by_hand_a_limb_that_no_search_finds_is_tracked(limb, tmp_path):
    pose = HandPose("here", 6, limb.thetas[6] + 0.02)
    motion = track_recording(limb.recording, limb.subject, tmp_path / "motion", TrackOptions(poses=[pose]))
    assert motion.how == (BACKWARD,) * 6 + (BY_HAND,) + (FOLLOWED,) * 5
    for k in range(12):
        assert flexion_error(limb, motion.thetas[k], k) < 4.0
    assert (tmp_path / "motion" / "quality.csv").read_text().count("backward") == 6
    assert load_motion(tmp_path / "motion").how == motion.how
    for done in (3, 15):  # in the middle of either direction
        with pytest.raises(Stopped):
            track_recording(
                limb.recording, limb.subject, tmp_path / "again", TrackOptions(poses=[pose]), progress=stop_after(done)
            )
    same_motion(track_recording(limb.recording, limb.subject, tmp_path / "again", TrackOptions(poses=[pose])), motion)


@pytest.mark.usefixtures("nothing_is_found")
def test_a_run_with_other_poses_set_by_hand_begins_anew(limb, tmp_path):
    for frame, by in ((6, 0.0), (6, 0.01), (7, 0.01)):
        seen = []

        def stop(done, total, seen=seen):
            seen.append(done)
            raise Stopped

        pose = HandPose("here", frame, limb.thetas[frame] + by)
        with pytest.raises(Stopped):
            track_recording(
                limb.recording, limb.subject, tmp_path / "motion", TrackOptions(poses=[pose]), progress=stop
            )
        assert seen == [1]


def test_a_pose_of_a_frame_that_is_not_there_is_refused(limb, tmp_path):
    with pytest.raises(MotionError, match=r"'here' is of frame 12; frames run from 0 to 11"):
        track_recording(
            limb.recording, limb.subject, tmp_path / "m", TrackOptions(poses=[HandPose("here", 12, limb.thetas[0])])
        )
    assert not (tmp_path / "m").exists()


@pytest.fixture
def searches(tracker, monkeypatch):
    """Times at which the limb is searched for, always in vain; following it does not find it either."""
    times = []

    def first(self, target, time_s):
        times.append(time_s)
        return self.missed(time_s, "not there"), None

    monkeypatch.setattr(Tracker, "first", first)
    monkeypatch.setattr(Tracker, "_continue", lambda self, target, time_s, state: (self.missed(time_s, "gone"), state))
    return times


def run(tracker, target, start_s, end_s, state):
    for k in range(round(start_s * FPS), round(end_s * FPS)):
        _, state = tracker.follow(target, k / FPS, state)
    return state


def test_while_the_cloud_stays_as_it_is_a_lost_limb_is_searched_ever_more_seldom(limb, tracker, searches):
    shown = np.ones(len(limb.subject.anatomy.bones), dtype=bool)
    state = TrackerState(0.0, limb.thetas[0], np.zeros(10), shown, np.zeros(10))
    run(tracker, limb.targets[0], 0.0, 16.0, state)
    assert len(searches) == 5
    assert searches[0] < 0.6


def test_when_the_cloud_changes_a_lost_limb_is_searched_within_half_a_second(limb, tracker, searches):
    state = run(tracker, limb.targets[0], 0.0, 10.0, tracker.nothing_known())
    searches.clear()
    cloud = limb.targets[0].cloud
    moved = replace(limb.targets[0], cloud=replace(cloud, points=cloud.points + 0.05))
    run(tracker, moved, 10.0, 10.6, state)
    assert len(searches) == 1


def test_before_the_limb_was_ever_found_it_is_not_searched_in_every_frame(limb, tracker, searches):
    frame, state = tracker.follow(limb.targets[0], 0.0, tracker.nothing_known())
    assert frame.lost == "not there"
    frame, _ = tracker.follow(limb.targets[0], 0.1, state)
    assert frame.lost == "not found yet"
    assert searches == [0.0]


def test_a_cloud_looks_other_when_a_limb_comes_into_it(limb):
    whole = limb.targets[0].cloud
    half = replace(whole, points=whole.points[whole.points[:, 0] < np.median(whole.points[:, 0])])
    assert looks_changed(look_of(whole), look_of(half))
    assert not looks_changed(look_of(whole), look_of(replace(whole, points=whole.points + 0.005)))


FITS = [  # of the skin when adapted and now (mm), whether the root bone shows, and whether that is too bad
    (0.8, 3.9, True, True),  # on a board
    (0.8, 1.9, True, False),
    (1.7, 4.7, True, False),  # a real arm in a sleeve
    (1.7, 2.7, False, True),  # real stills whose upper arm does not show: a forearm on the upper arm
    (0.7, 1.2, False, False),  # and where it belongs
    (None, 3.2, True, True),  # an arm on a leg, by a file that does not say how it fitted
    (None, 2.6, True, False),
]


@pytest.mark.parametrize(("adapted_mm", "now_mm", "root_shows", "lost"), FITS)
@pytest.mark.parametrize("gap_s", [None, 0.2])
def test_a_limb_found_anew_must_fit_about_as_well_as_when_it_was_adapted(
    limb, monkeypatch, adapted_mm, now_mm, root_shows, lost, gap_s
):
    judge = Tracker._judge

    def judged(self, *given, **options):
        frame, known_s = judge(self, *given, **options)
        shown = frame.shown.copy()
        shown[0] = root_shows
        return replace(frame, residual_m=now_mm / 1e3, shown=shown), known_s

    monkeypatch.setattr(Tracker, "_judge", judged)
    figures = [] if adapted_mm is None else [{"median_distance_mm": adapted_mm}]
    adapted = make_tracker(replace(limb.subject, report={"poses": figures}))
    if gap_s is None:
        frame, _ = adapted.first(limb.targets[0], 0.0)
    else:
        shown = np.ones(len(limb.subject.anatomy.bones), dtype=bool)
        before = TrackerState(0.0, limb.thetas[0], np.zeros(10), shown, np.zeros(10))
        frame, _ = adapted.follow(limb.targets[0], gap_s, before)
    assert ("too far for a pose found anew" in frame.lost) == lost


def turned(limb, theta):
    """A pose with the forearm turned by 110 degrees: nearly round, it fits nearly as well."""
    wrong = theta.copy()
    wrong[limb.subject.anatomy.coordinate_index("pro_sup")] += np.deg2rad(110.0)
    return wrong


def taken_up(limb, theta, **more):
    shown = np.ones(len(limb.subject.anatomy.bones), dtype=bool)
    return TrackerState(0.0, theta, np.zeros(10), shown, np.zeros(10), **more)


def test_a_limb_taken_up_after_a_gap_is_compared_with_what_a_search_finds(limb, tracker):
    i = limb.subject.anatomy.coordinate_index("pro_sup")
    target, truth = limb.targets[10], limb.thetas[10]
    uncompared, _ = tracker.follow(target, 0.25, taken_up(limb, turned(limb, truth)))
    frame, state = tracker.follow(target, 0.25, taken_up(limb, turned(limb, truth), taken_up_s=0.0))
    assert np.rad2deg(abs(uncompared.theta[i] - truth[i])) > 45.0  # else this test shows nothing
    assert frame.how == FOUND
    assert np.rad2deg(abs(frame.theta[i] - truth[i])) < 3.0
    assert state.taken_up_s == np.inf


@pytest.mark.parametrize(("gap_s", "again"), [(0.03, False), (0.6, True)])
def test_only_after_a_long_gap_a_limb_is_taken_up_with_doubt(limb, tracker, gap_s, again):
    before = taken_up(limb, limb.thetas[0], searched_s=gap_s - 0.1)
    frame, state = tracker.follow(limb.targets[0], gap_s, before)
    assert not frame.lost
    assert np.isfinite(state.taken_up_s) == again


def test_a_right_pose_taken_up_after_a_gap_stands(limb, tracker):
    frame, state = tracker.follow(limb.targets[0], 0.25, taken_up(limb, limb.thetas[0], taken_up_s=0.0))
    assert frame.how == FOLLOWED
    assert state.searched_s == 0.25  # not searched again in the next frame
