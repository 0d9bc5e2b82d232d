"""Curves: smoothing, its uncertainty, spans, repetitions, cycles and files, on made-up and on real movements."""

from __future__ import annotations

import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from adapt.anatomy import Anatomy, Floats
from adapt.anatomy_file import load_anatomy
from capture.errors import OutputError
from tests.real_motions import columns_of, leg_motion, motion_of, poses
from track.about import About
from track.curves.commands import curves_command
from track.curves.curve import smoothed_curve
from track.curves.files import curve_tables, write_curves
from track.curves.low_pass import low_pass, noise_gain, smooth, stacked
from track.curves.motion_curves import CurvesError, CurvesOptions, MotionCurves, motion_curves
from track.curves.ranges import range_of
from track.curves.repetitions import repetitions
from track.curves.residuals import residual_analysis
from track.motion import Motion, save_motion

RATE = 50.0


def elbow(arm: Anatomy):
    return arm.coordinates[arm.coordinate_index("elbow_flexion")]


def bends(arm: Anatomy, values: Floats, *, rate: float = RATE, deviation_deg: float = 1.0) -> Motion:
    """The arm with the elbow's angle (T,) over time and all else at rest; NaN frames are lost."""
    thetas = poses(arm, {"elbow_flexion": values}, len(values))
    thetas[~np.isfinite(values)] = np.nan
    return motion_of(arm, np.arange(len(values)) / rate, thetas, deviation_deg=deviation_deg, placed=False)


def curve_of(arm: Anatomy, values: Floats, *, sd: float = 0.02, cutoff: float | None = 6.0):
    times = np.arange(len(values)) / RATE
    return smoothed_curve(elbow(arm), times, values, np.full(len(values), sd), cutoff_hz=cutoff)


# smoothing


@pytest.mark.parametrize("cutoff", [2.0, 6.0, 12.0])
def test_what_changes_at_the_cut_off_keeps_half_of_its_power_and_is_not_shifted(cutoff: float) -> None:
    t = np.arange(1000) / RATE
    wave = np.sin(2.0 * np.pi * cutoff * t)
    kept = low_pass(wave, RATE, cutoff)[200:-200]
    along = wave[200:-200] @ kept / (wave[200:-200] @ wave[200:-200])
    assert along == pytest.approx(np.sqrt(0.5), abs=2e-3)
    assert np.abs(kept - along * wave[200:-200]).max() < 5e-3  # nothing of it comes earlier or later


def test_what_changes_evenly_is_kept_with_its_speed() -> None:
    t = np.arange(100) / RATE
    found = smooth(3.0 * t + 1.0, RATE, 6.0)
    assert found.value == pytest.approx(3.0 * t + 1.0, abs=1e-4)
    assert found.velocity == pytest.approx(3.0, abs=2e-3)


@pytest.mark.parametrize("count", [30, 400])
def test_noise_is_let_through_as_much_as_is_said(count: int) -> None:
    noise = np.random.default_rng(3).normal(0.0, 1.0, (count, 4000))
    measured = stacked(smooth(noise, RATE, 6.0)).std(axis=2)
    assert measured / noise_gain(count, RATE, 6.0) == pytest.approx(1.0, abs=0.06)


def test_residual_analysis_finds_the_noise_that_was_added_to_a_real_movement() -> None:
    knee = columns_of("squats_opencap_s4")["knee_angle_r"]
    noisy = knee + np.random.default_rng(1).normal(0.0, np.deg2rad(0.5), len(knee))
    found = residual_analysis([noisy], RATE)
    assert np.rad2deg(found.noise) == pytest.approx(0.5, rel=0.12)
    assert 1.5 < found.cutoff < 4.0
    assert found.has_floor


def test_residual_analysis_cuts_off_more_where_there_is_more_noise() -> None:
    hip = columns_of("gait_walk_gait2392")["hip_flexion_r"]
    noise = np.random.default_rng(1).normal(0.0, 1.0, len(hip))
    cutoffs = [residual_analysis([hip + np.deg2rad(sd) * noise], RATE).cutoff for sd in (0.1, 0.5, 2.0)]
    assert cutoffs[0] > cutoffs[1] > cutoffs[2]


# how sure


