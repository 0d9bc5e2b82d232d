from __future__ import annotations

import base64
import re
import socket
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from adapt.model.body import pose_skin
from adapt.subject import save_subject
from capture.errors import BonetrackError
from capture.recording import Region
from tests.known_limb import KnownLimb
from tests.known_motion import HIDDEN, known_motion, reported_subject
from tests.test_region import LEFT, RIGHT, swinging
from track.motion import MotionError, save_motion
from track.poses_by_hand import HandPose, PosesError, from_shown, read_poses, write_poses
from track.settings import Settings
from track.view.angle_charts import _ticks
from track.view.commands import view_command
from track.view.embedded import thinned, write_embedded
from track.view.frames import FrameStore
from track.view.guard import _names_of_this_machine, may_talk
from track.view.layers import FAR, distance_to_see, error_colours, label
from track.view.scene import Scene, motion_scene, open_scene, recording_scene, subject_scene
from track.view.timeline import Timeline
from track.view.viewer import Viewer, ViewError, start_server

_PORT = 18720


@pytest.fixture(scope="module")
def scene(limb: KnownLimb) -> Scene:
    return motion_scene(known_motion(limb), limb.subject, limb.recording, title="motion")


@pytest.fixture(scope="module")
def folder(limb: KnownLimb, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A motion folder with its subject beside it."""
    path = tmp_path_factory.mktemp("view")
    (path / "motion").mkdir()
    save_motion(known_motion(limb), path / "motion")
    save_subject(reported_subject(limb), path / "subject.npz")
    return path


def test_a_scene_joins_motion_recording_and_truth(limb: KnownLimb, folder: Path) -> None:
    scene = open_scene(folder / "motion", subject=folder / "subject.npz", recording=limb.recording.path)
    assert scene.numbers == tuple(range(12))
    assert scene.moments is not None
    assert scene.truth is not None
    assert scene.shows("humerus", 0)
    assert not scene.shows("humerus", 4)  # a lost frame
    content = FrameStore(scene).get(2)
    assert content.posed is not None
    assert content.truth is not None
    assert content.seen is not None
    assert content.seen.distances is not None
    # The motion is the truth: its bones lie on the true bones, its skin on the points.
    for name, placed in content.posed.bones.items():
        np.testing.assert_allclose(placed[:3, :3], content.truth.bones[name][:3, :3], atol=1e-6)
    assert np.abs(content.posed.skin - content.truth.skin).max() < 1e-5
    assert np.median(content.seen.distances) < 0.003
    assert FrameStore(scene).get(4).posed is None


def test_a_motion_is_shown_with_the_points_of_the_region_it_was_tracked_in(limb: KnownLimb) -> None:
    points = limb.targets[0].cloud.points
    low, high = points.min(axis=0), points.max(axis=0)
    high[1] = np.median(points[:, 1])
    region = {"region": "given", "region_minimum_m": low.tolist(), "region_maximum_m": high.tolist()}
    motion = replace(known_motion(limb), settings=Settings({}, region, {}))
    seen = FrameStore(motion_scene(motion, limb.subject, limb.recording, title="motion")).get(0).seen
    assert seen is not None
    assert 0.4 < len(seen.points) / len(points) < 0.6
    assert (seen.points[:, 1] <= high[1] + 0.02).all()  # smoothed after they were cut out


def test_a_subject_stands_in_its_example_poses_or_at_rest(limb: KnownLimb) -> None:
    alone = subject_scene(limb.subject, None, title="subject")
    assert len(alone.times) == 1
    posed = FrameStore(alone).get(0).posed
    assert posed is not None
    np.testing.assert_allclose(posed.skin, limb.subject.body.v_tilde.value, atol=1e-6)
    recorded = subject_scene(limb.subject, limb.recording, title="subject")
    assert recorded.numbers == (0, 4, 8)


def test_a_recording_alone_shows_its_points(limb: KnownLimb) -> None:
    scene = recording_scene(limb.recording, None, title="recording")
    content = FrameStore(scene).get(0)
    assert content.posed is None
    assert content.seen is not None
    assert len(content.seen.points) > 1000
    assert content.seen.distances is None


def test_what_does_not_belong_together_is_refused(limb: KnownLimb, folder: Path) -> None:
    with pytest.raises(MotionError, match="give --subject"):
        open_scene(folder / "motion")
    with pytest.raises(MotionError, match="there is nothing here"):
        open_scene(folder / "absent")
    with pytest.raises(BonetrackError):
        open_scene(folder)  # neither a recording nor a motion
    late = replace(known_motion(limb), times=limb.times + 7.0)
    with pytest.raises(MotionError, match="has no frame at 7"):
        motion_scene(late, limb.subject, limb.recording, title="late")


def test_frames_are_made_ahead_and_no_more_are_kept_than_asked_for(scene: Scene) -> None:
    store, made = FrameStore(scene, capacity=3), []
    store.make_ahead(made.append)
    deadline = time.monotonic() + 20.0
    while len(made) < 3 and time.monotonic() < deadline:
        time.sleep(0.02)
    assert made == [0, 1, 2]
    store.look_at(6)
    while store.ready(8) is None and time.monotonic() < deadline:
        time.sleep(0.02)
    store.stop()
    assert store.ready(8) is not None
    assert store.ready(0) is None


def test_the_first_view_has_all_of_the_limb_in_it() -> None:
    points = np.random.default_rng(5).normal(size=(500, 3)) * [0.1, 0.4, 0.1]
    towards = np.array([0.6, 0.0, 0.8])
    away = distance_to_see(points, towards) * towards - points
    cosine = away @ towards / np.linalg.norm(away, axis=1)
    assert np.rad2deg(np.arccos(cosine)).max() == pytest.approx(22.0, abs=1.0)


def test_points_are_coloured_by_their_distance(scene: Scene) -> None:
    seen = FrameStore(scene).get(0).seen
    assert seen is not None
    distances = np.linspace(0.0, 0.03, len(seen.points), dtype=np.float32)
    colours = error_colours(replace(seen, distances=distances))
    assert colours.shape == seen.points.shape
    assert colours[0, 0] < 60  # dark violet
    assert colours[distances < 0.02][-1, 0] > 200  # orange
    assert (colours[-1] == FAR).all()
    assert len(np.unique(error_colours(replace(seen, distances=None)), axis=0)) == 1


def test_a_joint_is_labelled_with_its_angles_and_their_deviation(scene: Scene, limb: KnownLimb) -> None:
    angle = np.rad2deg(limb.thetas[0, limb.subject.anatomy.coordinate_index("elbow_flexion")])
    assert label(scene, "elbow", 0, limb.thetas[0]) == f"elbow_flexion {angle:.1f}° ± 1.5°"
    assert label(scene, "shoulder", 0, limb.thetas[0]) == ""  # where the limb is is no joint angle
    assert label(scene, "elbow", 4, np.full(10, np.nan)) == ""


def test_thinned_skin_keeps_its_place_and_stays_closed(limb: KnownLimb) -> None:
    skin, faces = limb.subject.body.v_tilde.value, limb.subject.anatomy.skin_faces
    kept, fewer = thinned(skin, faces, 2500)
    assert abs(len(kept) - 2500) < 50
    assert fewer.max() < len(kept)
    edges = np.sort(fewer[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    assert (count % 2 == 0).all()
    tetrahedra = np.linalg.det(skin[kept][fewer]).sum(), np.linalg.det(skin[faces]).sum()
    assert tetrahedra[0] == pytest.approx(tetrahedra[1], rel=0.02)  # six times the volume


def test_ticks_are_round_numbers_inside() -> None:
    assert _ticks(-21.0, 74.0, 4) == [0.0, 25.0, 50.0]
    assert _ticks(0.0, 4.3, 5) == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert _ticks(3.0, 3.0, 4) == [3.0]


def test_without_viser_one_line_says_what_to_install(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "viser", None)
    for more in ([], ["--html", str(folder / "scene.html")]):
        result = CliRunner().invoke(view_command, [str(folder / "subject.npz"), *more])
        assert isinstance(result.exception, ViewError)
        assert "pip install 'bonetrack[view]'" in str(result.exception)


@pytest.mark.parametrize("host", ["192.0.2.1", "nowhere.invalid"])
def test_a_host_that_is_not_this_machine_is_refused_at_once(folder: Path, host: str) -> None:
    result = CliRunner().invoke(view_command, [str(folder / "subject.npz"), "--host", host])
    assert isinstance(result.exception, ViewError)
    assert f"as '{host}'; give an address of this machine" in str(result.exception)


def test_a_port_that_there_cannot_be_is_a_wrong_command(folder: Path) -> None:
    assert CliRunner().invoke(view_command, [str(folder / "subject.npz"), "--port", "99999"]).exit_code == 2


def test_poses_of_another_limb_are_refused_in_one_line(
    folder: Path, tmp_path: Path, limb: KnownLimb, capfd: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("viser", reason="viser is not installed (extra: view)")
    write_poses(tmp_path / "poses.json", limb.subject.anatomy, [])
    text = (tmp_path / "poses.json").read_text(encoding="utf-8").replace("upper-limb", "lower-limb")
    (tmp_path / "poses.json").write_text(text, encoding="utf-8")
    command = [str(folder / "motion"), "--subject", str(folder / "subject.npz"), "--port", str(_PORT + 1)]
    command += ["--recording", str(limb.recording.path), "--poses", str(tmp_path / "poses.json")]
    result = CliRunner().invoke(view_command, command)
    assert isinstance(result.exception, PosesError)
    assert "name another file with --poses" in str(result.exception)
    assert "viser" not in capfd.readouterr().out


@pytest.fixture
def viewer(scene: Scene, tmp_path: Path):  # type: ignore[no-untyped-def]
    pytest.importorskip("viser", reason="viser is not installed (extra: view)")
    viewer = Viewer(start_server(port=_PORT), scene, poses=tmp_path / "poses.json")
    yield viewer
    viewer.stop()


def test_the_viewer_is_for_this_machine_alone(viewer: Viewer) -> None:
    assert viewer.server.get_host() == "127.0.0.1"


def test_a_frame_moves_bones_as_rigid_bodies_and_lost_ones_vanish(
    viewer: Viewer, scene: Scene, limb: KnownLimb
) -> None:
    viewer.show(3)
    ulna = viewer.server.scene.get_handle_by_name("/bones/ulna")
    skin = viewer.server.scene.get_handle_by_name("/skin/surface")
    assert scene.motion is not None
    np.testing.assert_allclose(ulna.position, scene.motion.transforms["ulna"][3, :3, 3], atol=1e-9)
    np.testing.assert_allclose(skin.vertices, pose_skin(limb.subject.body, limb.thetas[3]), atol=1e-5)
    assert ulna.visible
    viewer.show(4)
    assert not ulna.visible
    assert not skin.visible
    assert "**Lost**: only 31 %" in viewer._status.content


def test_a_bone_out_of_sight_is_marked_and_its_angles_are_not_told(viewer: Viewer) -> None:
    viewer.show(HIDDEN)
    hand, ulna = (viewer.server.scene.get_handle_by_name(f"/bones/{name}") for name in ("hand", "ulna"))
    assert hand.visible
    assert hand.color != ulna.color
    assert "**Not in sight** (red, where it may be): hand." in viewer._status.content
    told = {chart[1].name: chart[3].content for chart in viewer._charts._charts}
    assert "not known" in told["flexion"]
    assert "not known" not in told["elbow_flexion"]
    viewer.show(0)
    assert hand.color == ulna.color


def test_playing_keeps_the_recordings_speed(viewer: Viewer, scene: Scene) -> None:
    assert [viewer.timeline.frame_at(t) for t in (-1.0, 0.0, 0.05, 1.0 / 30.0 + 1e-9, 9.0)] == [0, 0, 1, 1, 11]
    seen: list[tuple[float, int]] = []
    timeline = Timeline(viewer.server, scene.times * 3.0, lambda k: seen.append((time.perf_counter(), k)))
    timeline._play()
    begun = timeline._begun[0]
    time.sleep(0.9)
    timeline.stop()
    assert len(seen) > 3
    # A frame is never shown before its time; on a busy machine it may be late or left out.
    assert all(clock - begun >= 3.0 * scene.times[k] - 1e-3 for clock, k in seen)
    assert [k for _, k in seen] == sorted(k for _, k in seen)


def test_a_pose_set_by_hand_is_shown_and_saved_for_its_frame(viewer: Viewer, limb: KnownLimb, tmp_path: Path) -> None:
    anatomy = limb.subject.anatomy
    viewer.timeline._set(4)  # a lost frame: setting begins from the nearest that is known
    hand = viewer._hand
    assert hand is not None
    hand._on.value = True
    i = anatomy.coordinate_index("elbow_flexion")
    hand._sliders[i].value = 42.0
    deadline = time.monotonic() + 10.0
    while (hand.theta is None or abs(hand.theta[i] - np.deg2rad(42.0)) > 1e-9) and time.monotonic() < deadline:
        time.sleep(0.02)
    viewer.show(4)
    skin = viewer.server.scene.get_handle_by_name("/skin/surface")
    expected = limb.thetas[3].copy()
    expected[i] = np.deg2rad(42.0)
    np.testing.assert_allclose(skin.vertices, pose_skin(limb.subject.body, expected), atol=1e-5)
    hand._keep()
    (saved,) = read_poses(tmp_path / "poses.json", anatomy, frames=12)
    assert saved.frame == 4
    np.testing.assert_allclose(saved.theta, expected, atol=1e-9)


def test_a_pose_set_by_hand_is_fitted_to_the_points_and_back(viewer: Viewer, limb: KnownLimb) -> None:
    anatomy, hand = limb.subject.anatomy, viewer._hand
    assert hand is not None
    viewer.timeline._set(4)  # lost: setting begins from frame 3
    hand._on.value = True
    set_by_hand = limb.thetas[3].copy()
    set_by_hand[anatomy.coordinate_index("pro_sup")] += np.deg2rad(10.0)
    hand._set(set_by_hand)
    hand._fit_from_here()
    assert hand._said.content.startswith("Fitted: skin and points are ")
    assert np.rad2deg(np.abs(hand.theta - limb.thetas[4])[6:]).max() < 3.0
    skin = viewer.server.scene.get_handle_by_name("/skin/surface")
    assert np.linalg.norm(skin.vertices - pose_skin(limb.subject.body, limb.thetas[4]), axis=1).mean() < 0.003
    assert not hand._undo.disabled
    hand._undo_fit()
    np.testing.assert_allclose(hand.theta, set_by_hand, atol=1e-9)
    assert hand._undo.disabled
    far = set_by_hand.copy()
    far[4] += 0.45
    hand._set(far)
    hand._fit_from_here()
    assert hand._said.content.startswith("**Not fitted**: from the pose set by hand ")
    np.testing.assert_allclose(hand.theta, far, atol=1e-9)


def test_a_pose_set_by_hand_stays_with_its_frame(viewer: Viewer, limb: KnownLimb, tmp_path: Path) -> None:
    hand = viewer._hand
    assert hand is not None
    viewer.timeline._set(4)
    hand._on.value = True
    hand._begin()
    hand._set(limb.thetas[3] + 0.01)
    hand._keep()
    viewer.timeline._set(8)
    assert hand.theta is None  # nothing was set for this frame
    hand._keep()
    assert "**Not saved**: the pose was set for frame 4, and this is frame 8" in hand._told.content
    assert [pose.frame for pose in read_poses(tmp_path / "poses.json", limb.subject.anatomy)] == [4]
    hand._dragged()  # whatever is set now begins from this frame
    np.testing.assert_allclose(hand.theta, limb.thetas[8], atol=0.2)
    viewer.timeline._set(4)
    np.testing.assert_allclose(hand.theta, limb.thetas[3] + 0.01, atol=1e-9)


def test_a_pose_that_is_not_saved_is_told_and_there_again_with_its_frame(
    viewer: Viewer, limb: KnownLimb, tmp_path: Path
) -> None:
    anatomy, hand = limb.subject.anatomy, viewer._hand
    assert hand is not None
    i = anatomy.coordinate_index("elbow_flexion")
    viewer.timeline._set(2)
    hand._on.value = True
    assert "Not saved" not in hand._told.content  # nothing was changed yet
    hand._sliders[i].value = 41.0
    assert "**Not saved yet**: frame 2." in hand._told.content
    viewer.timeline._set(8)
    shown = [from_shown(c, s.value) for c, s in zip(anatomy.coordinates, hand._sliders, strict=True)]
    np.testing.assert_allclose(shown, limb.thetas[8], atol=2e-3)  # not those of frame 2
    assert hand.theta is None
    hand._begin()
    hand._sliders[i].value = 77.0
    assert "**Not saved yet**: frame 2, 8." in hand._told.content
    viewer.timeline._set(2)
    assert hand._sliders[i].value == 41.0
    assert hand.theta[i] == pytest.approx(np.deg2rad(41.0))
    hand._on.value = False  # to compare with what was tracked
    hand._on.value = True
    hand._keep()
    assert "**Not saved yet**: frame 8." in hand._told.content
    (saved,) = read_poses(tmp_path / "poses.json", anatomy)
    assert (saved.frame, saved.theta[i]) == (2, pytest.approx(np.deg2rad(41.0)))
    viewer.timeline._set(8)
    hand._begin_anew()
    assert "Not saved" not in hand._told.content
    np.testing.assert_allclose(hand.theta, limb.thetas[8], atol=1e-9)


def test_two_viewers_keep_each_others_poses(viewer: Viewer, limb: KnownLimb, tmp_path: Path) -> None:
    anatomy, hand, path = limb.subject.anatomy, viewer._hand, tmp_path / "poses.json"
    assert hand is not None
    theirs = [HandPose("theirs", 3, limb.thetas[3] + 0.01), HandPose("also theirs", 7, limb.thetas[7])]
    write_poses(path, anatomy, theirs)  # after this viewer began
    viewer.timeline._set(3)
    hand._on.value = True
    hand._sliders[anatomy.coordinate_index("elbow_flexion")].value = 50.0
    for frame in (2, 3):
        viewer.timeline._set(frame)
        hand._begin()
        hand._keep()
    assert "**Not saved**: another viewer saved or changed a pose of frame 3 meanwhile" in hand._told.content
    assert [(p.frame, p.name) for p in read_poses(path, anatomy)] == [(2, "frame 2"), (3, "theirs"), (7, "also theirs")]
    hand._keep()  # asked for a second time
    _, third, last = read_poses(path, anatomy)
    assert third.theta[anatomy.coordinate_index("elbow_flexion")] == pytest.approx(np.deg2rad(50.0))
    assert last.name == "also theirs"


def test_the_machines_name_is_asked_for_once(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    monkeypatch.setattr(socket, "getfqdn", lambda: asked.append(1) or "here.example")
    _names_of_this_machine.cache_clear()
    assert all(may_talk(["here.example:8080"], [], host="127.0.0.1") for _ in range(5))
    assert not may_talk(["elsewhere.example:8080"], [], host="127.0.0.1")
    _names_of_this_machine.cache_clear()
    assert asked == [1]


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, None),
        ({"Origin": "http://127.0.0.1:{port}"}, None),
        ({"Origin": "https://elsewhere.example"}, 403),
        ({"Origin": "http://127.0.0.1:1"}, 403),
        ({"Origin": "null"}, 403),
        ({"Host": "elsewhere.example:{port}", "Origin": "http://elsewhere.example:{port}"}, 403),
    ],
)
def test_other_pages_of_the_same_browser_cannot_read_along(viewer: Viewer, headers: dict[str, str], status) -> None:  # type: ignore[no-untyped-def]
    import viser
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    port = viewer.server.get_port()
    given = {name: value.format(port=port) for name, value in headers.items()}
    address = f"ws://{given.pop('Host', f'127.0.0.1:{port}')}"
    with socket.create_connection(("127.0.0.1", port)) as opened:
        options = {
            "sock": opened,
            "additional_headers": given,
            "max_size": 64 << 20,
            "subprotocols": [f"viser-v{viser.__version__}"],
        }
        if status is None:
            with connect(address, **options) as talk:
                assert talk.recv(timeout=10)
            return
        with pytest.raises(InvalidStatus) as refused:
            connect(address, **options)
        assert refused.value.response.status_code == status


def test_the_scene_is_one_file_with_all_its_frames(scene: Scene, tmp_path: Path) -> None:
    pytest.importorskip("viser", reason="viser is not installed (extra: view)")
    assert write_embedded(scene, tmp_path / "scene.html", most_frames=6) == 6
    page = (tmp_path / "scene.html").read_text(encoding="utf-8")
    assert not re.findall(r"(?:src|href)\s*=\s*[\"']?https?:", page)
    assert "every 2th frame" not in page
    assert "every 2nd frame" in page
    data = re.search(r'__VISER_EMBED_DATA__="([^"]+)"', page)
    assert data is not None
    assert 2e5 < len(base64.b64decode(data.group(1))) < 3e6


def test_a_point_chooses_whose_points_are_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recording, regions = swinging(tmp_path / "rec", LEFT, RIGHT), []

    def noted(scene: Scene, html: Path, *, region: Region | None) -> int:
        html.touch()
        regions.append(region)
        return 0

    monkeypatch.setattr("track.view.embedded.write_embedded", noted)
    command = [str(recording.path), "--html", str(tmp_path / "scene.html"), "--near", "0.6", "0", "1.8"]
    assert CliRunner().invoke(view_command, command).exit_code == 0
    assert 0.0 < regions[0].minimum[0] < 0.6 < regions[0].maximum[0]


def test_a_point_needs_a_recording(folder: Path) -> None:
    result = CliRunner().invoke(view_command, [str(folder / "subject.npz"), "--near", "0", "0", "1"])
    assert result.exit_code == 2
    assert "needs a recording" in result.output
