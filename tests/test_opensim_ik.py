"""The comparison with OpenSim's inverse kinematics: markers on the skin, scaling, solving, and fair scores."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest
from click.testing import CliRunner

from adapt.anatomy import Anatomy
from adapt.anatomy_file import load_anatomy
from adapt.model.body import Body, make_body, pose_skin, rest_theta
from capture.rigid import exp_so3, transform
from tests.toy_anatomy import toy_anatomy
from track.accuracy.truth import Truth
from track.evaluation.made_up_motions import motion_names, motion_spans, perform
from track.evaluation.markers import marker_set, marker_trial, markers_at_rest, misplaced
from track.evaluation.opensim_ik import Answer, _scores, main, opensim_answers
from track.evaluation.opensim_ik_tables import OURS, comparison_rows, motion_rows
from track.evaluation.opensim_tools import OpenSimError, opensim
from track.evaluation.random_bodies import random_body
from track.evaluation.reconstruction import differences, reconstruction_of_poses
from track.simulation.performance import PerformanceError

LIMBS = ("upper-limb-right", "lower-limb-left")
OTHER = "OpenSim scaled 1e-05"
LIMITS = {"true": (1.0, 3.0), "scaled": (4.0, 6.0), "misplaced": (10.0, 15.0)}  # mm, deg


@pytest.fixture(scope="module", params=LIMBS)
def anatomy(request) -> Anatomy:
    return load_anatomy(request.param)


@pytest.fixture(scope="module")
def body(anatomy) -> Body:
    return random_body(anatomy, 5)


def moving(body: Body) -> Truth:
    performance = perform(body, motion_names(body.anatomy), seconds_each=0.3, fps=10.0, seed=2)
    return Truth(body, performance.times, performance.thetas, {})


def faces_of(anatomy: Anatomy) -> dict[str, np.ndarray]:
    return {bone.name: bone.faces for bone in anatomy.bones}


def test_markers_sit_on_the_skin_of_every_bone_where_it_counts(anatomy):
    markers = marker_set(anatomy)
    assert len(markers.markers) >= 17
    assert len(set(markers.vertices.tolist())) == len(markers.markers)
    assert (anatomy.fit_weight[markers.vertices] > 0.5).all()
    carriers = [marker.bone for marker in markers.markers]
    assert all(carriers.count(bone.name) >= 3 for bone in anatomy.bones if bone.name not in ("patella",))
    names = {marker.name for marker in markers.markers}
    for by_axes in markers.measurements.values():
        assert {name for pairs in by_axes.values() for pair in pairs for name in pair} <= names
        assert sorted(" ".join(by_axes).split()) == ["X", "Y", "Z"]


def test_both_sides_carry_markers_at_mirrored_places():
    right, left = (marker_set(load_anatomy(f"upper-limb-{side}")) for side in ("right", "left"))
    np.testing.assert_array_equal(right.vertices, left.vertices)


def test_an_anatomy_without_markers_is_told():
    with pytest.raises(PerformanceError, match="no markers for toy"):
        marker_set(toy_anatomy())


def test_markers_ride_on_the_skin_and_are_measured_with_the_noise_stated(body):
    markers, truth = marker_set(body.anatomy), moving(body)
    exact = marker_trial(body, truth.thetas, markers, noise_m=0.0, rng=np.random.default_rng(0))
    noisy = marker_trial(body, truth.thetas, markers, noise_m=5e-4, rng=np.random.default_rng(0))
    skin = pose_skin(body, truth.thetas[3])
    for marker in markers.markers:
        np.testing.assert_allclose(exact[marker.name][3], skin[marker.vertex], atol=1e-9)
    error = np.concatenate([(noisy[name] - exact[name]).ravel() for name in exact])
    assert np.sqrt((error**2).mean()) == pytest.approx(5e-4, rel=0.1)
    at_rest = marker_trial(body, rest_theta(body)[None], markers, noise_m=0.0, rng=np.random.default_rng(0))
    for name, marker in markers_at_rest(body, markers).items():
        np.testing.assert_allclose(at_rest[name][0], marker.position, atol=1e-6)


def test_misplaced_markers_are_off_by_about_what_is_stated(anatomy):
    right = marker_set(anatomy)
    off = [
        anatomy.skin_vertices[misplaced(right, anatomy, deviation_m=0.005, rng=np.random.default_rng(k)).vertices]
        - anatomy.skin_vertices[right.vertices]
        for k in range(20)
    ]
    # What lies off the skin is lost: two of the three axes are left.
    assert np.sqrt((np.array(off) ** 2).sum(axis=2).mean()) == pytest.approx(0.005 * np.sqrt(2.0), rel=0.25)
    np.testing.assert_array_equal(
        misplaced(right, anatomy, deviation_m=0.0, rng=np.random.default_rng(0)).vertices, right.vertices
    )


def test_differences_are_none_from_itself_and_a_shift_is_measured_as_one(body):
    truth, shift = moving(body), transform(np.eye(3), np.array([0.0, 0.003, 0.0]))
    right = reconstruction_of_poses(body, truth.thetas, np.eye(4))
    shifted = reconstruction_of_poses(body, truth.thetas, shift)
    for (kind, unit), values in differences(right, right, faces_of(body.anatomy)).items():
        np.testing.assert_allclose(values, 0.0, atol=1e-3, err_msg=f"{kind} {unit}")
    for (kind, _), values in differences(shifted, right, faces_of(body.anatomy)).items():
        if kind.startswith(("centre", "points")):
            np.testing.assert_allclose(values, 3.0, atol=1e-6)
        elif kind.startswith("surface"):
            assert (values > 0.5).all()
            assert (values < 3.0).all()
        else:
            np.testing.assert_allclose(values, 0.0)


def test_only_frames_that_we_tracked_are_scored(body):
    truth = moving(body)
    thetas = truth.thetas.copy()
    thetas[2] = np.nan
    turned = transform(exp_so3(np.array([0.0, 0.0, 0.1])), np.zeros(3))
    answers = {
        OURS: Answer(reconstruction_of_poses(body, thetas, np.eye(4)), 0.2, 0.1),
        OTHER: Answer(reconstruction_of_poses(body, truth.thetas, turned), 0.002, 0.001),
    }
    spans = {"first": slice(0, 4), "rest": slice(4, None), "lost": slice(2, 3)}
    scores = _scores(body.anatomy, truth, answers, spans)
    assert (scores["frames"], scores["lost"]) == (len(thetas), 1)
    root = body.anatomy.joints[0].name
    assert scores["errors"][OURS][f"centre {root}"]["max"] == pytest.approx(0.0, abs=1e-6)
    assert scores["errors"][OTHER][f"centre {root}"]["mean"] > 1.0
    assert scores["apart"][OTHER][f"centre {root}"] == scores["errors"][OTHER][f"centre {root}"]
    assert {name: part["scored"] for name, part in scores["by_motion"].items()} == {"first": 3, "rest": len(thetas) - 4}
    header, *rows = comparison_rows([scores, scores])
    assert header[2:4] == [OURS, OTHER]
    assert {row[0]: row[2] for row in rows}["frames lost"] == f"2 of {2 * len(thetas)}"
    assert motion_rows([scores])[0][2:] == [f"{OURS} - truth", f"{OTHER} - truth", f"{OTHER} - {OURS}"]
    assert len(motion_rows([scores])) == 1 + 2 * (len(body.anatomy.coordinates) - 6)


def test_spans_are_the_frames_of_each_motion(body):
    names = motion_names(body.anatomy)
    performance = perform(body, names, seconds_each=0.5, fps=10.0)
    spans = motion_spans(names, seconds_each=0.5, fps=10.0)
    assert list(spans) == list(names)
    assert [span.stop - span.start for span in spans.values()] == [5] * len(names)
    assert spans[names[0]].start == 0
    assert spans[names[-1]].stop == len(performance.times)


def test_a_finished_subject_is_not_done_again_and_other_options_are_told(tmp_path):
    pytest.importorskip("opensim", reason="OpenSim is not installed: pip install bonetrack[opensim]")
    body = make_body(load_anatomy("upper-limb-right"))
    truth = moving(body)
    said = {name: Answer(reconstruction_of_poses(body, truth.thetas, np.eye(4)), 0.2, 0.1) for name in (OURS, OTHER)}
    folder = tmp_path / "upper-limb-right-1"
    folder.mkdir()
    (folder / "comparison.json").write_text(json.dumps(_scores(body.anatomy, truth, said)))
    ran = CliRunner().invoke(main, ["--seconds", "1", "--out", str(tmp_path)])
    assert ran.exit_code == 0
    assert "| angle elbow_flexion | deg | 0.00 ± 0.00 (0.0)" in (tmp_path / "upper-limb-right.md").read_text()
    ran = CliRunner().invoke(main, ["--seconds", "2", "--out", str(tmp_path)])
    assert ran.exit_code == 1
    assert "other options" in ran.output


def test_a_missing_opensim_is_one_clear_error(monkeypatch):
    monkeypatch.setitem(sys.modules, "opensim", None)
    with pytest.raises(OpenSimError, match="not installed"):
        opensim()


def test_opensim_with_the_true_model_finds_the_truth_and_with_a_scaled_one_comes_near(body, tmp_path):
    pytest.importorskip("opensim", reason="OpenSim is not installed: pip install bonetrack[opensim]")
    truth = moving(body)
    answers = opensim_answers(truth, tmp_path, np.random.default_rng(1))
    right = reconstruction_of_poses(body, truth.thetas, np.eye(4))
    for name, answer in answers.items():
        apart = {kind: v.mean() for (kind, _), v in differences(answer.said, right, faces_of(body.anatomy)).items()}
        surfaces = [value for kind, value in apart.items() if kind.startswith("surface")]
        angles = [value for kind, value in apart.items() if kind.startswith("angle")]
        surface, angle = next(limits for laboratory, limits in LIMITS.items() if laboratory in name)
        assert max(surfaces) < surface, (name, apart)
        assert max(angles) < angle, (name, apart)
        assert 0.0 < answer.processor_s < 1.0
    assert len(answers) == 5
