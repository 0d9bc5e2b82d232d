"""Heel strikes and toe-offs of one leg, from the motion of its foot against the pelvis.

A foot is set down when the heel is foremost before the pelvis and taken up when the toe is hindmost behind it (Zeni,
Richards and Higginson 2008, *Gait & Posture* 27, 710-714). It needs no floor, and holds on a treadmill, too. Forward
is the pelvis' own forward axis, averaged over two seconds, square to where the leg points in the mean: so neither the
recording's axes nor a person who walks a curve matter. Heels are foremost a little before they touch the ground: of one
man's walk on force plates both strikes were found early, by 27 and 50 ms, and the toe-off within 2 ms (docs/curves.md).
It does **not** hold for running, nor where nobody walks: what does not look like walking is doubted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import find_peaks

from adapt.anatomy import Anatomy, Floats
from track.curves.curve import unbroken_spans
from track.curves.low_pass import least_frames, low_pass
from track.motion import Motion

_CUTOFF_HZ = 6.0
_MEAN_S = 2.0
_LEAST_STEP_M = 0.25  # how far a walking foot goes against the pelvis
_PROMINENT = 0.2  # of that way, a turning point must be
_STANCE = (0.5, 0.8)  # of a stride: less is running
_SLOWER = 0.8  # a foot that stands is slower than one that swings, by this at least


@dataclass(frozen=True)
class Foot:
    """Which joints and landmarks of an anatomy tell of a leg's steps."""

    hip: str
    ankle: str
    bone: str
    heel: str
    toe: str
    pelvis: str


@dataclass(frozen=True)
class GaitEvents:
    """Heel strikes and toe-offs (s), the whole strides between them, and why they are no walking's, or empty.

    A stride is a heel strike, the toe-off after it and the next heel strike (s), all in one unbroken span.
    """

    strikes: tuple[float, ...]
    toe_offs: tuple[float, ...]
    strides: tuple[tuple[float, float, float], ...] = ()
    doubt: str = ""


def foot_of(anatomy: Anatomy) -> Foot | None:
    """The foot of a leg's anatomy; None of one that has none.

    >>> from adapt.anatomy_file import load_anatomy
    >>> foot_of(load_anatomy("upper-limb-right"))
    >>> foot_of(load_anatomy("lower-limb-left")).heel
    'heel'
    """
    foot = Foot("hip", "ankle", "foot", "heel", "toe1_tip", "pelvis")
    joints, bones = {joint.name for joint in anatomy.joints}, {bone.name for bone in anatomy.bones}
    has = {foot.hip, foot.ankle} <= joints and {foot.bone, foot.pelvis} <= bones
    return foot if has and {foot.heel, foot.toe} <= set(anatomy.landmark_names) else None


def gait_events(motion: Motion, anatomy: Anatomy) -> GaitEvents:
    """The events of a leg's motion.

    Heel and toe are placed by the tracked ankle and the foot's turn; how far they are from the ankle is the template's.
    """
    foot = foot_of(anatomy)
    if foot is None:
        return GaitEvents((), (), doubt=f"{anatomy.name} has no foot")
    ankle, hip = motion.centres[foot.ankle], motion.centres[foot.hip]
    heel, toe = (_point_of_foot(motion, anatomy, foot, name) for name in (foot.heel, foot.toe))
    forward_axis = motion.transforms[foot.pelvis][:, :3, 0]
    known = np.isfinite(np.concatenate([ankle, hip, heel, toe, forward_axis], axis=1)).all(axis=1)
    rate = 1.0 / float(np.median(np.diff(motion.times)))
    strikes: list[float] = []
    offs: list[float] = []
    whole: list[tuple[float, float, float]] = []
    excursion = 0.0
    for span in unbroken_spans(motion.times, known):
        if span.stop - span.start < least_frames(rate, _CUTOFF_HZ):
            continue
        forward = _forward(forward_axis[span], hip[span] - ankle[span], rate)
        ahead = [
            low_pass(np.einsum("ij,ij->i", (at - hip)[span], forward), rate, min(_CUTOFF_HZ, 0.45 * rate))
            for at in (heel, toe)
        ]
        way = float(np.ptp(ahead[0]))
        excursion = max(excursion, way)
        least = max(_PROMINENT * way, _PROMINENT * _LEAST_STEP_M)
        struck = _turning_points(motion.times[span], ahead[0], least)
        left = _turning_points(motion.times[span], -ahead[1], least)
        strikes, offs, whole = strikes + struck, offs + left, whole + strides(struck, left)
    events = GaitEvents(tuple(strikes), tuple(offs), tuple(whole))
    return replace(events, doubt=_doubt(events, excursion, motion.times, ankle))


