"""What differs between motions: before and after, left and right, several people.

Motions with one label are one group. A group of one motion is a sample of its cycles, and what is said of it holds for
this person in these recordings; a group of several is a sample of their mean cycles, and what is said of it holds for
people like these. Every group is compared with the first, at each percent of a cycle and in a few numbers, with Welch's
interval for the difference of two means. Where single motions of different subjects are compared, the part of their
deviations that lasts (``track.curves.curve``) does not average out, so it widens the interval; motions of the very same
subject file share it, and it drops out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import t as student_t

from adapt.anatomy import Floats
from adapt.plain_words import PlainWords, without_side
from track.curves.curve import Curve
from track.curves.cycles import PERCENT
from track.curves.motion_curves import CurvesError, MotionCurves
from track.poses_by_hand import UNITS, as_shown

NORMAL = 1.959964
"""Standard deviations of a normal distribution within which 95 % lie."""
_CONFIDENCE = 0.95


@dataclass(frozen=True, eq=False)
class Labelled:
    """The curves of one motion, which group it belongs to, and which subject file it was tracked with, if known."""

    label: str
    curves: MotionCurves
    subject: str | None = None


@dataclass(frozen=True, eq=False)
class Sample:
    """N cycles of one angle in one group (N, 101), deg or m, and the lasting deviation (101,) they all share.

    ``extremes`` (N, 2) are the least and the largest value of each, over the whole movement.
    """

    label: str
    values: Floats = field(repr=False)
    extremes: Floats = field(repr=False)
    lasting: Floats = field(repr=False)
    subjects: frozenset[str | None]
    side: str

    @property
    def mean(self) -> Floats:
        """The mean cycle (101,)."""
        return np.asarray(self.values.mean(axis=0))

    @property
    def sd(self) -> Floats:
        """How cycles differ (101,); NaN of one."""
        return np.asarray(self.values.std(axis=0, ddof=1)) if len(self.values) > 1 else np.full(len(PERCENT), np.nan)


@dataclass(frozen=True, eq=False)
class Difference:
    """A group less the first: the difference of means and its 95 % interval (...), NaN where a group has one cycle."""

    value: Floats = field(repr=False)
    low: Floats = field(repr=False)
    high: Floats = field(repr=False)


@dataclass(frozen=True)
class Number:
    """A number of both groups' cycles and its difference; ``symmetry`` (%) where their sides differ, of ranges."""

    name: str
    unit: str
    first: float
    other: float
    difference: float
    low: float
    high: float
    symmetry: float | None = None


@dataclass(frozen=True, eq=False)
class Compared:
    """One angle in all groups: their samples, and of each but the first its difference and numbers."""

    key: str
    words: PlainWords
    unit: str
    samples: tuple[Sample, ...]
    differences: tuple[Difference, ...]
    numbers: tuple[tuple[Number, ...], ...]


@dataclass(frozen=True, eq=False)
class Comparison:
    """All angles that the groups have in common; ``told`` are lines for people."""

    labels: tuple[str, ...]
    kind: str
    angles: tuple[Compared, ...]
    told: tuple[str, ...]


def compare(motions: Sequence[Labelled]) -> Comparison:
    """Compare groups of motions, each with the first.

    Raises:
        CurvesError: fewer than two groups, no angle in common, no whole cycle, or cycles of different kinds or angles.
    """
    groups = _groups(motions)
    kinds = {one.curves.kind for one in motions}
    if len(groups) < 2:
        raise CurvesError("there is one group only", remedy="name two motions or more, or give them different labels")
    if len(kinds) > 1:
        problem = f"cycles are of different kinds: {', '.join(sorted(kinds))}"
        raise CurvesError(problem, remedy="give --events gait or --events repetitions")
    movements = {without_side(one.curves.by) for one in motions if one.curves.kind == "repetition"}
    if len(movements) > 1:
        problem = f"repetitions are of different angles: {', '.join(sorted(movements))}"
        raise CurvesError(problem, remedy="give --by with one of them")
    shared = [name for name in _curves(motions[0]) if all(name in _curves(one) for one in motions)]
    if not shared:
        raise CurvesError("the motions have no angle in common", remedy="compare motions of one kind of limb")
    told = [f"{label}: {line}" for label, group in groups.items() for one in group for line in one.curves.told]
    angles = [angle for name in shared if (angle := _compared(name, groups, told)) is not None]
    if not angles:
        raise CurvesError("no angle has a whole cycle in every group", remedy="see `bonetrack curves` of each motion")
    return Comparison(tuple(groups), kinds.pop(), tuple(angles), tuple(dict.fromkeys(told)))


def _groups(motions: Sequence[Labelled]) -> dict[str, list[Labelled]]:
    groups: dict[str, list[Labelled]] = {}
    for one in motions:
        groups.setdefault(one.label, []).append(one)
    return groups


def _curves(one: Labelled) -> dict[str, Curve]:
    return {without_side(name): curve for name, curve in one.curves.curves.items()}