@pytest.mark.parametrize(
    "name", ["squats_opencap_s4", "sit_to_stand_opencap_s4", "gait_walk_rajagopal", "run_rajagopal"]
)
def test_errors_of_real_movements_are_within_two_stated_deviations_as_often_as_said(arm: Anatomy, name: str) -> None:
    """Noise of 0.5 degrees, and an error of the body of 1.5, which is the same in all frames of a motion."""
    truth = stacked(smooth(columns_of(name)["knee_angle_r"], RATE, 12.0))[:, 20:-20]
    rng, noise, body = np.random.default_rng(5), np.deg2rad(0.5), np.deg2rad(1.5)
    within = []
    for _ in range(40):
        values = truth[0] + rng.normal(0.0, noise, truth.shape[1]) + rng.normal(0.0, body)
        curve = curve_of(arm, values, sd=float(np.hypot(noise, body)))
        quantities = (curve.angle, curve.velocity, curve.acceleration)
        within.append([np.abs(q.value - true) < 2.0 * q.sd for q, true in zip(quantities, truth, strict=True)])
    known = np.isfinite(curve.acceleration.sd)
    share = np.array(within)[:, :, known].mean(axis=(0, 2))
    assert (share > 0.88).all(), share
    assert share[0] < 1.0


def test_what_lasts_is_not_smoothed_away_and_takes_no_part_in_speed(arm: Anatomy) -> None:
    t = np.arange(500) / RATE
    noise = np.random.default_rng(2).normal(0.0, 0.01, len(t))
    curve = curve_of(arm, np.sin(t) + noise, sd=0.05)
    at = 250
    assert curve.angle.lasting[at] == pytest.approx(np.sqrt(0.05**2 - 0.01**2), rel=0.05)
    assert curve.angle.sd[at] < 0.052
    assert curve.velocity.lasting[at] == pytest.approx(0.0, abs=1e-6)
    assert curve.velocity.sd[at] == pytest.approx(curve.noise * noise_gain(500, RATE, 6.0)[1, at], rel=0.3)


def test_movement_that_the_filter_takes_away_widens_the_deviation(arm: Anatomy) -> None:
    t = np.arange(500) / RATE
    noise = np.random.default_rng(2).normal(0.0, 0.005, len(t))
    shaking = curve_of(arm, 0.1 * np.sin(2.0 * np.pi * 7.0 * t) + noise, sd=0.005)
    still = curve_of(arm, noise, sd=0.005)
    assert shaking.angle.sd[250] > 5.0 * still.angle.sd[250]


# spans


def test_smoothing_never_crosses_frames_that_are_not_known(arm: Anatomy) -> None:
    t = np.arange(300) / RATE
    values = np.sin(t)
    values[150:160] = np.nan
    one, other = curve_of(arm, values), curve_of(arm, np.where(t > 3.1, values + 2.0, values))
    assert one.spans == (slice(0, 150), slice(160, 300))
    assert np.isnan(one.angle.value[150:160]).all()
    assert one.angle.value[:150] == pytest.approx(other.angle.value[:150], abs=0.0)
    assert np.isfinite(one.angle.value[[149, 160]]).all()
    ends = [0, 149, 160, 299]
    assert np.isnan(one.velocity.value[ends]).all()
    assert np.isnan(one.acceleration.value[ends]).all()


def test_a_frame_that_the_recording_lacks_ends_a_span_too(arm: Anatomy) -> None:
    times = np.delete(np.arange(200) / RATE, [100, 101])
    curve = smoothed_curve(elbow(arm), times, np.sin(times), np.full(198, 0.02), cutoff_hz=6.0)
    assert curve.spans == (slice(0, 100), slice(100, 198))


def test_uneven_times_are_smoothed_as_even_ones(arm: Anatomy) -> None:
    even = np.arange(300) / RATE
    uneven = even + np.random.default_rng(1).uniform(-0.2, 0.2, 300) / RATE
    curve = smoothed_curve(elbow(arm), uneven, np.sin(2.0 * uneven), np.full(300, 0.02), cutoff_hz=6.0)
    assert curve.angle.value[50:-50] == pytest.approx(np.sin(2.0 * uneven[50:-50]), abs=2e-3)
    assert curve.velocity.value[50:-50] == pytest.approx(2.0 * np.cos(2.0 * uneven[50:-50]), abs=0.05)


def test_a_motion_too_short_to_smooth_is_told_in_one_line(arm: Anatomy) -> None:
    values = np.linspace(0.5, 1.0, 40)
    values[::5] = np.nan
    with pytest.raises(CurvesError, match="longest span without a lost frame is 4 frames, 17 are needed"):
        motion_curves(bends(arm, values), arm)


