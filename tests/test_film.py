"""Films and pictures of a motion: a picture a frame, shown when it was seen, with what its colours mean."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from adapt.subject import save_subject
from capture.camera import Camera
from capture.errors import OutputError
from capture.recording import Colour, FrameFile
from tests.known_limb import KnownLimb
from tests.known_motion import HIDDEN, LOST, known_motion
from track.motion import MotionError, save_motion
from track.view.film import FilmError, write_film
from track.view.film_commands import movie_command
from track.view.film_frames import OverlayFilm, SceneFilm
from track.view.render import BONE, Layer, render
from track.view.scene import Scene, motion_scene
from track.view.stills import Key, captioned, key_of

WIDTH = 320


@pytest.fixture(scope="module")
def scene(limb: KnownLimb) -> Scene:
    return motion_scene(known_motion(limb), limb.subject, limb.recording, title="motion")


def ink(image: np.ndarray) -> int:
    """How many pixels look like bone: bright and a little yellow."""
    r, g, b = (image[..., k].astype(int) for k in range(3))
    return int(((r > 120) & (r - b > 8) & (r - b < 60) & (abs(r - g) < 20)).sum())


def test_a_film_has_a_picture_for_each_frame_at_the_time_it_was_seen(tmp_path: Path) -> None:
    av = pytest.importorskip("av", reason="films need PyAV: pip install bonetrack[movie]")
    times = np.array([2.0, 2.033, 2.067, 2.3, 2.333])  # some never came
    images = [np.full((61, 81, 3), 40 * k, dtype=np.uint8) for k in range(5)]
    assert write_film(iter(images), times, tmp_path / "film.mp4") == 5
    with av.open(str(tmp_path / "film.mp4")) as film:
        frames = list(film.decode(video=0))
    assert [(frame.width, frame.height) for frame in frames] == [(80, 60)] * 5
    np.testing.assert_allclose([frame.time for frame in frames], times - 2.0, atol=2e-3)
    shades = [frame.to_ndarray(format="rgb24").mean() for frame in frames]
    np.testing.assert_allclose(shades, [0, 40, 80, 120, 160], atol=4)


def test_a_film_of_other_programs_is_not_replaced_and_one_of_ours_is(tmp_path: Path) -> None:
    pytest.importorskip("av", reason="films need PyAV: pip install bonetrack[movie]")
    image = np.zeros((64, 64, 3), dtype=np.uint8)
    for _ in range(2):
        write_film([image], np.zeros(1), tmp_path / "film.mp4")
    ours = (tmp_path / "film.mp4").read_bytes()
    (tmp_path / "film.mp4").write_bytes(ours.replace(b"written by bonetrack", b"x" * 20))
    with pytest.raises(OutputError, match="not replaced"):
        write_film([image], np.zeros(1), tmp_path / "film.mp4")


def test_in_space_a_lost_frame_is_called_so_and_shows_no_body(scene: Scene) -> None:
    film = SceneFilm(scene, width=WIDTH, height=WIDTH)
    seen, lost, hidden = (film.picture(k) for k in (2, LOST[0], HIDDEN))
    assert seen.shape == lost.shape == hidden.shape
    head = slice(0, 38)
    assert (seen[head] != lost[head]).any()  # the time, and that it was lost
    assert ink(seen[38:-64]) > 4 * ink(lost[38:-64])
    assert ink(hidden[38:-64]) < ink(seen[38:-64])  # the hand is left out


def test_an_overlay_lies_on_what_the_sensor_saw(scene: Scene, limb: KnownLimb) -> None:
    film = OverlayFilm(scene, width=640)
    drawn = film.picture(2)
    bare = OverlayFilm(replace(scene, thetas=np.full_like(scene.thetas, np.nan)), width=640).picture(2)
    body = (drawn[38:518].astype(int) != bare[38:518]).any(axis=2)
    nearby = limb.recording.sensors[0].depth_range_m
    grey = bare[38:518, :, 0]
    assert nearby[0] < nearby[1]
    on_limb = grey[body] > 100  # nearer than what is behind
    assert body.sum() > 2000
    assert on_limb.mean() > 0.85


def test_an_overlay_takes_the_colour_image_where_there_is_one_and_straightens_its_lens(
    scene: Scene, tmp_path: Path
) -> None:
    camera = Camera(320, 240, 300.0, 300.0, 159.5, 119.5, (0.1, 0.0, 0.0, 0.0))
    cv2.imwrite(str(tmp_path / "red.png"), np.full((240, 320, 3), (0, 0, 200), dtype=np.uint8))
    first = scene.recording.sensors[0]
    colour = Colour(camera, np.eye(4), (FrameFile(tmp_path / "red.png", scene.times[2]),))
    sensors = (replace(first, colour=colour), *scene.recording.sensors[1:])
    film = OverlayFilm(replace(scene, recording=replace(scene.recording, sensors=sensors)), width=640)
    assert film.picture(2)[38 + 240, 600].tolist() == [200, 0, 0]
    assert (film.picture(9)[38 + 240, 600] == 255).all()  # none was taken near that time


def test_a_sensor_that_there_is_not_and_an_overlay_on_nothing_are_refused(scene: Scene) -> None:
    with pytest.raises(MotionError, match=r"has no sensor 'left'; there are sensor1, sensor2"):
        OverlayFilm(scene, "left")
    with pytest.raises(MotionError, match=r"name the motion's recording: --recording"):
        OverlayFilm(replace(scene, recording=None, moments=None))


def test_points_have_colours_of_their_own_and_something_may_lie_behind() -> None:
    camera, eye = Camera(8, 8, 8.0, 8.0, 3.5, 3.5), np.eye(4)
    points = np.array([[-0.25, 0.0, 1.0], [0.25, 0.0, 1.0]])
    behind = np.full((8, 8, 3), 10, dtype=np.uint8)
    colours = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    image = render([], eye, camera, points=points, point_colour=colours, background=behind)
    assert image[4, 2].tolist() == [255, 0, 0]
    assert image[4, 6].tolist() == [0, 0, 255]
    assert image[0, 0].tolist() == [10, 10, 10]
    wall = Layer(np.array([[-9.0, -9, 2], [9, -9, 2], [0, 9, 2]]), np.array([[0, 1, 2]]), BONE, 0.5)
    assert (render([wall], eye, camera, background=behind)[4, 4] > 10).all()


def test_a_mesh_is_drawn_alike_in_the_middle_at_the_edge_and_around_the_eye_and_not_at_all_outside() -> None:
    camera, eye = Camera(40, 30, 40.0, 40.0, 19.5, 14.5), np.eye(4)
    corners = np.array([[-0.1, -0.1, 0.0], [0.1, -0.1, 0.0], [0.0, 0.1, 0.0]])
    faces = np.array([[0, 1, 2]])

    def pixels(at: tuple[float, float, float], size: float = 1.0) -> int:
        image = render([Layer(size * corners + at, faces, BONE)], eye, camera)
        return int((image < 255).any(axis=2).sum())

    whole = pixels((0.0, 0.0, 1.0))
    assert whole == pytest.approx(0.5 * 8.0 * 8.0, abs=8)
    assert 0 < pixels((0.5, 0.0, 1.0)) < whole
    assert pixels((3.0, 0.0, 1.0)) == pixels((0.0, 0.0, -1.0)) == 0
    assert pixels((0.0, 0.0, 0.5), size=100.0) == 40 * 30


def test_a_caption_never_runs_into_the_time_and_keys_go_on_in_another_line() -> None:
    plain = np.full((50, 240, 3), 255, dtype=np.uint8)
    keys = [key_of(BONE, "bones"), Key((1, 2, 3), "points on the skin"), Key((4, 5, 6), "something else")]
    picture = captioned(plain, "a title that is much longer than the picture is wide", "12.34 s", keys)
    assert picture.shape[0] > 50 + 38 + 26 * 2
    assert (picture == (1, 2, 3)).all(axis=2).any()
    short = captioned(plain, "", "12.34 s", [])
    np.testing.assert_array_equal(picture[:38, 170:], short[:38, 170:])


def test_the_command_writes_a_film_or_a_picture_and_refuses_what_cannot_be(
    limb: KnownLimb, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("av", reason="films need PyAV: pip install bonetrack[movie]")
    (tmp_path / "motion").mkdir()
    save_motion(known_motion(limb), tmp_path / "motion")
    save_subject(limb.subject, tmp_path / "subject.npz")

    def movie(*options: object):  # type: ignore[no-untyped-def]
        common = (tmp_path / "motion", "--subject", tmp_path / "subject.npz", "--width", 160)
        return CliRunner().invoke(movie_command, [str(part) for part in (*common, *options)])

    assert movie("--out", tmp_path / "film.mp4").exit_code == 0
    assert (tmp_path / "film.mp4").stat().st_size > 1000
    assert movie("--frame", 2, "--out", tmp_path / "frame.png").exit_code == 0
    assert cv2.imread(str(tmp_path / "frame.png")).shape[1] == 160
    assert "a film ends in .mp4" in movie("--out", tmp_path / "film.avi").output
    assert "frames run from 0 to 11" in str(movie("--frame", 99, "--out", tmp_path / "x.png").exception)
    monkeypatch.setitem(__import__("sys").modules, "av", None)
    without = movie("--out", tmp_path / "other.mp4").exception
    assert isinstance(without, FilmError)
    assert "pip install 'bonetrack[movie]'" in str(without)
