"""A laboratory's markers beside a motion: its clock and frame are found again, or what does not fit is refused."""

from __future__ import annotations

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from adapt.anatomy_file import load_anatomy
from adapt.model.body import pose_skin, rest_theta
from adapt.subject import save_subject
from capture.rigid import apply, inverse, rotation_angle, transform
from tests.known_limb import known_subject
from tests.test_gltf import motion_of
from track.evaluation.random_bodies import random_body
from track.export.c3d import c3d_points
from track.export.opensim_tables import write_trc
from track.markers.align import align, at_times, pairs_of
from track.markers.commands import import_markers_command
from track.markers.read import MarkerError, MarkerTrial, read_markers, read_point_pairs
from track.motion import save_motion
from track.view.frames import FrameContent
from track.view.layers import Layers
from track.view.scene import motion_scene, with_markers
from track.view.viewer import start_server, stop_server

LATE_S = 2.34  # the laboratory's zero in the recording
TURN = Rotation.from_euler("XYZ", [80.0, -30.0, 140.0], degrees=True).as_matrix()
LAB_FROM_HERE = transform(TURN, np.array([1.2, -0.4, 0.9]))
NAMES = ("EL", "EM", "US", "RS", "olecranon")


def performance(times):
    """Poses of an arm that moves as people do: never twice alike, never fast."""
    body = random_body(load_anatomy("upper-limb-right"), 3)
    rng, thetas = np.random.default_rng(4), np.tile(rest_theta(body), (len(times), 1))
    for k in range(thetas.shape[1]):
        for frequency in (0.17, 0.31, 0.53):
            size = 0.06 if 3 <= k < 6 else 0.25
            thetas[:, k] += size * np.sin(2.0 * np.pi * (frequency * times * (1.0 + 0.05 * k) + rng.uniform()))
    low, high = (np.array([getattr(c, end) for c in body.anatomy.coordinates]) for end in ("low", "high"))
    return body, np.clip(thetas, low, high)


@pytest.fixture(scope="module")
def seen():
    """A motion of 14 s at 30 Hz, and all points of it at 100 Hz from LATE_S on, as a laboratory has them."""
    times = np.arange(420) / 30.0
    body, thetas = performance(times)
    subject = known_subject(body, np.zeros((0, thetas.shape[1])), np.zeros(0))
    _, finer = performance(LATE_S + np.arange(900) / 100.0)
    points = c3d_points(motion_of(subject, finer), subject)
    motion = motion_of(subject, thetas)
    motion.centres["elbow"][50:60] = np.nan
    rng = np.random.default_rng(1)
    lab = {name: apply(LAB_FROM_HERE, at) + 3e-4 * rng.normal(size=at.shape) for name, at in points.items()}
    for name in NAMES:
        lab[name][300:340] = np.nan  # hidden from the cameras for a while
    return subject, motion, MarkerTrial(np.arange(900) / 100.0, {name: lab[name] for name in NAMES})


def found(seen, **stated):
    subject, motion, trial = seen
    ours = c3d_points(motion, subject)
    return align(trial, motion, ours, pairs_of(trial, ours, {}), **stated)


def test_clock_and_frame_are_found_from_landmarks_that_are_named_alike(seen):
    alignment = found(seen)
    assert alignment.offset_s == pytest.approx(LATE_S, abs=0.002)
    assert alignment.deviation_s < 0.05
    np.testing.assert_allclose(alignment.motion_from_lab @ LAB_FROM_HERE, np.eye(4), atol=2e-3)
    far = np.array(list(alignment.apart.values()))
    assert np.nanmax(far) < 0.004
    unknown = (seen[1].times < LATE_S) | (seen[1].times > LATE_S + 8.99)
    assert np.isnan(far[:, unknown]).all()
    gap = (seen[1].times > LATE_S + 2.99) & (seen[1].times < LATE_S + 3.40)
    assert np.isnan(far[:, gap]).all()
    carried = alignment.carried(seen[2])
    assert carried.times[0] == alignment.offset_s


def test_markers_on_the_skin_near_landmarks_tell_nearly_as_well(seen):
    subject, motion, trial = seen
    body, finer = performance(LATE_S + trial.times)
    rest, landmarks = body.v_tilde.value, [body.p.value[body.anatomy.landmark_index(name)] for name in NAMES]
    stuck = np.array([np.linalg.norm(rest - landmark, axis=1).argmin() for landmark in landmarks])
    seen_there = np.array([pose_skin(body, theta, vertices=stuck) for theta in finer])
    skin = MarkerTrial(trial.times, {name: apply(LAB_FROM_HERE, seen_there[:, k]) for k, name in enumerate(NAMES)})
    ours = c3d_points(motion, subject)
    alignment = align(skin, motion, ours, pairs_of(skin, ours, {}))
    off = alignment.motion_from_lab @ LAB_FROM_HERE
    middle = np.nanmean(ours["EL"], axis=0)
    assert alignment.offset_s == pytest.approx(LATE_S, abs=0.002)
    assert rotation_angle(off[:3, :3]) < np.deg2rad(0.5)
    assert np.linalg.norm(apply(off, middle[None])[0] - middle) < 0.004
    apart = np.array(list(alignment.apart.values()))
    assert 0.002 < np.sqrt(np.nanmean(apart**2)) < 0.01


