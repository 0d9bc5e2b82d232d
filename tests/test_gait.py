"""Heel strikes and toe-offs: of a made-up walk, of a real one on force plates, and where nobody walks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from adapt.anatomy import Anatomy
from adapt.anatomy_file import load_anatomy
from tests.real_motions import leg_motion, motion_of, poses
from track.curves.gait import gait_events
from track.curves.motion_curves import CurvesOptions, motion_curves
from track.motion import Motion

RATE, STRIDE_S, STANCE, SPEED = 50.0, 1.1, 0.62, 1.2


@pytest.fixture(scope="module")
def leg() -> Anatomy:
    return load_anatomy("lower-limb-right")


def walk(leg: Anatomy, *, treadmill: bool = False, turned: Rotation | None = None, swing: float = 1.0) -> Motion:
    """Five strides along X: the foot stands for 62 % of a stride and then moves on at an even speed.

    On a treadmill the hip stays where it is. All is seen from another frame if ``turned``.
    """
    times = np.arange(int(5.0 * STRIDE_S * RATE)) / RATE
    number, share = np.divmod(times / STRIDE_S + 0.3, 1.0)
    step = SPEED * STRIDE_S
    ahead = np.where(share < STANCE, 0.0, (share - STANCE) / (1.0 - STANCE)) + number
    lift = np.where(share < STANCE, 0.0, 0.05 * np.sin(np.pi * (share - STANCE) / (1.0 - STANCE)))
    hip = np.column_stack([SPEED * times, np.full(len(times), 0.9), np.zeros(len(times))])
    ankle = np.column_stack([swing * step * (ahead - 0.3) + 0.35, 0.08 + lift, np.zeros(len(times))])
    if treadmill:
        ankle[:, 0] -= hip[:, 0]
        hip[:, 0] = 0.0
    turn = turned or Rotation.identity()
    motion = motion_of(leg, times, poses(leg, {}, len(times)), placed=False)
    still = np.tile(np.eye(4), (len(times), 1, 1))
    still[:, :3, :3] = turn.as_matrix()
    return replace(
        motion,
        centres=motion.centres | {"hip": turn.apply(hip), "ankle": turn.apply(ankle)},
        transforms=dict.fromkeys(motion.transforms, still),
    )


def known_events() -> tuple[list[float], list[float]]:
    """Heel strikes and toe-offs of the walk, those near its ends left out."""
    strikes = [STRIDE_S * (k - 0.3) for k in range(1, 6)]
    offs = [STRIDE_S * (k + STANCE - 0.3) for k in range(5)]
    return strikes, offs


@pytest.mark.parametrize("treadmill", [False, True])
@pytest.mark.parametrize("turned", [None, Rotation.from_rotvec([1.1, -0.7, 0.4])])
def test_events_of_a_known_walk_are_found_in_any_frame_and_on_a_treadmill(leg, treadmill, turned) -> None:
    found = gait_events(walk(leg, treadmill=treadmill, turned=turned), leg)
    strikes, offs = known_events()
    assert found.doubt == ""
    assert found.strikes == pytest.approx(strikes, abs=1.5 / RATE)
    assert found.toe_offs == pytest.approx(offs, abs=1.5 / RATE)


def test_strides_are_cut_from_strike_to_strike_and_marked_with_their_toe_off(leg) -> None:
    found = motion_curves(walk(leg), leg, CurvesOptions(cutoff_hz=6.0))
    assert found.kind == "stride"
    assert len(found.cycles) == 4
    assert [cycle.end - cycle.start for cycle in found.cycles] == pytest.approx([STRIDE_S] * 4, abs=0.03)
    assert [dict(cycle.marks)["toe-off"] for cycle in found.cycles] == pytest.approx([STANCE] * 4, abs=0.03)


def test_no_stride_leads_across_lost_frames(leg) -> None:
    motion = walk(leg)
    lost = (motion.times > 1.3) & (motion.times < 2.9)  # a strike, a toe-off, a strike and a toe-off
    centres = {name: np.where(lost[:, None], np.nan, at) for name, at in motion.centres.items()}
    found = gait_events(replace(motion, centres=centres), leg)
    assert found.doubt == ""
    assert all(1.0 < end - start < 1.2 for start, _, end in found.strides)
    assert len(found.strides) == 1


def test_a_leg_that_swings_in_the_air_does_not_walk(leg) -> None:
    motion = walk(leg)
    way = 0.35 * np.sin(2.0 * np.pi * motion.times / STRIDE_S)
    hip = np.tile([0.0, 0.9, 0.0], (len(way), 1))
    ankle = np.column_stack([way, np.full(len(way), 0.1), np.zeros(len(way))])
    found = gait_events(replace(motion, centres=motion.centres | {"hip": hip, "ankle": ankle}), leg)
    assert found.doubt == "the foot goes backward for 50 % of a stride, which is no walking"


def test_real_steps_are_found_when_force_plates_felt_them() -> None:
    """One man's walk (nimblephysics, data/grf/Subject4, BSD-2-Clause): when his plates felt more than 20 N.

    His heels are foremost 27 and 50 ms before they touch the ground.
    """
    right = gait_events(leg_motion("gait_walk_opencap_s4", "right"), load_anatomy("lower-limb-right"))
    left = gait_events(leg_motion("gait_walk_opencap_s4", "left"), load_anatomy("lower-limb-left"))
    assert right.strikes == pytest.approx([1.07], abs=0.04)
    assert right.toe_offs == pytest.approx([0.687], abs=0.02)
    assert left.strikes == pytest.approx([0.532], abs=0.06)
    assert right.doubt == left.doubt == ""


@pytest.mark.parametrize(("name", "side"), [("gait_walk_gait2392", "right"), ("gait_walk_rajagopal", "left")])
def test_real_strides_have_a_real_stance(name: str, side: str) -> None:
    found = gait_events(leg_motion(name, side), load_anatomy(f"lower-limb-{side}"))
    ((start, off, end),) = found.strides
    assert 1.0 < end - start < 1.3
    assert 0.58 < (off - start) / (end - start) < 0.68
    assert found.doubt == ""


@pytest.mark.parametrize("name", ["run_rajagopal", "squats_opencap_s4", "sit_to_stand_opencap_s4"])
def test_where_nobody_walks_repetitions_are_counted_and_it_is_said_why(name: str) -> None:
    found = motion_curves(leg_motion(name), load_anatomy("lower-limb-right"))
    assert found.kind == "repetition"
    assert any(line.startswith("this does not look like walking: ") for line in found.told)


def test_gait_that_is_asked_for_where_nobody_walks_is_given_with_a_doubt() -> None:
    found = motion_curves(
        leg_motion("run_rajagopal"), load_anatomy("lower-limb-right"), CurvesOptions(events="gait", cutoff_hz=12.0)
    )
    assert found.kind == "stride"
    assert any("does not look like walking" in line for line in found.told)


def test_an_arm_has_no_steps() -> None:
    arm = load_anatomy("upper-limb-right")
    motion = motion_of(arm, np.arange(50) / RATE, poses(arm, {}, 50), placed=False)
    assert gait_events(motion, arm).doubt == "upper-limb-right has no foot"
