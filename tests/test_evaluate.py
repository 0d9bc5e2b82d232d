"""Errors against the truth: nothing for the truth itself, what was put in for a motion that is off by it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from track.accuracy.errors import evaluate_motion
from track.motion import Motion, MotionError, bones_and_centres, coordinate_names


@pytest.fixture(scope="module")
def true_motion(limb) -> Motion:
    """The truth as a motion that states 1 degree (and 1 mm) of standard deviation."""
    count = len(limb.times)
    shown = np.ones((count, len(limb.subject.anatomy.bones)), dtype=bool)
    transforms, centres = bones_and_centres(limb.subject, limb.thetas, shown)
    units = [coordinate.unit for coordinate in limb.subject.anatomy.coordinates]
    return Motion(
        anatomy=limb.subject.anatomy.name,
        coordinates=coordinate_names(limb.subject.anatomy),
        times=limb.times,
        thetas=limb.thetas,
        deviations=np.tile([np.deg2rad(1.0) if unit == "rad" else 0.001 for unit in units], (count, 1)),
        lost=("",) * count,
        residuals=np.zeros(count),
        coverage=np.ones(count),
        matches=np.full(count, 1000.0),
        shown=shown,
        transforms=transforms,
        centres=centres,
    )


def errors(limb, motion):
    return {row.name: row for row in evaluate_motion(motion, limb.subject, limb.recording).summaries()}


def test_the_truth_has_no_error(limb, true_motion):
    for row in errors(limb, true_motion).values():
        assert row.maximum < 0.05, row
        assert row.covered in (None, 1.0)


def test_an_angle_that_is_off_is_off_by_that_much_and_covered_as_often_as_stated(limb, true_motion):
    elbow = limb.subject.anatomy.coordinate_index("elbow_flexion")
    thetas = limb.thetas.copy()
    thetas[::3, elbow] += np.deg2rad(2.5)
    thetas[1::3, elbow] += np.deg2rad(1.5)
    row = errors(limb, replace(true_motion, thetas=thetas))["angle elbow_flexion"]
    assert row.maximum == pytest.approx(2.5)
    assert row.mean == pytest.approx(4.0 / 3.0)
    assert row.covered == pytest.approx(2.0 / 3.0)


def test_lost_frames_are_counted_and_left_out(limb, true_motion):
    lost = ("gone", *true_motion.lost[1:])
    thetas = limb.thetas.copy()
    thetas[0] = np.nan
    shown = true_motion.shown.copy()
    shown[0] = False
    motion = replace(true_motion, lost=lost, thetas=thetas, shown=shown)
    evaluation = evaluate_motion(motion, limb.subject, limb.recording)
    assert evaluation.lost == 1
    assert evaluation.frames == len(limb.times)
    assert all(row.maximum < 0.05 for row in evaluation.summaries())


def test_what_is_not_claimed_is_not_scored_and_what_is_claimed_is_counted(limb, true_motion):
    """However wrong the guess of a hidden hand may be."""
    hand = list(true_motion.transforms).index("hand")
    shown, thetas = true_motion.shown.copy(), limb.thetas.copy()
    shown[2:, hand] = False
    thetas[2:, limb.subject.anatomy.coordinate_index("flexion")] += 1.0
    evaluation = evaluate_motion(replace(true_motion, shown=shown, thetas=thetas), limb.subject, limb.recording)
    count = len(limb.times)
    assert (evaluation.lost, evaluation.bones, evaluation.claimed) == (0, 4 * count, 4 * count - (count - 2))
    for name in ("points hand", "surface hand", "angle flexion", "angle deviation"):
        assert np.isfinite(evaluation.errors[name]).tolist() == [True] * 2 + [False] * (count - 2), name
    for name in ("points radius", "angle pro_sup", "centre wrist", "skin", "orientation humerus"):
        assert np.isfinite(evaluation.errors[name]).all(), name
    assert all(row.maximum < 0.05 for row in evaluation.summaries())
    assert {"bones", "claimed"} < set(evaluation.as_json())


def test_a_recording_whose_sensors_the_truth_does_not_know_is_refused_by_name(limb, true_motion):
    renamed = replace(limb.recording.sensors[0], name="renamed")
    recording = replace(limb.recording, sensors=(renamed, *limb.recording.sensors[1:]))
    with pytest.raises(MotionError, match="sensor 'renamed' that its truth does not know"):
        evaluate_motion(true_motion, limb.subject, recording)