def test_a_motion_without_a_tracked_frame_is_told_in_one_line(arm: Anatomy) -> None:
    with pytest.raises(CurvesError, match="no frame of the motion is tracked"):
        motion_curves(bends(arm, np.full(30, np.nan)), arm)


def test_a_hidden_bone_takes_only_its_own_angles_away(arm: Anatomy) -> None:
    motion = bends(arm, np.sin(np.arange(200) / RATE))
    shown = motion.shown.copy()
    shown[:, list(motion.transforms).index("hand")] = False
    found = motion_curves(replace(motion, shown=shown), arm)
    assert found.curves["elbow_flexion"].spans
    assert not found.curves["flexion"].spans
    assert "wrist flexion is known in no span long enough to smooth" in found.told


# repetitions and cycles


@pytest.mark.parametrize(
    ("name", "count", "seconds"),
    [("squats_opencap_s4", 3, 1.7), ("sit_to_stand_opencap_s4", 3, 1.35), ("squat_deep_arms_overhead", 5, 1.4)],
)
def test_repetitions_of_real_movements_are_counted(name: str, count: int, seconds: float) -> None:
    """Squats begin upright; who gets up from a chair begins with bent knees. The fourth squat is cut by the end."""
    knee = columns_of(name)["knee_angle_r"]
    found = repetitions(np.arange(len(knee)) / RATE, knee, (slice(0, len(knee)),))
    assert len(found) == count
    assert np.mean([one.end - one.start for one in found]) == pytest.approx(seconds, abs=0.15)


def test_repetitions_of_known_times_are_found_without_the_pauses_between(arm: Anatomy) -> None:
    t = np.arange(600) / RATE
    way = np.clip(np.minimum((t % 4.0) - 1.0, 3.0 - (t % 4.0)), 0.0, 1.0)  # up from 1 s to 2 s, down to 3 s
    found = motion_curves(bends(arm, 0.3 + way), arm, CurvesOptions(cutoff_hz=10.0))
    assert [cycle.start for cycle in found.cycles] == pytest.approx([1.1, 5.1, 9.1], abs=0.02)
    assert [cycle.end for cycle in found.cycles] == pytest.approx([2.9, 6.9, 10.9], abs=0.02)
    assert found.cycle_curves("elbow_flexion", "angle").values.shape == (3, 101)


def test_a_repetition_with_lost_frames_in_it_is_none(arm: Anatomy) -> None:
    t = np.arange(600) / RATE
    values = 1.0 - np.cos(2.0 * np.pi * t / 3.0)
    values[[225, 226]] = np.nan  # in the middle of the second
    found = motion_curves(bends(arm, values), arm, CurvesOptions(cutoff_hz=6.0))
    assert [round(cycle.start) for cycle in found.cycles] == [0, 6, 9]


def test_cycles_with_a_hidden_bone_are_left_out_of_its_angles_and_it_is_said(arm: Anatomy) -> None:
    motion = bends(arm, 1.0 - np.cos(2.0 * np.pi * np.arange(600) / RATE / 3.0))
    shown = motion.shown.copy()
    shown[200:220, list(motion.transforms).index("hand")] = False
    found = motion_curves(replace(motion, shown=shown), arm, CurvesOptions(cutoff_hz=6.0))
    assert found.cycle_curves("elbow_flexion", "angle").kept == (0, 1, 2, 3)
    assert found.cycle_curves("flexion", "angle").kept == (0, 2, 3)
    assert "wrist flexion: 1 of 4 cycles are left out, not all of them is known" in found.told


def test_a_cut_off_that_the_frame_rate_does_not_allow_is_told(arm: Anatomy) -> None:
    motion = bends(arm, np.sin(np.arange(200) / 10.0), rate=10.0)
    found = motion_curves(motion, arm, CurvesOptions(cutoff_hz=6.0, events="none"))
    assert found.curves["elbow_flexion"].cutoff_hz == pytest.approx(4.5)
    assert "elbow flexion is cut off at 4.5 Hz, the most at this frame rate" in found.told


def test_the_mean_cycle_and_its_deviation_are_those_of_the_cycles(arm: Anatomy) -> None:
    t = np.arange(600) / RATE
    sizes = np.repeat([0.8, 1.0, 1.2, 1.0], 150)
    found = motion_curves(bends(arm, sizes * (1.0 - np.cos(2.0 * np.pi * t / 3.0))), arm, CurvesOptions(cutoff_hz=10.0))
    cycles = found.cycle_curves("elbow_flexion", "angle")
    assert cycles.mean[50] == pytest.approx(2.0, abs=0.01)
    assert cycles.sd[50] == pytest.approx(2.0 * np.std([0.8, 1.0, 1.2, 1.0], ddof=1), abs=0.01)