def _point_of_foot(motion: Motion, anatomy: Anatomy, foot: Foot, landmark: str) -> Floats:
    """A landmark of the foot over time (T, 3)."""
    centre = np.mean([anatomy.landmarks[anatomy.landmark_index(n)] for n in anatomy.joint(foot.ankle).centre], axis=0)
    arm = anatomy.landmarks[anatomy.landmark_index(landmark)] - centre
    return np.asarray(motion.centres[foot.ankle] + motion.transforms[foot.bone][:, :3, :3] @ arm)


def _forward(axis: Floats, up: Floats, rate: float) -> Floats:
    """Unit vectors (N, 3): the mean pelvis' forward axis (N, 3), square to the mean direction up the leg (N, 3)."""
    width = max(1, int(_MEAN_S * rate))
    axis, up = (uniform_filter1d(vectors, width, axis=0, mode="nearest") for vectors in (axis, up))
    up = up / np.linalg.norm(up, axis=1, keepdims=True)
    level = axis - np.einsum("ij,ij->i", axis, up)[:, None] * up
    return np.asarray(level / np.linalg.norm(level, axis=1, keepdims=True))


def _turning_points(times: Floats, values: Floats, prominence: float) -> list[float]:
    """When values (N,) are largest, between frames by the parabola through three."""
    peaks, _ = find_peaks(values, prominence=prominence)
    before, top, after = values[peaks - 1], values[peaks], values[peaks + 1]
    bend = before - 2.0 * top + after
    shift = np.where(bend < 0.0, 0.5 * (before - after) / np.where(bend < 0.0, bend, 1.0), 0.0)
    return [float(t) for t in np.interp(peaks + shift, np.arange(len(times)), times)]


def _doubt(events: GaitEvents, excursion: float, times: Floats, ankle: Floats) -> str:
    """Why this is no walking, or nothing."""
    if excursion < _LEAST_STEP_M:
        return f"the foot goes {excursion:.2f} m to and fro against the pelvis, less than a step"
    shares = [(off - strike) / (end - strike) for strike, off, end in events.strides]
    if shares and not _STANCE[0] <= (stance := float(np.median(shares))) <= _STANCE[1]:
        return f"the foot goes backward for {100.0 * stance:.0f} % of a stride, which is no walking"
    speed = np.linalg.norm(np.gradient(ankle, times, axis=0), axis=1)
    stands = _standing(times, events.strikes, events.toe_offs)
    slow, fast = (float(np.nanmedian(speed[part])) if part.any() else np.nan for part in (stands, ~stands))
    if slow > _SLOWER * fast:
        return f"the foot is as fast backward as forward ({slow:.1f} and {fast:.1f} m/s), so it does not stand"
    return ""


def strides(strikes: Sequence[float], offs: Sequence[float]) -> list[tuple[float, float, float]]:
    """Heel strike, the one toe-off after it, and the next heel strike (s).

    >>> strides([0.0, 1.0, 3.1], [0.6, 1.6, 2.6])  # between the last two a strike was missed
    [(0.0, 0.6, 1.0)]
    """
    found = []
    for start, end in pairwise(strikes):
        inside = [off for off in offs if start < off < end]
        if len(inside) == 1:
            found.append((start, inside[0], end))
    return found


def _standing(times: Floats, strikes: Sequence[float], offs: Sequence[float]) -> np.ndarray:
    """In which frames (T,) the foot stands: the last event was a strike, or, before all, the next is a toe-off."""
    last = [np.array([-np.inf, *events])[np.searchsorted(events, times, "right")] for events in (strikes, offs)]
    following = [np.array([*events, np.inf])[np.searchsorted(events, times, "right")] for events in (strikes, offs)]
    none_yet = np.isinf(last[0]) & np.isinf(last[1])
    return np.where(none_yet, following[1] < following[0], last[0] > last[1])
