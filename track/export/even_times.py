"""Formats that know a rate and no times: a motion at even times, with what lies in a gap as unknown."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from adapt.anatomy import Floats, Ints
from track.observed_bones import Bools

_AS_IT_IS_S = 1e-3  # a frame that is no farther from an even time stands for it
_GAP = 1.5  # of the usual step: between frames farther apart nothing is known


@dataclass(frozen=True, eq=False)
class EvenTimes:
    """N times (s) at a rate, each ``share`` of the way from frame ``before`` to the next; ``moved`` are between two."""

    rate_hz: float
    times: Floats
    before: Ints = field(repr=False)  # (N,)
    share: Floats = field(repr=False)  # (N,) in [0, 1]
    inside: Bools = field(repr=False)  # (N,) not in a gap of the recording

    @property
    def moved(self) -> int:
        """How many times fall between two frames, so that their values are between theirs."""
        return int((self.inside & (self.share > 0.0)).sum())

    def at(self, values: Floats) -> Floats:
        """Values (T, ...) of the frames at the even times (N, ...), linearly between two; NaN where not known."""
        after = np.minimum(self.before + 1, len(values) - 1)
        share = self.share.reshape(-1, *[1] * (values.ndim - 1))
        between = np.where(share > 0.0, values[self.before] + share * (values[after] - values[self.before]), np.nan)
        even = np.where(share > 0.0, between, values[self.before])
        even[~self.inside] = np.nan
        return np.asarray(even)


def even_times(times: Floats) -> EvenTimes:
    """Even times over frames' times (T,) s, which go up, at the mean rate of those that follow each other.

    >>> even = even_times(np.array([0.0, 0.1, 0.15, 0.3, 0.6]))  # one frame early, two missing
    >>> round(even.rate_hz, 3), even.moved
    (10.0, 1)
    >>> even.at(np.array([0.0, 1.0, 1.5, 3.0, 6.0])).round(6).tolist()
    [0.0, 1.0, 2.0, 3.0, nan, nan, 6.0]
    """
    if len(times) < 2:
        return EvenTimes(1.0, times, np.zeros(len(times), dtype=int), np.zeros(len(times)), np.ones(len(times), bool))
    steps = np.diff(times)
    longest = _GAP * float(np.median(steps))
    step = float(steps[steps <= longest].mean())
    even = times[0] + step * np.arange(int((times[-1] - times[0] + _AS_IT_IS_S) / step) + 1)
    before = np.clip(np.searchsorted(times, even, side="right") - 1, 0, len(times) - 2)
    share = np.clip((even - times[before]) / steps[before], 0.0, 1.0)
    nearest = before + (share > 0.5)
    as_it_is = np.abs(times[nearest] - even) <= _AS_IT_IS_S
    inside = as_it_is | (steps[before] <= longest)
    return EvenTimes(
        1.0 / step, even, np.where(as_it_is, nearest, before), np.where(as_it_is, 0.0, share), np.asarray(inside)
    )
