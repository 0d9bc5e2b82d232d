"""Repetitions of any movement: there and back, told by one angle.

A repetition leads from where the movement begins to its far end and back. It starts when a tenth of the way is done
and ends when a tenth is left, so that pauses between repetitions are none of them. Where it begins, low or high, is
where the angle is in the beginning: one bends an arm that hangs, and gets up from a chair with bent knees.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.signal import find_peaks

from adapt.anatomy import Floats

_HALF = 0.5  # of the whole range, a repetition must go there and back
_STARTED = 0.1  # of its own way
_BEGINNING = 0.05  # of the frames


@dataclass(frozen=True)
class Repetition:
    """When it starts, is at its far end, and is back (s); ``whole`` is from the rest before it to the rest after it."""

    start: float
    turn: float
    end: float
    whole: tuple[float, float]


def repetitions(times: Floats, values: Floats, spans: tuple[slice, ...]) -> tuple[Repetition, ...]:
    """The repetitions of an angle (T,) in each of its unbroken spans; one that a gap cuts short is none.

    >>> t = np.linspace(0.0, 9.0, 451)
    >>> found = repetitions(t, 1.0 - np.cos(2.0 * np.pi * t / 3.0), (slice(0, 451),))
    >>> [(round(one.start, 1), round(one.turn, 1), round(one.end, 1)) for one in found]
    [(0.3, 1.5, 2.7), (3.3, 4.5, 5.7), (6.3, 7.5, 8.7)]
    """
    known = np.concatenate([values[span] for span in spans]) if spans else np.zeros(0)
    if not len(known):
        return ()
    low, high = np.percentile(known, [2.0, 98.0])
    beginning = float(np.median(known[: max(1, int(_BEGINNING * len(known)))]))
    out = values if beginning < 0.5 * (low + high) else -values
    found: list[Repetition] = []
    for span in spans:
        found += _in_span(times[span], out[span], _HALF * float(high - low))
    return tuple(found)


def _in_span(times: Floats, out: Floats, least: float) -> list[Repetition]:
    """The repetitions of an unbroken curve (N,) that goes up and comes back by ``least``."""
    if least <= 0.0:
        return []
    peaks, _ = find_peaks(out, prominence=least)
    edges = [0, *(int(a + np.argmin(out[a:b])) for a, b in pairwise(peaks)), len(out) - 1]
    found = []
    for peak, before, after in zip(peaks, edges, edges[1:], strict=False):
        rise, fall = out[before : peak + 1], out[peak : after + 1]
        start = _crossing(times[before : peak + 1][::-1], rise[::-1], rise.min() + _STARTED * np.ptp(rise))
        end = _crossing(times[peak : after + 1], fall, fall.min() + _STARTED * np.ptp(fall))
        found.append(Repetition(start, float(times[peak]), end, (float(times[before]), float(times[after]))))
    return found


def _crossing(times: Floats, values: Floats, level: float) -> float:
    """When values that start above a level first come down to it."""
    k = int(np.argmax(values <= level))
    return float(np.interp(level, [values[k], values[k - 1]], [times[k], times[k - 1]]))
