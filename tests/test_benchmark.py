"""The benchmark measures what it says, and its page shows it."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

from adapt.anatomy import Floats
from adapt.model.body import make_body, pose_skin, rest_theta
from adapt.subject import Subject
from capture.camera import Camera, ray_slopes
from capture.cloud.fuse import Cloud, View
from capture.projection import pixels_in
from tests.known_limb import KnownLimb
from tests.toy_anatomy import toy_anatomy
from track.evaluation.benchmark.adapting import evaluation_timings
from track.evaluation.benchmark.growth import Curve, slope, with_finer_skin
from track.evaluation.benchmark.lenses import LensTiming, seen_through
from track.evaluation.benchmark.others import Comparison, skin_errors
from track.evaluation.benchmark.page import Results, page
from track.evaluation.benchmark.processes import CommandFailed, Process, measured
from track.evaluation.benchmark.timing import Timing, timed, timing_row


def spent(stage: str, seconds: float) -> Timing:
    return Timing(stage, np.full(3, seconds), np.full(3, seconds))


def results() -> Results:
    stages = {"read: 2 depth images": 0.004, "read and clean: 2 depth images": 0.006, "fuse, reading included": 0.012}
    stages |= {"follow: catch up, settle": 0.009, "judge: find_skin": 0.001, "whole frame, one thread": 0.024}
    frame = [spent(stage, seconds) for stage, seconds in stages.items()]
    frame.append(replace(spent("normals", 0.0001), twin=np.full(3, 0.0005)))
    loop = replace(spent("the loop", 0.020), first_s=0.067, target_s=0.033)
    compared = [Comparison("an ICP", 30.0, 3.0, {"vertex": (12.0, 4.0)})]
    curves = [Curve("sensors", (1, 2, 4), (0.01, 0.02, 0.04))]
    lenses = [LensTiming("seeing", np.array([[0.010, 0.011, 0.013], [0.020, 0.022, 0.024], [0.030, 0.030, 0.036]]))]
    return Results(
        "a-recording",
        3,
        frame,
        lenses,
        loop,
        [spent("adapt", 9.0)],
        compared,
        curves,
        [Process("demo", 35.0, 512)],
        0.1,
    )


def test_a_stage_is_run_as_often_as_said_and_others_are_set_beside_it() -> None:
    ran: list[int] = []
    timing = timed("stage", lambda: ran.append(1), repeat=4, first_s=1.0)
    assert len(ran) == len(timing.seconds) == len(timing.processor) == 4
    row = timing_row(replace(timing, seconds=np.full(4, 0.5), processor=np.full(4, 0.25), twin=np.full(4, 1.0)))
    assert row == ("stage", "500.0 ms", "500.0 ms to 500.0 ms", "250.0 ms", "1.0 s (4.0 x)", "1.0 s (2.0 x)", "")


def test_the_page_shows_every_part_and_where_the_time_goes() -> None:
    text = page(results())
    for part in (
        "python -m track.evaluation.benchmark --whole --repeat 3",
        "| the loop | 20.0 ms |",
        "67.0 ms (3.4 x)",
        "0.5 ms (5.0 x)",
        "cleaning them: 8 %",
        "judging (which bones show, how sure the pose is): 4 %",
        "| an ICP | 30.0 s (10.0 x) | 3.0 s | vertex 12.0, ours 4.0 mm |",
        "| seeing | 20.000 ms | 22.000 ms (1.10 x) | 24.000 ms (1.20 x) |",
        "1: 10.0 ms, 2: 20.0 ms, 4: 40.0 ms | 1.00 |",
        "| `bonetrack demo` | 35.0 s |",
        "512 MiB",
    ):
        assert part in text
    few = page(replace(results(), lenses=[], adaptation=[], others=[], curves=[], processes=[]))
    assert few.count("##") == 1


def test_the_exponent_tells_linear_growth_from_none() -> None:
    assert slope(Curve("", (10, 20, 80), (1.0, 2.0, 8.0))) == pytest.approx(1.0)
    assert slope(Curve("", (10, 20, 80), (3.0, 9.0, 3.0))) == pytest.approx(0.0)


def test_through_a_lens_the_same_surface_is_seen_on_other_pixels() -> None:
    """A board 1 m before a sensor that has a hole: the hole moves inwards with the lens, and stands on the same ray."""
    camera = Camera(80, 60, 70.0, 72.0, 39.0, 31.0)
    depth, hole = np.ones((60, 80), dtype=np.float32), (50, 72)
    depth[49:52, 71:74] = 0.0
    none = np.zeros((0, 3))
    cloud = Cloud(none, none, none[:, 0] > 0.0, np.zeros(0, dtype=np.int64), (View("one", camera, np.eye(4), depth),))
    (view,) = seen_through(cloud, (-0.2, 0.0, 0.0, 0.0)).views
    (row,), (column,), _ = pixels_in(view.camera, np.append(ray_slopes(camera)[hole], 1.0)[None])
    assert column < 72
    assert view.depth[row, column] == 0.0
    assert view.depth[hole] == 1.0


def test_a_step_of_algorithm_2_is_timed_beside_plain_numpy(limb: KnownLimb) -> None:
    skin, equations = evaluation_timings(limb.subject, limb.targets[::4], repeat=2)
    assert skin.twin is not None
    assert len(skin.processor) == len(skin.twin) == len(equations.processor) == 2
    assert "10 coordinates, 16 of shape and the tissue" in skin.stage
    assert "196 unknowns in 3 poses" in equations.stage


def toy_subject() -> tuple[Subject, Floats]:
    body = make_body(toy_anatomy())
    theta = rest_theta(body) + 0.2
    return Subject(body, theta[None], np.zeros(1), np.eye(len(body.shape) + 3), {}), theta


def test_a_finer_skin_moves_as_the_coarse_one_does() -> None:
    subject, theta = toy_subject()
    fine = with_finer_skin(subject)
    coarse = len(subject.body.v_hat)
    faces = fine.anatomy.skin_faces
    assert len(faces) == 4 * len(subject.anatomy.skin_faces)
    assert set(range(coarse, len(fine.body.v_hat))) <= set(faces.ravel().tolist())
    np.testing.assert_allclose(pose_skin(fine.body, theta)[:coarse], pose_skin(subject.body, theta), atol=1e-12)
    corners = fine.body.v_hat[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    corners = subject.body.v_hat[subject.anatomy.skin_faces]
    assert area == pytest.approx(
        np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    )


def test_a_skin_that_is_right_has_no_error_and_a_moved_one_has_its_own() -> None:
    subject, theta = toy_subject()
    true = pose_skin(subject.body, theta)
    assert skin_errors(subject.body, theta, true) == {"vertex": 0.0, "surface": 0.0}
    moved = skin_errors(subject.body, theta, true + np.array([0.003, 0.0, 0.0]))
    assert moved["vertex"] == pytest.approx(3.0)
    assert 0.0 < moved["surface"] < 3.0


@pytest.mark.skipif(sys.platform == "win32", reason="a child's memory is not told there")
def test_a_command_is_measured_and_one_that_fails_says_why() -> None:
    ours = np.ones(50_000_000)  # 400 MB that the command does not hold
    process = measured("--help", [])
    assert 0.0 < process.seconds < 60.0
    assert 5.0 < process.peak_mib < 300.0 < ours.nbytes / 2**20
    with pytest.raises(CommandFailed, match=r"track.*nowhere"):
        measured("track", ["nowhere", "--subject", "nobody.npz", "--out", "nothing"])
