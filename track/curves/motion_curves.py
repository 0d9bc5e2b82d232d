"""All curves of a motion, its events and its cycles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from adapt.anatomy import Anatomy, Coordinate, Floats
from adapt.model.joints import JOINT_TYPES
from adapt.model.pose_space import joint_coordinates, joint_index
from adapt.plain_words import plain_words, without_side
from capture.errors import BonetrackError
from track.curves.curve import Curve, least_span, smoothed_curve, unbroken_spans
from track.curves.cycles import Cycle, CycleCurves, cycle_curves
from track.curves.gait import foot_of, gait_events
from track.curves.repetitions import Repetition, repetitions
from track.motion import Motion
from track.observed_bones import known_thetas

EventsAsked = Literal["auto", "gait", "repetitions", "none"]


class CurvesError(BonetrackError):
    """A motion has no curves, or not the ones that are asked for."""


@dataclass(frozen=True)
class CurvesOptions:
    """What is asked for: a cut-off (Hz; None is by residual analysis), which events, and the angle that repeats."""

    cutoff_hz: float | None = None
    events: EventsAsked = "auto"
    by: str | None = None


@dataclass(frozen=True)
class Event:
    """Something that happens at a time (s)."""

    time: float
    name: str


@dataclass(frozen=True, eq=False)
class MotionCurves:
    """Curves of a motion by coordinate, events, and cycles of one ``kind``; ``told`` are lines for people."""

    anatomy: Anatomy
    times: Floats = field(repr=False)
    curves: Mapping[str, Curve] = field(repr=False)
    events: tuple[Event, ...]
    cycles: tuple[Cycle, ...]
    kind: str
    by: str
    told: tuple[str, ...]

    def cycle_curves(self, coordinate: str, quantity: Literal["angle", "velocity", "acceleration"]) -> CycleCurves:
        """One quantity of a coordinate in every cycle."""
        curve = self.curves[coordinate]
        return cycle_curves(self.times, getattr(curve, quantity).value, self.cycles, curve.spans)

    def lasting_cycle(self, coordinate: str) -> Floats:
        """The part of the angle's deviation (101,) that is the same in all cycles, in the mean over them."""
        curve = self.curves[coordinate]
        return cycle_curves(self.times, curve.angle.lasting, self.cycles, curve.spans).mean


def motion_curves(motion: Motion, anatomy: Anatomy, options: CurvesOptions | None = None) -> MotionCurves:
    """Smoothed curves of every joint angle of a motion, with its events and cycles.

    Raises:
        CurvesError: no frame is tracked, all spans are too short, or the angle asked for is none of the motion's.
    """
    asked = options or CurvesOptions()
    told: list[str] = []
    curves = _curves(motion, anatomy, asked, told)
    known = {name: curve for name, curve in curves.items() if curve.spans}
    if not known:
        raise _too_short(motion, asked.cutoff_hz)
    told += [f"{plain_words(n).name} is known in no span long enough to smooth" for n in curves if n not in known]
    by = _repeating(known, asked.by)
    events, cycles, kind = _events(motion, anatomy, known[by], asked.events, told)
    found = MotionCurves(anatomy, motion.times, curves, events, cycles, kind, by, ())
    for name, curve in known.items():
        if left_out := len(found.cycle_curves(name, "angle").left_out):
            told.append(
                f"{curve.words.name}: {left_out} of {len(cycles)} cycles are left out, not all of them is known"
            )
    return replace(found, told=tuple(told))


def angles_of(anatomy: Anatomy) -> list[tuple[int, Coordinate]]:
    """The coordinates that have curves, with their index: of joints, and no part of a rotation vector.

    >>> from adapt.anatomy_file import load_anatomy
    >>> [coordinate.name for _, coordinate in angles_of(load_anatomy("upper-limb-right"))]
    ['elbow_flexion', 'pro_sup', 'deviation', 'flexion']
    """
    turns = {
        joint_index(anatomy, joint)[k] for joint in anatomy.joints for k in JOINT_TYPES[joint.type].rotation_vector
    }
    return [(i, anatomy.coordinates[i]) for i in joint_coordinates(anatomy) if i not in turns]