def _compared(name: str, groups: Mapping[str, Sequence[Labelled]], told: list[str]) -> Compared | None:
    curve = _curves(next(iter(groups.values()))[0])[name]
    samples = [_sample(name, label, group) for label, group in groups.items()]
    if empty := [sample.label for sample in samples if not len(sample.values)]:
        told.append(f"{curve.words.name} is left out: no whole cycle in {', '.join(empty)}")
        return None
    for sample in samples:
        if len(sample.values) == 1:
            told.append(f"{sample.label} is one cycle, so differences from it have no interval")
    first, *others = samples
    unit = UNITS[curve.coordinate.unit]
    numbers = tuple(_numbers(first, other, unit) for other in others)
    differences = tuple(difference(first, other) for other in others)
    return Compared(name, curve.words, unit, tuple(samples), differences, numbers)


def _sample(name: str, label: str, group: Sequence[Labelled]) -> Sample:
    """The cycles of a group's only motion, or the mean cycles of its motions."""
    cycles, extremes, lasting = [], [], []
    for one in group:
        curve = _curves(one)[name]
        factor = as_shown(curve.coordinate, 1.0)
        found = one.curves.cycle_curves(curve.coordinate.name, "angle")
        if len(found.values):
            alone = len(group) == 1
            cycles.append(factor * (found.values if alone else found.mean[None]))
            extremes.append(factor * (found.extremes if alone else found.extremes.mean(axis=0)[None]))
            lasting.append(factor * one.curves.lasting_cycle(curve.coordinate.name))
    values = np.concatenate(cycles) if cycles else np.zeros((0, len(PERCENT)))
    sides = {one.curves.anatomy.side for one in group}
    return Sample(
        label,
        values,
        np.concatenate(extremes) if extremes else np.zeros((0, 2)),
        lasting[0] if len(group) == 1 and lasting else np.zeros(len(PERCENT)),
        frozenset(one.subject for one in group),
        sides.pop() if len(sides) == 1 else "both",
    )


def difference(first: Sample, other: Sample) -> Difference:
    """The other group's mean cycle less the first's, with its interval.

    >>> level, sure = np.ones(101), np.zeros(101)
    >>> rest = np.zeros((2, 2)), sure, frozenset({"s"}), "right"
    >>> a = Sample("before", np.stack([9 * level, 11 * level]), *rest)
    >>> b = Sample("after", np.stack([14 * level, 16 * level]), *rest)
    >>> found = difference(a, b)
    >>> [round(float(part[0]), 2) for part in (found.value, found.low, found.high)]
    [5.0, -1.08, 11.08]
    """
    return _welch(first.values, other.values, _not_shared(first, other, first.lasting, other.lasting))


def _not_shared(first: Sample, other: Sample, a: Floats, b: Floats) -> Floats:
    """The lasting deviation of a difference: none where both groups are of one known subject file."""
    same = len(first.subjects | other.subjects) == 1 and None not in first.subjects
    return np.abs(a - b) if same else np.hypot(a, b)


def _welch(first: Floats, other: Floats, lasting: Floats) -> Difference:
    """The difference of means of samples (N, ...) and (M, ...) and its interval, widened by a lasting deviation."""
    value = np.asarray(other.mean(axis=0) - first.mean(axis=0))
    if min(len(first), len(other)) < 2:
        unknown = np.full(value.shape, np.nan)
        return Difference(value, unknown, unknown)
    parts = [sample.var(axis=0, ddof=1) / len(sample) for sample in (first, other)]
    squares = sum(part**2 / (len(sample) - 1) for part, sample in zip(parts, (first, other), strict=True))
    error = parts[0] + parts[1]
    freedom = np.where(squares > 0.0, error**2 / np.where(squares > 0.0, squares, 1.0), 1.0)
    quantile = student_t.ppf(0.5 + 0.5 * _CONFIDENCE, freedom)
    half = np.hypot(quantile * np.sqrt(error), NORMAL * lasting)
    return Difference(value, value - half, value + half)


_NUMBERS: dict[str, Callable[[Floats], Floats]] = {
    "least": lambda extremes: extremes[:, 0],
    "largest": lambda extremes: extremes[:, 1],
    "range": lambda extremes: np.ptp(extremes, axis=1),
}


def _numbers(first: Sample, other: Sample, unit: str) -> tuple[Number, ...]:
    """Least and largest value and range of the cycles of both; a range has no lasting error: both its ends have it."""
    found = []
    for name, of in _NUMBERS.items():
        lasting = np.zeros(()) if name == "range" else _not_shared(first, other, *_largest(first, other))
        a, b = of(first.extremes), of(other.extremes)
        told = _welch(a, b, lasting)
        mean_a, mean_b = float(a.mean()), float(b.mean())
        sides = {first.side, other.side} == {"right", "left"}
        symmetry = 200.0 * (mean_b - mean_a) / (mean_a + mean_b) if sides and name == "range" else None
        ends = (float(told.value), float(told.low), float(told.high))
        found.append(Number(name, unit, mean_a, mean_b, *ends, symmetry))
    return tuple(found)


def _largest(first: Sample, other: Sample) -> tuple[Floats, Floats]:
    return np.asarray(first.lasting.max()), np.asarray(other.lasting.max())
