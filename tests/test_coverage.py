"""How often stated deviations cover: shares of known scores, and errors against the truth of a recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from track.evaluation.coverage import WITHIN, Scores, coverages, plot_coverage, score_motion, table_lines
from track.motion import Motion, MotionError, coordinate_names


@pytest.fixture
def stated(limb) -> Motion:
    """The true motion, each angle and length off by one and a half of its stated deviations."""
    size = np.full(limb.thetas.shape, 0.002)
    return Motion(
        anatomy=limb.subject.anatomy.name,
        coordinates=coordinate_names(limb.subject.anatomy),
        times=limb.times,
        thetas=limb.thetas + 1.5 * size,
        deviations=size,
        lost=("",) * len(limb.times),
        shown=np.ones((len(limb.times), len(limb.subject.anatomy.bones)), dtype=bool),
        residuals=np.zeros(len(limb.times)),
        coverage=np.ones(len(limb.times)),
        matches=np.full(len(limb.times), 1000.0),
        transforms={},
        centres={},
    )


def drawn(anatomy, *, count: int, size: float, seed: int = 0) -> list[Scores]:
    """Subjects with a constant error each, normal over the subjects, stated as ``size`` of what it is."""
    rng, n = np.random.default_rng(seed), len(anatomy.coordinates)
    errors = [np.tile(0.01 * rng.normal(size=n), (5, 1)) for _ in range(count)]
    return [Scores(anatomy, error, np.full_like(error, 0.01 * size)) for error in errors]


def test_errors_are_those_against_the_truth_in_the_recordings_frame(limb, stated):
    scores = score_motion(stated, limb.recording)
    np.testing.assert_allclose(scores.z, 1.5, atol=0.01)


def test_a_rotation_vector_is_the_same_a_turn_further(limb, stated):
    turned = stated.thetas.copy()
    length = np.linalg.norm(turned[:, :3], axis=1, keepdims=True)
    turned[:, :3] *= (length - 2.0 * np.pi) / length
    np.testing.assert_allclose(
        Rotation.from_rotvec(turned[:, :3]).as_matrix(), Rotation.from_rotvec(stated.thetas[:, :3]).as_matrix()
    )
    errors = score_motion(replace(stated, thetas=turned), limb.recording).errors
    assert np.abs(errors).max() < 0.05


def test_frames_that_were_lost_or_partly_guessed_are_left_out(limb, stated):
    lost, shown = ("gone", *stated.lost[1:]), stated.shown.copy()
    shown[1, -1] = False
    assert len(score_motion(replace(stated, lost=lost, shown=shown), limb.recording).errors) == len(limb.times) - 2
    with pytest.raises(MotionError, match="leave this subject out"):
        score_motion(replace(stated, shown=np.zeros_like(shown)), limb.recording)


def test_another_anatomys_motion_is_refused(limb, stated):
    with pytest.raises(MotionError, match="lower-limb-right"):
        score_motion(replace(stated, anatomy="lower-limb-right"), limb.recording)


def test_right_deviations_cover_as_a_normal_distribution_does(arm):
    *rows, everything = coverages(drawn(arm, count=400, size=1.0))
    assert [row.name for row in rows] == [coordinate.name for coordinate in arm.coordinates]
    np.testing.assert_allclose(everything.within, [0.383, 0.683, 0.866, 0.954, 0.988, 0.997], atol=0.02)
    assert everything.spread == pytest.approx(1.0, abs=0.03)
    assert everything.interval[0] < 1.0 < everything.interval[1]
    assert everything.lasting == pytest.approx(1.0)
    assert rows[0].error == pytest.approx(np.rad2deg(0.01), rel=0.1)
    assert rows[3].stated == pytest.approx(10.0)


@pytest.mark.parametrize(("size", "spread"), [(0.5, 2.0), (2.0, 0.5)])
def test_deviations_that_are_stated_too_small_or_too_large_show(arm, size, spread):
    everything = coverages(drawn(arm, count=400, size=size))[-1]
    assert everything.spread == pytest.approx(spread, rel=0.05)
    assert (everything.within[3] < 0.75) == (size < 1.0)


def test_few_subjects_leave_the_spread_uncertain_however_many_frames_they_have(arm):
    few, many = (coverages(drawn(arm, count=count, size=1.0))[-1].interval for count in (5, 80))
    assert few[1] - few[0] > 2.0 * (many[1] - many[0])


def test_the_table_and_the_picture_are_made(arm, tmp_path):
    subjects = drawn(arm, count=3, size=1.0)
    lines = table_lines(coverages(subjects), len(subjects))
    assert len(lines) == len(arm.coordinates) + 4
    assert all(line.count("|") == 7 + len(WITHIN) for line in lines)
    plot_coverage({arm.name: subjects}, tmp_path / "coverage.png")
    assert (tmp_path / "coverage.png").stat().st_size > 10_000
