"""Bones that are out of sight: they are told from those that show, nothing is claimed of them, the others go on."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pytest

import track.tracker
from adapt.anatomy import Anatomy
from adapt.anatomy_file import load_anatomy
from adapt.fit.posterior import inflate_unobserved
from adapt.match.correspondences import Target
from adapt.match.skin_sample import sample_skin
from adapt.model.body import bone_transforms, joint_centres, make_body, pose_skin, rest_theta
from adapt.search.pose_score import FoundPart, find_skin
from capture.cloud.fuse import Region, fuse
from capture.recording import instants, open_recording
from capture.recording.depth_png import read_readings, write_readings
from tests.known_limb import FPS, covered, cropped, exact_target, known_subject
from tests.toy_anatomy import toy_anatomy
from tests.toy_leg import toy_leg
from track.observed_bones import (
    bones_shown,
    centres_known,
    coordinates_known,
    coordinates_seen,
    known_thetas,
    skin_shown,
)
from track.options import TrackOptions
from track.prediction import guess_deviation
from track.track_recording import track_recording
from track.tracked_frame import TrackerState
from track.tracker import make_tracker

FOUND, HIDDEN = FoundPart(0.4, 0.002, 1.0), FoundPart(0.0, 0.05, 0.0)


def names_of(anatomy: Anatomy) -> list[str]:
    return [bone.name for bone in anatomy.bones]


def shown_but(anatomy: Anatomy, *hidden: str) -> np.ndarray:
    return np.array([name not in hidden for name in names_of(anatomy)])


def names(anatomy: Anatomy, coordinates: np.ndarray) -> set[str]:
    free = anatomy.joints[0].coordinates
    some = {c.name for c, known in zip(anatomy.coordinates, coordinates, strict=True) if known}
    return {name if name not in free else "root" for name in some}


# ---- what follows from which bones show


@pytest.mark.parametrize(
    ("part", "shown"),
    [
        (FOUND, True),
        (HIDDEN, False),
        (replace(FOUND, in_sight=0.05), False),
        (replace(FOUND, coverage=0.6), False),
        (replace(FOUND, skin_m=0.013), False),
    ],
    ids=["found", "hidden", "hardly in sight", "half of it elsewhere", "too far"],
)
def test_a_bone_shows_where_enough_of_its_skin_is_in_sight_and_found(part, shown):
    toy = toy_anatomy()
    skin = dict.fromkeys(names_of(toy), FOUND) | {"palm": part}
    assert bones_shown(toy, skin).tolist() == [True, True, True, shown]


@pytest.mark.parametrize(("hidden", "shown"), [(None, True), ("thigh", False), ("shank", False), ("foot", True)])
def test_a_bone_without_skin_shows_with_the_bones_that_place_it(hidden, shown):
    leg = toy_leg()
    skin = {name: HIDDEN if name == hidden else FOUND for name in ("thigh", "shank", "foot")}
    assert bones_shown(leg, skin)[names_of(leg).index("kneecap")] == shown


def test_a_coordinate_is_known_where_the_bones_at_both_ends_of_a_joint_show():
    toy, leg = toy_anatomy(), toy_leg()

    def known(anatomy, *hidden):
        return names(anatomy, coordinates_known(anatomy, shown_but(anatomy, *hidden)[None])[0])

    assert known(toy) == {"root", "bend", "spin", "dev", "flex"}
    assert known(toy, "palm") == {"root", "bend", "spin"}
    assert known(toy, "upper") == {"spin", "dev", "flex"}
    assert known(toy, "spin") == {"root", "bend"}
    assert known(leg, "kneecap") == known(leg)
    assert known(leg, "thigh") == {"point"}
    thetas = np.ones((1, len(toy.coordinates)))
    nan = np.isnan(known_thetas(toy, thetas, shown_but(toy, "palm")[None])[0])
    assert names(toy, nan) == {"dev", "flex"}


def test_a_coordinates_change_is_seen_where_it_moves_a_bone_that_shows():
    toy = toy_anatomy()
    assert names(toy, coordinates_seen(toy, shown_but(toy, "palm"))) == {"root", "bend", "spin"}
    assert names(toy, coordinates_seen(toy, shown_but(toy, "upper", "fore"))) == {"root", "bend", "spin", "dev", "flex"}


def test_a_centre_is_known_where_a_bone_that_carries_it_shows():
    leg = toy_leg()
    known = {
        name: bool(there[0]) for name, there in centres_known(leg, shown_but(leg, "thigh", "kneecap")[None]).items()
    }
    assert known == {"hip": False, "knee": False, "cap": False, "ankle": True}
    known = {name: bool(there[0]) for name, there in centres_known(leg, shown_but(leg, "shank")[None]).items()}
    assert known == {"hip": True, "knee": True, "cap": True, "ankle": True}


@pytest.mark.parametrize("name", ["upper-limb-right", "lower-limb-right"])
def test_a_centre_that_a_child_carries_is_where_the_parent_has_it(name):
    """So that it is known where only the child shows, though the coordinates between are not."""
    anatomy = load_anatomy(name)
    body, rng = make_body(anatomy), np.random.default_rng(0)
    rest = rest_theta(body)
    theta = rest + np.r_[np.zeros(6), rng.uniform(0.1, 0.4, len(rest) - 6)]
    alone = {
        bone: shown_but(anatomy, *(other for other in names_of(anatomy) if other != bone)) for bone in names_of(anatomy)
    }
    for joint in anatomy.joints:
        if not centres_known(anatomy, alone[joint.child][None])[joint.name][0]:
            continue
        at_rest, posed = (joint_centres(body, pose)[joint.name] for pose in (rest, theta))
        carrier = bone_transforms(body, theta)[joint.child]
        np.testing.assert_allclose(carrier[:3, :3] @ at_rest + carrier[:3, 3], posed, atol=1e-9, err_msg=joint.name)


@pytest.mark.parametrize("anatomy", [toy_anatomy(), toy_leg(), load_anatomy("lower-limb-right")], ids=lambda a: a.name)
def test_all_skin_rides_on_bones(anatomy):
    rides = make_body(anatomy).skin_riding
    np.testing.assert_allclose(rides.sum(axis=1), 1.0, atol=1e-6)
    assert (rides >= 0.0).all()
    cap = [k for k, name in enumerate(names_of(anatomy)) if name in ("kneecap", "patella")]
    assert not rides[:, cap].any()


def test_skin_shows_with_the_bone_that_most_of_it_rides_on(arm):
    body = make_body(arm)
    shown = skin_shown(body, shown_but(arm, "hand"))
    rides = body.skin_riding[:, names_of(arm).index("hand")]
    assert not shown[rides > 0.9].any()
    assert shown[rides < 0.1].all()


def test_what_is_not_known_grows_unsure_up_to_its_whole_range(arm):
    n, i = len(arm.coordinates), arm.coordinate_index("flexion")
    told = np.full((n, n), 1e-5) + np.eye(n) * 1e-4
    deviations = []
    for unknown_s in (0.0, 1 / 30, 0.05, 0.1, 10.0, np.inf):
        covariance = inflate_unobserved(told, guess_deviation(arm, np.where(np.arange(n) == i, unknown_s, 0.0)))
        assert (np.linalg.eigvalsh(covariance) > 0.0).all()
        np.testing.assert_array_equal(np.delete(np.diag(covariance), i), np.delete(np.diag(told), i))
        deviations.append(float(np.sqrt(covariance[i, i])))
    assert deviations[0] == pytest.approx(np.sqrt(told[i, i]))
    assert deviations[0] < deviations[1] < deviations[2] <= deviations[3] <= deviations[4] == deviations[5]
    assert deviations[5] == pytest.approx((arm.coordinates[i].high - arm.coordinates[i].low) / np.sqrt(12.0))


# ---- in sight


def of_hand(limb, theta, *, bone="hand"):
    """The skin (N, 3) that rides on a bone, posed."""
    body = limb.subject.body
    return pose_skin(body, theta)[body.skin_riding[:, names_of(body.anatomy).index(bone)] > 0.3]


@pytest.mark.parametrize("change", [cropped, covered], ids=["out of the image", "behind an object"])
def test_skin_out_of_sight_speaks_neither_for_a_pose_nor_against_it(limb, change):
    body, theta = limb.subject.body, limb.thetas[3]
    hand = of_hand(limb, theta)
    target = exact_target(body, theta, change=lambda view: change(view, hand))
    found = find_skin(body, target, theta, sample_skin(limb.subject.anatomy, at_most=1500))
    assert found.bones["hand"].in_sight < 0.02
    assert found.bones["ulna"].in_sight > 0.3
    assert found.whole.coverage > 0.95


def test_skin_whose_points_were_cut_out_of_the_cloud_is_not_in_sight(limb):
    body, theta = limb.subject.body, limb.thetas[3]
    hand = of_hand(limb, theta)
    target = exact_target(body, theta)
    near = np.linalg.norm(target.cloud.points - hand.mean(axis=0), axis=1) < 0.18
    cloud = target.cloud
    kept = {name: getattr(cloud, name)[~near] for name in ("points", "normals", "boundary", "sensor")}
    found = find_skin(body, Target(replace(cloud, **kept)), theta, sample_skin(limb.subject.anatomy, at_most=1500))
    assert found.bones["hand"].in_sight < 0.1
    assert found.whole.coverage > 0.95


# ---- through time


def followed(tracker, targets, times):
    frame, state = tracker.first(targets[0], times[0])
    frames = [frame]
    for target, time in zip(targets[1:], times[1:], strict=True):
        frame, state = tracker.follow(target, time, state)
        frames.append(frame)
    return frames


@pytest.mark.parametrize("change", [cropped, covered], ids=["leaves the image", "goes behind an object"])
def test_an_arm_is_followed_while_its_hand_is_away(limb, change):
    body, anatomy = limb.subject.body, limb.subject.anatomy
    away = range(2, 5)

    def target(k):
        hand = of_hand(limb, limb.thetas[k])
        return exact_target(
            body, limb.thetas[k], change=(lambda view: change(view, hand)) if k in away else lambda v: v
        )

    frames = followed(make_tracker(limb.subject), [target(k) for k in range(7)], limb.times[:7])
    wrist = [anatomy.coordinate_index(name) for name in ("deviation", "flexion")]
    for k, frame in enumerate(frames):
        assert not frame.lost, (k, frame.lost)
        assert np.isfinite(frame.theta).all()
        hidden = {name for name, shows in zip(names_of(anatomy), frame.shown, strict=True) if not shows}
        assert hidden == ({"hand"} if k in away else set()), k
        known = np.delete(np.abs(frame.theta - limb.thetas[k])[6:], [] if k not in away else [2, 3])
        assert np.rad2deg(known).max() < 5.0, (k, np.rad2deg(known))
        centres, true = joint_centres(body, frame.theta), joint_centres(body, limb.thetas[k])
        assert max(np.linalg.norm(centres[name] - true[name]) for name in true) < 0.004, k
    deviations = np.rad2deg([np.sqrt(np.diag(frame.covariance))[wrist] for frame in frames])
    assert (deviations[list(away)] > 9.0).all(), deviations
    assert (np.delete(deviations, list(away), axis=0) < 3.0).all(), deviations


def test_a_leg_is_followed_while_its_thigh_is_out_of_the_image():
    anatomy = load_anatomy("lower-limb-right")
    body = make_body(anatomy)
    thetas = np.tile(rest_theta(body), (5, 1))
    swing = np.linspace(0.0, 0.6, 5)
    for name, degrees in (("hip_flexion_r", 8.0), ("knee_angle_r", 20.0), ("ankle_angle_r", 8.0)):
        thetas[:, anatomy.coordinate_index(name)] += np.deg2rad(degrees) * swing
    of_thigh = body.skin_riding[:, [names_of(anatomy).index(name) for name in ("pelvis", "femur")]].sum(axis=1) > 0.3

    def target(k):
        thigh = pose_skin(body, thetas[k])[of_thigh]
        return exact_target(body, thetas[k], change=(lambda view: cropped(view, thigh)) if k >= 2 else lambda v: v)

    subject = known_subject(body, thetas[:1], np.zeros(1))
    frames = followed(make_tracker(subject), [target(k) for k in range(5)], np.arange(5) / FPS)
    ankle = anatomy.coordinate_index("ankle_angle_r")
    for k, frame in enumerate(frames):
        assert not frame.lost, (k, frame.lost)
        hidden = {name for name, shows in zip(names_of(anatomy), frame.shown, strict=True) if not shows}
        assert hidden == ({"pelvis", "femur", "patella"} if k >= 2 else set()), k
        assert abs(frame.theta[ankle] - thetas[k, ankle]) < np.deg2rad(2.0), k
        apart = joint_centres(body, frame.theta)["ankle"] - joint_centres(body, thetas[k])["ankle"]
        assert np.linalg.norm(apart) < 0.004, k


# ---- searching for what is out of sight


@pytest.fixture
def searches(monkeypatch):
    """The searches that a tracker makes; none finds anything."""
    made = []

    def search(*given, **more):
        made.append(given)
        raise track.tracker.FitError("nothing there")

    monkeypatch.setattr(track.tracker, "locate", search)
    return made


def state_with_hand_gone(limb, *, since_s, **more):
    anatomy = limb.subject.anatomy
    shown = shown_but(anatomy, "hand")
    known_s = np.where(coordinates_known(anatomy, shown[None])[0], 1.0, 1.0 - since_s)
    return TrackerState(1.0, limb.thetas[3], np.zeros(len(limb.thetas[3])), shown, known_s, **more)


def handless(limb):
    hand = of_hand(limb, limb.thetas[3])
    return exact_target(limb.subject.body, limb.thetas[3], change=lambda view: cropped(view, hand))


@pytest.mark.parametrize(
    ("since_s", "searched_s", "wait_s", "expected"),
    [(0.3, -np.inf, 0.5, 0), (0.7, -np.inf, 0.5, 1), (5.0, 0.4, 0.5, 1), (5.0, 0.4, 2.0, 0)],
    ids=["just gone", "gone for long", "searched before", "searched in vain"],
)
def test_bones_out_of_sight_for_long_are_searched_for_now_and_then(
    limb, searches, since_s, searched_s, wait_s, expected
):
    state = state_with_hand_gone(limb, since_s=since_s, searched_s=searched_s, wait_s=wait_s)
    frame, after = make_tracker(limb.subject).follow(handless(limb), 1.0 + 1 / FPS, state)
    assert len(searches) == expected
    assert not frame.lost
    assert frame.shown.tolist() == shown_but(limb.subject.anatomy, "hand").tolist()
    assert after.time_s == 1.0 + 1 / FPS
    assert (after.searched_s, after.wait_s) == ((after.time_s, 2.0 * wait_s) if expected else (searched_s, wait_s))


def test_what_a_search_finds_stands_only_if_more_bones_show(limb):
    tracker, turned = make_tracker(limb.subject), limb.thetas[3].copy()
    turned[limb.subject.anatomy.coordinate_index("flexion")] += np.deg2rad(75.0)
    state = replace(state_with_hand_gone(limb, since_s=2.0), theta=turned)
    whole = exact_target(limb.subject.body, limb.thetas[3])
    frame, after = tracker.follow(whole, 1.0 + 1 / FPS, state)
    assert frame.shown.all()
    assert np.abs(frame.theta - limb.thetas[3])[6:].max() < np.deg2rad(3.0)
    assert after.known_s.min() == after.time_s


@pytest.mark.parametrize("missing", [("hand", "radius", "ulna"), ("hand",)], ids=["one bone", "three bones"])
def test_a_limb_found_anew_must_show_more_than_one_bone(limb, monkeypatch, missing):
    judge = track.tracker.judge_fit

    def without(*given):
        judged = judge(*given)
        bones = judged.found.bones | dict.fromkeys(missing, HIDDEN)
        return replace(judged, found=replace(judged.found, bones=bones))

    monkeypatch.setattr(track.tracker, "judge_fit", without)
    frame, state = make_tracker(limb.subject).first(limb.targets[3], 0.0)
    assert (state is None) == bool(frame.lost) == (len(missing) == 3)
    assert frame.shown.any() == (len(missing) == 1)
    if state is not None:
        assert np.isneginf(state.known_s).sum() == 2  # the wrist was never seen


# ---- a recording in which the hand goes behind an object


class Stopped(Exception):
    pass


@pytest.fixture(scope="module")
def behind_an_object(limb, tmp_path_factory):
    """The limb's recording with a board before the hand from the fourth frame on, and the limb's region."""
    folder = tmp_path_factory.mktemp("board") / "recording"
    shutil.copytree(limb.recording.path, folder)
    recording = open_recording(folder)
    for k, moment in enumerate(instants(recording)):
        if k < 3:
            continue
        hand = of_hand(limb, limb.thetas[k])
        for view in fuse(recording, moment).views:
            sensor = recording.sensor(view.sensor)
            board = covered(view, hand)
            readings = np.rint(board.depth / sensor.depth_unit_m).astype(np.uint16)
            path, camera = moment.frames[view.sensor].path, sensor.camera
            before = read_readings(path, width=camera.width, height=camera.height)
            write_readings(path, np.where(board.depth == view.depth, before, readings))
    points = np.concatenate([target.cloud.points for target in limb.targets])
    return open_recording(folder), Region(points.min(axis=0) - 0.05, points.max(axis=0) + 0.05)


@pytest.fixture(scope="module")
def half_hidden(behind_an_object, limb, tmp_path_factory):
    """The motion tracked there, and its folder."""
    recording, region = behind_an_object
    folder = tmp_path_factory.mktemp("half hidden") / "motion"
    return track_recording(recording, limb.subject, folder, TrackOptions(region=region)), folder


def test_a_motion_says_which_bones_showed(half_hidden):
    motion, _ = half_hidden
    assert motion.lost == ("",) * len(motion.times)
    assert [motion.hidden(t) for t in range(len(motion.times))] == [[]] * 3 + [["hand"]] * (len(motion.times) - 3)


def test_a_run_stopped_while_a_bone_was_hidden_goes_on_to_the_same_motion(
    behind_an_object, half_hidden, limb, tmp_path
):
    recording, region = behind_an_object

    def stop(done, total):
        if done == 6:
            raise Stopped

    with pytest.raises(Stopped):
        track_recording(recording, limb.subject, tmp_path / "motion", TrackOptions(region=region), progress=stop)
    motion = track_recording(recording, limb.subject, tmp_path / "motion", TrackOptions(region=region))
    for name in ("thetas", "deviations", "shown", "residuals", "coverage", "matches"):
        np.testing.assert_array_equal(getattr(motion, name), getattr(half_hidden[0], name))
    for name in ("angles.mot", "centres.trc", "quality.csv"):
        assert (tmp_path / "motion" / name).read_text() == (half_hidden[1] / name).read_text()


def test_nothing_is_handed_on_of_a_hidden_bone(half_hidden):
    motion, folder = half_hidden
    assert np.isfinite(motion.thetas).all()
    assert np.isnan(motion.transforms["hand"][3:]).all()
    assert np.isfinite(motion.transforms["hand"][:3]).all()
    assert all(np.isfinite(motion.transforms[name]).all() for name in ("humerus", "ulna", "radius"))
    assert all(np.isfinite(centres).all() for centres in motion.centres.values())  # the radius carries the wrist's
    lines = (folder / "angles.mot").read_text().splitlines()
    header, *rows = (line.split("\t") for line in lines[lines.index("endheader") + 1 :])
    for name in header[1:]:
        column = np.array([float(row[header.index(name)]) for row in rows])
        unknown = 3 if name in ("deviation", "flexion") else len(rows)
        assert np.isfinite(column[:unknown]).all(), name
        assert np.isnan(column[unknown:]).all(), name
    quality = (folder / "quality.csv").read_text().splitlines()
    columns = quality[0].split(",")
    for t, row in enumerate(quality[1:]):
        cells = dict(zip(columns, row.split(","), strict=True))
        assert cells["hidden"] == ("" if t < 3 else "hand")
        assert (cells["sd_flexion_deg"] == "nan") == (t >= 3)
        assert cells["sd_elbow_flexion_deg"] != "nan"
