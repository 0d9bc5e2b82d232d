"""Movements cut into cycles on 0 to 100 %, their mean and how they vary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicSpline

from adapt.anatomy import Floats

PERCENT = np.linspace(0.0, 100.0, 101)
"""Where cycles are told: at every hundredth of their time."""


@dataclass(frozen=True)
class Cycle:
    """From ``start`` to ``end`` (s); ``marks`` are events inside by name, each with the share of the cycle it is at.

    ``whole`` is from when to when its least and largest value are looked for, where that is longer: a repetition's
    ends leave a little of its way out.
    """

    start: float
    end: float
    marks: tuple[tuple[str, float], ...] = ()
    whole: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class CycleCurves:
    """One quantity in C whole cycles: (C, 101), and its least and largest value in each (C, 2).

    ``left_out`` are the numbers of cycles with unknown frames in them.
    """

    values: Floats = field(repr=False)
    extremes: Floats = field(repr=False)
    kept: tuple[int, ...]
    left_out: tuple[int, ...]

    @property
    def mean(self) -> Floats:
        """The mean cycle (101,); NaN where there is none."""
        return np.asarray(self.values.mean(axis=0)) if len(self.values) else np.full(len(PERCENT), np.nan)

    @property
    def sd(self) -> Floats:
        """How cycles differ at each percent (101,); NaN of fewer than two."""
        return np.asarray(self.values.std(axis=0, ddof=1)) if len(self.values) > 1 else np.full(len(PERCENT), np.nan)


def cycle_curves(times: Floats, values: Floats, cycles: Sequence[Cycle], spans: Sequence[slice]) -> CycleCurves:
    """Values (T,) of every cycle that lies within one unbroken span.

    >>> t = np.arange(0.0, 4.0, 0.02)
    >>> found = cycle_curves(t, np.sin(np.pi * t), [Cycle(0.0, 2.0), Cycle(2.0, 4.5)], [slice(0, len(t))])
    >>> found.kept, found.left_out, [round(float(v), 3) for v in found.mean[[0, 25, 75]]]
    ((0,), (1,), [0.0, 1.0, -1.0])
    """
    rows = [_row(times, values, cycle, spans) for cycle in cycles]
    kept = [number for number, row in enumerate(rows) if row is not None]
    left_out = tuple(number for number, row in enumerate(rows) if row is None)
    found = np.array([rows[number] for number in kept], dtype=float).reshape(-1, len(PERCENT))
    extremes = [_extremes(times, values, cycles[number], row) for number, row in zip(kept, found, strict=True)]
    return CycleCurves(found, np.array(extremes, dtype=float).reshape(-1, 2), tuple(kept), left_out)


def _extremes(times: Floats, values: Floats, cycle: Cycle, row: Floats) -> tuple[float, float]:
    start, end = cycle.whole or (cycle.start, cycle.end)
    inside = values[(times >= start) & (times <= end)]
    told = np.concatenate([row, inside[np.isfinite(inside)]])
    return float(told.min()), float(told.max())


def _row(times: Floats, values: Floats, cycle: Cycle, spans: Sequence[slice]) -> Floats | None:
    """One cycle (101,), or None where it is not all known."""
    for span in spans:
        at, told = times[span], values[span]
        known = np.isfinite(told)
        if known.sum() > 3 and at[known][0] <= cycle.start and cycle.end <= at[known][-1]:
            instants = cycle.start + PERCENT / 100.0 * (cycle.end - cycle.start)
            return np.asarray(CubicSpline(at[known], told[known])(instants))
    return None