def test_a_stated_time_and_a_stated_frame_are_taken_as_they_are(seen):
    alignment = found(seen, offset_s=LATE_S, motion_from_lab=inverse(LAB_FROM_HERE))
    assert (alignment.offset_s, alignment.deviation_s) == (LATE_S, None)
    assert np.nanmax(np.array(list(alignment.apart.values()))) < 0.003


def test_a_wrong_time_or_markers_of_the_other_side_are_refused_in_one_line(seen):
    subject, motion, trial = seen
    ours = c3d_points(motion, subject)
    with pytest.raises(MarkerError, match=r"mm \(root mean square\) from the points that they go with.*--offset"):
        found(seen, offset_s=LATE_S + 1.5)
    with pytest.raises(MarkerError, match=r"no pair is known in both; the motion runs from 0\.00 to 13\.97 s"):
        found(seen, offset_s=60.0)
    mirrored = MarkerTrial(trial.times, {name: at * [1.0, 1.0, -1.0] for name, at in trial.points.items()})
    with pytest.raises(MarkerError, match="root mean square"):
        align(mirrored, motion, ours, pairs_of(mirrored, ours, {}))
    large = MarkerTrial(trial.times, {name: 10.0 * at for name, at in trial.points.items()})
    with pytest.raises(MarkerError, match="times as large as ours; check the file's unit"):
        align(large, motion, ours, pairs_of(large, ours, {}))


def test_a_trial_in_which_nobody_moves_tells_no_time(seen):
    subject, motion, trial = seen
    still = MarkerTrial(trial.times, {name: np.tile(at[:1], (900, 1)) for name, at in trial.points.items()})
    with pytest.raises(MarkerError, match=r"nothing moves in it; state the time with --offset"):
        align(still, motion, ours := c3d_points(motion, subject), pairs_of(still, ours, {}))


def test_too_few_or_unknown_pairs_are_named(seen):
    subject, motion, trial = seen
    ours = c3d_points(motion, subject)
    with pytest.raises(MarkerError, match="no point of the motion is called 'LSHO'; there are shoulder"):
        pairs_of(trial, ours, {"EL": "LSHO"})
    with pytest.raises(MarkerError, match=r"2 marker.* 3 are needed; say which go together: --pair MARKER POINT"):
        align(trial, motion, ours, {"EL": "EL", "EM": "EM"})


def test_paths_are_unknown_outside_and_beside_unknown_frames():
    at = np.array([[0.0], [1.0], [np.nan], [3.0]]) * np.ones((1, 3))
    times = np.array([-0.1, 0.5, 1.0, 1.5, 3.0, 3.1])
    np.testing.assert_array_equal(at_times(np.arange(4.0), at, times)[:, 0], [np.nan, 0.5, 1.0, np.nan, 3.0, np.nan])


TRC = """PathFileType\t4\t(X/Y/Z)\ttrial.trc
DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames
100\t100\t3\t2\t{unit}\t100\t1\t3
Frame#\tTime\tR.Elbow\t\t\tWrist\t\t
\t\tX1\tY1\tZ1\tX2\tY2\tZ2

1\t0.00\t100\t200\t300\t1\t2\t3
2\t0.01\t110\t200\t300
3\t0.02\tnan\tnan\tnan\t0\t0\t0
"""


@pytest.mark.parametrize(("unit", "metres"), [("mm", 1e-3), ("m", 1.0)])
def test_unknown_markers_are_read_however_programs_write_them(tmp_path, unit, metres):
    (tmp_path / "trial.trc").write_text(TRC.format(unit=unit))
    trial = read_markers(tmp_path / "trial.trc")
    assert trial.times.tolist() == [0.0, 0.01, 0.02]
    np.testing.assert_allclose(trial.points["R.Elbow"][:2] / metres, [[100, 200, 300], [110, 200, 300]])
    assert np.isnan(trial.points["R.Elbow"][2]).all()
    assert np.isfinite(trial.points["Wrist"]).all(axis=1).tolist() == [True, False, False]