def test_another_angle_may_be_asked_for_with_or_without_its_side() -> None:
    motion, leg = leg_motion("squats_opencap_s4"), load_anatomy("lower-limb-right")
    for name in ("knee_angle_r", "knee_angle"):
        assert motion_curves(motion, leg, CurvesOptions(by=name)).by == "knee_angle_r"
    with pytest.raises(CurvesError, match="no curve of 'elbow'; use one of hip_flexion_r"):
        motion_curves(motion, leg, CurvesOptions(by="elbow"))


def test_a_range_of_motion_is_surer_than_its_ends_where_the_error_lasts(arm: Anatomy) -> None:
    t = np.arange(500) / RATE
    noise = np.random.default_rng(2).normal(0.0, 0.005, len(t))
    found = range_of(curve_of(arm, 1.0 - np.cos(t) + noise, sd=0.05), t)
    assert found.span == pytest.approx(2.0, abs=0.02)
    assert found.low.sd == pytest.approx(0.05, rel=0.05)
    assert found.span_sd < 0.02


# files and the command


@pytest.fixture(scope="module")
def squats() -> MotionCurves:
    return motion_curves(leg_motion("squats_opencap_s4"), load_anatomy("lower-limb-right"))


def test_tables_are_tidy_and_say_what_people_call_an_angle(squats: MotionCurves) -> None:
    tables = curve_tables(squats)
    curves = tables["curves"]
    assert len(curves["time_s"]) == 5 * len(squats.times)
    assert set(curves["name"]) >= {"knee flexion", "hip rotation (inward rotation +)"}
    knee = curves["coordinate"] == "knee_angle_r"
    assert np.nanmax(curves["value"][knee]) == pytest.approx(103.0, abs=1.0)  # degrees
    assert len(tables["mean_cycle"]["percent"]) == 5 * 101
    assert set(tables["cycles"]["cycle"]) == {1, 2, 3}


def test_files_are_written_and_read_again(squats: MotionCurves, tmp_path: Path) -> None:
    about = About(person="P07")
    write_curves(squats, CurvesOptions(), about, tmp_path / "out", title="squats")
    told = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert told["about"]["person"] == "P07"
    assert told["cycles"]["count"] == 3
    assert told["coordinates"]["knee_angle_r"]["zero"] == "the straight knee"
    assert told["coordinates"]["knee_angle_r"]["range_in_cycles"]["mean"] == pytest.approx(90.0, abs=4.0)
    assert "Soucie" in told["coordinates"]["knee_angle_r"]["healthy"]["source"]
    with (tmp_path / "out" / "curves.csv").open(encoding="utf-8") as file:
        assert len(list(csv.DictReader(file))) == 5 * len(squats.times)
    assert (tmp_path / "out" / "curves.png").stat().st_size > 20_000


def test_a_file_that_is_not_ours_is_left_alone(squats: MotionCurves, tmp_path: Path) -> None:
    (tmp_path / "events.csv").write_text("mine\n")
    with pytest.raises(OutputError, match=r"events\.csv"):
        write_curves(squats, CurvesOptions(), About(), tmp_path, title="squats")
    assert [path.name for path in tmp_path.iterdir()] == ["events.csv"]


def test_the_command_says_ranges_and_repetitions(arm: Anatomy, tmp_path: Path) -> None:
    t = np.arange(300) / RATE
    noise = np.random.default_rng(1).normal(0.0, 0.003, len(t))
    (tmp_path / "motion").mkdir()
    save_motion(bends(arm, 1.0 - np.cos(2.0 * np.pi * t / 2.0) + noise), tmp_path / "motion")
    result = CliRunner().invoke(curves_command, [str(tmp_path / "motion"), "--out", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    assert "elbow flexion: " in result.output
    assert re.search(r"3 repetitions of elbow flexion, 1\.[56]\d s", result.output)


def test_the_command_names_the_motion_that_is_too_short(arm: Anatomy, tmp_path: Path) -> None:
    (tmp_path / "motion").mkdir()
    save_motion(bends(arm, np.linspace(0.0, 1.0, 9)), tmp_path / "motion")
    result = CliRunner().invoke(curves_command, [str(tmp_path / "motion"), "--out", str(tmp_path / "out")])
    assert str(result.exception).startswith(f"{tmp_path / 'motion'}: too short to smooth")
    assert not (tmp_path / "out").exists()
