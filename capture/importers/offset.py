"""How two sensors' clocks differ, from the motion that both see.

A person moves faster and slower, and every sensor that sees them sees when. Each sensor's depth gives one number per
frame, how much of what it sees moves how fast; the two courses are shifted until they agree best (the largest
normalised cross-correlation), and how sharp that agreement is tells how far the shift can be trusted.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import correlate

from capture.errors import RecordingError
from capture.importers.source import DepthFrame, Source
from capture.recording import Sensor
from capture.rigid import Floats

STEP_S = 0.01
"""The courses are compared at this step; the best shift is found between steps."""

_BLOCKS = 80
"""Depth is averaged over square blocks, about this many in a row, which takes most of the noise away."""

_SPAN_S = 0.15
"""Images this far apart are compared, so that slow motion stands out of the noise, too."""

_LEAST_CHANGE_M, _LARGEST_CHANGE_M = 0.005, 0.03
"""Changes of depth count from the noise on. Where a limb's edge passes, depth jumps, or comes or goes: that counts as
much as a change of some centimetres, so that motion across the view weighs about what motion along it does."""

_SHORTEST_OVERLAP_S = 4.0
_LEAST_SIGNIFICANCE = 5.0
_LARGEST_SECOND_PEAK = 0.85
_PEAK_WIDTH_S = 0.4
_PIECES = 10
_LARGEST_DEVIATION_S = 0.05
_VIEW_DEVIATION_S = 0.004
"""Sensors that stand apart see different parts of a motion; what that adds was measured (tests/measure_offset.py)."""


@dataclass(frozen=True, eq=False)
class MotionSignal:
    """How much moves, over time: times (N,) (s, 0 at the first depth frame) and amounts (N,) (square root of m/s)."""

    times_s: Floats
    amounts: Floats


@dataclass(frozen=True)
class Offset:
    """By how much the second sensor's first frame comes after the first's (s), one standard deviation, correlation."""

    seconds: float
    deviation_s: float
    correlation: float


def motion_of(source: Source) -> MotionSignal:
    """The motion that one sensor sees; reads all its frames.

    Raises:
        RecordingError: what the reader finds wrong.
    """
    side = max(1, source.sensor.camera.width // _BLOCKS)
    times: list[float] = []
    amounts: list[float] = []
    recent: deque[tuple[float, Floats]] = deque()
    start_s: float | None = None
    for frame in source.frames:
        if not isinstance(frame, DepthFrame):
            continue
        start_s = frame.time_s if start_s is None else start_s
        now = _blocks(frame.readings, side, source.sensor)
        # The latest image that is the span or more ago; those before it are not needed any more.
        while len(recent) > 1 and frame.time_s - recent[1][0] >= _SPAN_S:
            recent.popleft()
        if recent and frame.time_s - recent[0][0] >= _SPAN_S:
            before_s, before = recent[0]
            times.append(0.5 * (frame.time_s + before_s) - start_s)
            amounts.append(math.sqrt(_change(before, now) / (frame.time_s - before_s)))
        recent.append((frame.time_s, now))
    return MotionSignal(np.array(times), np.array(amounts))


def _blocks(readings: NDArray[np.uint16], side: int, sensor: Sensor) -> Floats:
    """Mean depth (m) of square blocks, NaN where less than half of one has depth."""
    rows, columns = (length // side for length in readings.shape)
    depth = readings[: rows * side, : columns * side] * np.float32(sensor.depth_unit_m)
    nearest, farthest = sensor.depth_range_m
    seen = ((depth > nearest) & (depth < farthest)).reshape(rows, side, columns, side)
    total = np.where(seen, depth.reshape(seen.shape), 0.0).sum(axis=(1, 3))
    count = seen.sum(axis=(1, 3))
    return np.where(2 * count >= side * side, total / np.maximum(count, 1), np.nan)


def _change(before: Floats, now: Floats) -> float:
    """The mean change of depth (m) over the blocks of the image; depth that comes or goes is the largest change."""
    seen_before, seen_now = np.isfinite(before), np.isfinite(now)
    both = seen_before & seen_now
    change = np.abs(now[both] - before[both])
    noise = _LEAST_CHANGE_M * np.maximum(1.0, now[both]) ** 2
    moved = float(np.where(change > noise, np.minimum(change, _LARGEST_CHANGE_M), 0.0).sum())
    return (moved + _LARGEST_CHANGE_M * np.count_nonzero(seen_before != seen_now)) / now.size


def estimate_offset(first: MotionSignal, second: MotionSignal, *, where: str | Path) -> Offset:
    """The offset at which two courses of motion agree best.

    The standard deviation is the jackknife's: the course is cut into pieces, and the best shift is found again with
    each piece left out.

    >>> times = np.arange(0.0, 20.0, 1.0 / 30.0)
    >>> def moved(at_s):
    ...     return np.abs(np.sin(1.1 * at_s) + np.sin(2.7 * at_s) * np.sin(0.4 * at_s))
    >>> first, second = MotionSignal(times, moved(times)), MotionSignal(times, moved(times + 0.5))
    >>> found = estimate_offset(first, second, where=Path("b.oni"))
    >>> round(found.seconds, 2)  # the second began half a second later: it shows earlier what both see
    0.5

    Raises:
        RecordingError: too short, nothing moves, or no shift stands out.
    """
    a, b = _resampled(first), _resampled(second)
    shortest = round(_SHORTEST_OVERLAP_S / STEP_S)
    if min(len(a), len(b)) < shortest:
        raise _refused("is shorter than 4 s, or nothing moves in it", where)
    lags, agreement = _correlation(a, b, shortest)
    best = int(np.argmax(agreement))
    significance = _significance(a, b, int(lags[best]), float(agreement[best]))
    if not significance >= _LEAST_SIGNIFICANCE:
        raise _refused(
            f"shows too little motion that fits the other's (correlation {agreement[best]:.2f}, "
            f"{max(significance, 0.0):.1f} deviations from chance)",
            where,
        )
    away = np.abs(lags - lags[best]) * STEP_S > _PEAK_WIDTH_S
    if away.any() and agreement[away].max() > _LARGEST_SECOND_PEAK * agreement[best]:
        other = lags[away][np.argmax(agreement[away])] * STEP_S
        raise _refused(f"shows motion that fits at {lags[best] * STEP_S:.2f} s and at {other:.2f} s alike", where)
    found = _refined(a, b, int(lags[best]), np.ones(len(a), dtype=bool))
    pieces = np.array_split(np.arange(len(a)), _PIECES)
    left_out = np.array([_refined(a, b, int(lags[best]), ~np.isin(np.arange(len(a)), piece)) for piece in pieces])
    deviation = math.sqrt((_PIECES - 1) / _PIECES * float(((left_out - left_out.mean()) ** 2).sum())) * STEP_S
    if not deviation <= _LARGEST_DEVIATION_S:
        raise _refused(f"fits the other's motion only to within {deviation:.2f} s", where)
    return Offset(float(found * STEP_S), math.hypot(deviation, _VIEW_DEVIATION_S), float(agreement[best]))


def _significance(a: Floats, b: Floats, lag: int, correlation: float) -> float:
    """How far a correlation is from chance, in standard deviations (Fisher's transformation).

    Neighbouring samples tell the same, so what overlaps counts as fewer: Bartlett's formula, n / sum of the products
    of the two autocorrelations.
    """
    begin, end = max(lag, 0), min(len(a), len(b) + lag)
    x, y = a[begin:end], b[begin - lag : end - lag]
    products = _autocorrelation(x) * _autocorrelation(y)
    independent = len(x) / max(1.0, 1.0 + 2.0 * float(products[1:].sum()))
    return math.atanh(min(max(correlation, -0.999999), 0.999999)) * math.sqrt(max(independent - 3.0, 0.0))


def _autocorrelation(x: Floats) -> Floats:
    """Autocorrelation at lags 0 to a quarter of the length, the lags at which it can be told."""
    x = x - x.mean()
    full = correlate(x, x, mode="full", method="fft")[len(x) - 1 :]
    return np.asarray(full[: len(x) // 4] / full[0]) if full[0] > 0.0 else np.ones(1)


def _refused(problem: str, where: str | Path) -> RecordingError:
    return RecordingError(problem, where=where, remedy="give the time between the sensors' first frames with --offset")


def _resampled(motion: MotionSignal) -> Floats:
    """Amounts at every step from time 0 on; empty if nothing moves."""
    if len(motion.times_s) < 2 or np.ptp(motion.amounts) == 0.0:
        return np.zeros(0)
    steps = np.arange(0.0, min(motion.times_s[-1], 1e5 * STEP_S * 10.0), STEP_S)
    return np.interp(steps, motion.times_s, motion.amounts)


def _correlation(a: Floats, b: Floats, shortest: int) -> tuple[NDArray[np.int64], Floats]:
    """Lags (steps; b's sample j falls on a's sample j + lag) and the normalised correlation of what overlaps."""
    lags = np.arange(-(len(b) - 1), len(a))
    begin, end = np.maximum(lags, 0), np.minimum(len(a), len(b) + lags)
    count = (end - begin).astype(np.float64)

    def sums(values: Floats, low: NDArray[np.int64], high: NDArray[np.int64]) -> Floats:
        total = np.concatenate([[0.0], np.cumsum(values)])
        return np.asarray(total[high] - total[low])

    a, b = a - a.mean(), b - b.mean()
    of_a, of_b = sums(a, begin, end), sums(b, begin - lags, end - lags)
    spread_a = sums(a * a, begin, end) - of_a**2 / count
    spread_b = sums(b * b, begin - lags, end - lags) - of_b**2 / count
    together = correlate(a, b, mode="full", method="fft") - of_a * of_b / count
    # An overlap in which one sensor sees next to no motion would agree with anything.
    enough = np.minimum(spread_a / a.var() / len(a), spread_b / b.var() / len(b)) > 0.2
    least = max(shortest, min(len(a), len(b)) // 2)
    kept = enough & (count >= least)
    if not kept.any():
        return lags[:1], np.array([-1.0])
    return lags[kept], together[kept] / np.sqrt(spread_a[kept] * spread_b[kept])


def _refined(a: Floats, b: Floats, near: int, used: NDArray[np.bool_]) -> float:
    """The best lag (steps) close to ``near``, between steps by a parabola, from the samples of ``a`` that are used."""
    reach = round(_PEAK_WIDTH_S / STEP_S)
    lags = np.arange(near - reach, near + reach + 1)
    values = np.array([_agreement(a, b, int(lag), used) for lag in lags])
    best = min(max(int(np.argmax(values)), 1), len(values) - 2)
    before, at, after = values[best - 1 : best + 2]
    bend = before - 2.0 * at + after
    return float(lags[best]) + (0.5 * (before - after) / bend if bend < 0.0 else 0.0)


def _agreement(a: Floats, b: Floats, lag: int, used: NDArray[np.bool_]) -> float:
    begin, end = max(lag, 0), min(len(a), len(b) + lag)
    kept = used[begin:end]
    x, y = a[begin:end][kept], b[begin - lag : end - lag][kept]
    if len(x) < 2 or x.std() == 0.0 or y.std() == 0.0:
        return -1.0
    return float(np.corrcoef(x, y)[0, 1])