def test_of_a_c3d_file_points_alone_are_markers_and_unknown_ones_are_so(tmp_path):
    ezc3d = pytest.importorskip("ezc3d", reason="C3D needs ezc3d: pip install bonetrack[c3d]")
    at = np.ones((4, 3, 4))
    at[:3] = np.arange(36.0).reshape(3, 3, 4) + 1.0
    at[:3, 0, 2], at[:3, 0, 3] = np.nan, 0.0
    file = ezc3d.c3d()
    file["data"]["points"] = at
    point = file["parameters"]["POINT"]
    point["RATE"]["value"], point["UNITS"]["value"] = [100.0], ["mm"]
    point["LABELS"]["value"] = ["RELB", "RWRA", "RElbowAngles"]
    file.add_parameter("POINT", "ANGLES", ["RElbowAngles"])
    file.write(str(tmp_path / "trial.c3d"))
    trial = read_markers(tmp_path / "trial.c3d")
    assert list(trial.points) == ["RELB", "RWRA"]
    np.testing.assert_allclose(trial.times, [0.0, 0.01, 0.02, 0.03])
    np.testing.assert_allclose(trial.points["RWRA"], 1e-3 * at[:3, 1].T, atol=1e-9)
    assert np.isfinite(trial.points["RELB"]).all(axis=1).tolist() == [True, True, False, False]


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("trial.trc", "my notes", "cannot be read as a .trc file"),
        ("trial.trc", TRC.format(unit="inch"), "is in inch; write it in mm or m"),
        ("trial.c3d", "my notes", "cannot be read as a .c3d file"),
        ("trial.txt", "", "is no marker file by its name"),
    ],
)
def test_a_file_that_is_no_marker_file_is_refused_with_its_name(tmp_path, name, text, said):
    pytest.importorskip("ezc3d", reason="C3D needs ezc3d: pip install bonetrack[c3d]")
    (tmp_path / name).write_text(text)
    with pytest.raises(MarkerError, match=said) as error:
        read_markers(tmp_path / name)
    assert str(tmp_path / name) in str(error.value)


def test_points_of_both_frames_are_a_table_with_or_without_a_title(tmp_path):
    (tmp_path / "points.csv").write_text("lab_x,lab_y,lab_z,x,y,z\n0,0,0,1,0,0\n1,0,0,1,1,0\n0,1,0,0,0,0\n")
    lab, here = read_point_pairs(tmp_path / "points.csv")
    assert lab.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert here[1].tolist() == [1, 1, 0]
    (tmp_path / "points.csv").write_text("0,0,0,1,0,0\n1,0,0,1,1,0\n")
    with pytest.raises(MarkerError, match="does not hold three points"):
        read_point_pairs(tmp_path / "points.csv")


def test_the_command_writes_markers_in_the_motions_frame_and_clock_a_table_and_a_picture(seen, tmp_path):
    import cv2

    subject, motion, trial = seen
    (tmp_path / "motion").mkdir()
    save_motion(motion, tmp_path / "motion")
    save_subject(subject, tmp_path / "subject.npz")
    renamed = {("R.EL" if name == "EL" else name): at for name, at in trial.points.items()}
    write_trc(tmp_path / "vicon.trc", trial.times, renamed)
    command = ["--beside", tmp_path / "motion", "--subject", tmp_path / "subject.npz", "--pair", "R.EL", "EL"]
    ran = CliRunner().invoke(
        import_markers_command, [str(part) for part in (tmp_path / "vicon.trc", *command, "--out", tmp_path / "out")]
    )
    assert ran.exit_code == 0, ran.exception
    assert "the trial's time 0 is 2.34" in ran.output
    assert "R.EL to EL" in ran.output
    read = read_markers(tmp_path / "out" / "markers.trc")
    ours = c3d_points(motion, subject)["EL"]
    theirs = at_times(read.times, read.points["R.EL"], motion.times)
    known = np.isfinite(theirs).all(axis=1)
    assert known.sum() > 200
    assert np.linalg.norm(theirs - ours, axis=1)[known].max() < 0.005
    rows = np.genfromtxt(tmp_path / "out" / "differences.csv", delimiter=",", names=True)
    assert np.nanmax(rows["REL_to_EL_mm"]) < 5.0
    assert cv2.imread(str(tmp_path / "out" / "markers.png")).shape[1] == 720


def test_markers_are_a_layer_of_the_viewer_and_vanish_where_none_is_known(seen, tmp_path):
    pytest.importorskip("viser", reason="the viewer needs viser: pip install bonetrack[view]")
    subject, motion, trial = seen
    carried = found(seen).carried(trial)
    write_trc(tmp_path / "markers.trc", carried.times, carried.points)
    scene = with_markers(motion_scene(motion, subject, None, title="motion"), tmp_path / "markers.trc")
    server = start_server(port=18790)
    try:
        layers = Layers(server, scene)
        assert "markers" in layers.names()
        for k in (0, 120, 170):  # before the trial, in it, while markers are hidden
            layers.show(k, FrameContent(None, None, None))
            cloud = server.scene.get_handle_by_name("/markers/cloud")
            at = np.array([points[k] for points in scene.markers.values()])
            assert cloud.visible == bool(np.isfinite(at).all(axis=1).any())
            if k == 120:
                np.testing.assert_allclose(cloud.points, at, atol=1e-6)
    finally:
        stop_server(server)


def test_markers_of_another_time_are_not_shown(seen, tmp_path):
    subject, motion, trial = seen
    write_trc(tmp_path / "markers.trc", trial.times + 100.0, trial.points)
    scene = motion_scene(motion, subject, None, title="motion")
    with pytest.raises(MarkerError, match=r"knows no marker at any time of what is shown; give the markers\.trc"):
        with_markers(scene, tmp_path / "markers.trc")