def _curves(motion: Motion, anatomy: Anatomy, asked: CurvesOptions, told: list[str]) -> dict[str, Curve]:
    names = tuple(coordinate.name for coordinate in anatomy.coordinates)
    if motion.coordinates != names:
        raise CurvesError("its coordinates are not the anatomy's", remedy="give the subject that was tracked")
    if len(motion.times) < 2 or not motion.tracked.any():
        raise CurvesError("no frame of the motion is tracked", remedy="see `bonetrack report` for why they were lost")
    known = known_thetas(anatomy, motion.thetas, motion.shown)
    angles = angles_of(anatomy)
    for i in set(joint_coordinates(anatomy)) - {i for i, _ in angles}:
        told.append(f"{names[i]} is part of a rotation vector, of which there is no curve")
    curves = {
        one.name: smoothed_curve(one, motion.times, known[:, i], motion.deviations[:, i], cutoff_hz=asked.cutoff_hz)
        for i, one in angles
    }
    for name, curve in curves.items():
        if asked.cutoff_hz is not None and curve.cutoff_hz < asked.cutoff_hz:
            told.append(f"{plain_words(name).name} is cut off at {curve.cutoff_hz:.1f} Hz, the most at this frame rate")
        if not curve.has_floor and curve.spans and asked.cutoff_hz is None:
            told.append(f"{plain_words(name).name} moves as fast as it is measured: its noise may be overstated")
    return curves


def _too_short(motion: Motion, cutoff: float | None) -> CurvesError:
    """What to say where nothing can be smoothed."""
    longest = max(span.stop - span.start for span in unbroken_spans(motion.times, motion.tracked))
    need = least_span(motion.times, cutoff)
    problem = f"too short to smooth: the longest span without a lost frame is {longest} frames, {need} are needed"
    return CurvesError(problem, remedy="track a longer recording, or give a higher --cutoff")


def _repeating(known: Mapping[str, Curve], asked: str | None) -> str:
    """The angle whose repetitions count: the one asked for, or the one that moves farthest."""
    if asked is None:
        return max(
            known, key=lambda name: float(np.nanmax(known[name].angle.value) - np.nanmin(known[name].angle.value))
        )
    for name in known:
        if asked in (name, without_side(name)):
            return name
    raise CurvesError(f"no curve of {asked!r}", remedy=f"use one of {', '.join(known)}")


def _events(
    motion: Motion, anatomy: Anatomy, curve: Curve, asked: EventsAsked, told: list[str]
) -> tuple[tuple[Event, ...], tuple[Cycle, ...], str]:
    """Events, cycles and what kind they are."""
    if asked == "gait" or (asked == "auto" and foot_of(anatomy) is not None):
        gait = gait_events(motion, anatomy)
        if gait.doubt:
            told.append(f"this does not look like walking: {gait.doubt}")
        if asked == "gait" or not gait.doubt:
            marks = [Event(t, "heel strike") for t in gait.strikes] + [Event(t, "toe-off") for t in gait.toe_offs]
            cycles = [Cycle(a, c, (("toe-off", (b - a) / (c - a)),)) for a, b, c in gait.strides]
            if not cycles:
                told.append(f"{len(gait.strikes)} heel strikes and {len(gait.toe_offs)} toe-offs: no whole stride")
            return tuple(sorted(marks, key=lambda event: event.time)), tuple(cycles), "stride"
    if asked == "none":
        return (), (), ""
    found = repetitions(motion.times, curve.angle.value, curve.spans)
    if not found:
        told.append(f"{curve.words.name} does not go there and back, so there are no repetitions")
    moments = [((one.start, "start"), (one.turn, "turn"), (one.end, "end")) for one in found]
    events = [Event(time, name) for three in moments for time, name in three]
    cycles = [_there_and_back(one) for one in found]
    return tuple(events), tuple(cycles), "repetition"


def _there_and_back(one: Repetition) -> Cycle:
    return Cycle(one.start, one.end, (("turn", (one.turn - one.start) / (one.end - one.start)),), one.whole)
