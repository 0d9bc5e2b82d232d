"""One coordinate over time, smoothed, with its speed and acceleration and how sure they are.

A curve is smoothed span by span: nothing is carried over frames where the angle is not known. What is stated of it is

    SD^2 = (s G)^2 + B^2 + D^2

- **Noise.** s is the noise of a single frame, from the residual analysis, and G what smoothing leaves of it
  (``low_pass.noise_gain``).
- **What lasts.** The rest of what tracking states, sqrt(SD^2 - s^2), is the same error in all frames: of the body, not
  of the sensors (docs/uncertainty.md). B is what smoothing leaves of it: in the angle it stays whole, in speed and
  acceleration it counts by how its size changes over time.
- **What smoothing took away.** D is the movement between the cut-off and twice the cut-off, root mean square over the
  time 1 / cutoff to either side, without the noise that is expected there.

Near the ends of a span a filter only guesses how the movement came in: speeds nearer than half of 1 / cutoff and
accelerations nearer than 1 / cutoff are not known.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import uniform_filter1d

from adapt.anatomy import Coordinate, Floats
from adapt.plain_words import PlainWords, plain_words
from track.curves.low_pass import difference_gain, least_frames, noise_gain, smooth, stacked
from track.curves.residuals import residual_analysis

USUAL_HZ = 6.0
"""The cut-off where a curve is too short for residual analysis."""
_HIGHEST = 0.45  # of the rate: a cut-off above it is none
_UNKNOWN_ENDS = (0.0, 0.5, 1.0)  # of 1 / cutoff: angle, speed, acceleration


@dataclass(frozen=True, eq=False)
class Quantity:
    """Values (T,) over time with their standard deviations, and the part of these that is the same error throughout.

    NaN where not known.
    """

    value: Floats = field(repr=False)
    sd: Floats = field(repr=False)
    lasting: Floats = field(repr=False)


@dataclass(frozen=True, eq=False)
class Curve:
    """A coordinate over time (rad or m; / s; / s^2). ``raw`` are the values (T,) as tracked, NaN where not known.

    ``noise`` is that of a single frame. ``chosen`` says where the cut-off comes from, ``has_floor`` whether above it
    there is noise alone.
    """

    coordinate: Coordinate
    raw: Floats = field(repr=False)
    angle: Quantity = field(repr=False)
    velocity: Quantity = field(repr=False)
    acceleration: Quantity = field(repr=False)
    spans: tuple[slice, ...]
    cutoff_hz: float
    noise: float
    chosen: str
    has_floor: bool

    @property
    def words(self) -> PlainWords:
        """What people call the coordinate."""
        return plain_words(self.coordinate.name)


def unbroken_spans(times: Floats, known: np.ndarray) -> list[slice]:
    """The longest runs of frames (T,) that are known and follow each other without a frame missing between them.

    >>> times = np.array([0.0, 0.1, 0.2, 0.3, 0.6, 0.7])
    >>> unbroken_spans(times, np.array([True, True, False, True, True, True]))
    [slice(0, 2, None), slice(3, 4, None), slice(4, 6, None)]
    """
    frames = np.flatnonzero(known)
    longest = 1.5 * float(np.median(np.diff(times))) if len(times) > 1 else np.inf
    broken = (np.diff(frames) > 1) | (np.diff(times[frames]) > longest)
    parts = np.split(frames, np.flatnonzero(broken) + 1)
    return [slice(int(part[0]), int(part[-1]) + 1) for part in parts if len(part)]


def smoothed_curve(
    coordinate: Coordinate,
    times: Floats,
    raw: Floats,
    stated: Floats,
    *,
    cutoff_hz: float | None = None,
) -> Curve:
    """The curve of a coordinate's values (T,) with their stated deviations (T,); NaN values are not known.

    Without ``cutoff_hz`` residual analysis chooses. Spans too short to be smoothed stay unknown.
    """
    rate = 1.0 / float(np.median(np.diff(times)))
    spans = unbroken_spans(times, np.isfinite(raw))
    even = [_evenly(times[span], raw[span]) for span in spans]
    found = residual_analysis(even, rate)
    noise = float(np.nanmedian(stated)) if found is None else found.noise
    chosen = "given" if cutoff_hz else "residual analysis" if found else "usual: too short for residual analysis"
    cutoff = min(cutoff_hz or (found.cutoff if found else USUAL_HZ), _HIGHEST * rate)
    long = [k for k, span in enumerate(spans) if span.stop - span.start >= least_frames(rate, cutoff)]
    values, deviations, lasting = (np.full((3, len(times)), np.nan) for _ in range(3))
    for k in long:
        at, span = times[spans[k]], spans[k]
        body = np.sqrt(np.maximum(_evenly(at, stated[span]) ** 2 - noise**2, 0.0))
        told = _smoothed_span(even[k], body, rate, cutoff, noise)
        for whole, part in zip((values, deviations, lasting), told, strict=True):
            whole[:, span] = _back(at, part)
    angle, velocity, acceleration = (Quantity(values[k], deviations[k], lasting[k]) for k in range(3))
    floor = found is not None and found.has_floor
    kept = tuple(spans[k] for k in long)
    return Curve(coordinate, raw, angle, velocity, acceleration, kept, cutoff, noise, chosen, floor)


def least_span(times: Floats, cutoff_hz: float | None) -> int:
    """How many frames that follow each other a motion with these times (T,) must have to be smoothed.

    >>> least_span(np.arange(30) / 30.0, 6.0), least_span(np.arange(30) / 30.0, 2.0)
    (10, 30)
    """
    return least_frames(1.0 / float(np.median(np.diff(times))), cutoff_hz or USUAL_HZ)


def _smoothed_span(
    even: Floats, body: Floats, rate: float, cutoff: float, noise: float
) -> tuple[Floats, Floats, Floats]:
    """Values, deviations and lasting deviations (3, N) of one span at even instants."""
    count, twice = len(even), min(2.0 * cutoff, 0.98 * 0.5 * rate)
    value = stacked(smooth(even, rate, cutoff))
    missing = (stacked(smooth(even, rate, twice)) - value) ** 2
    missing -= (noise * difference_gain(count, rate, cutoff, twice)) ** 2
    width = 2 * int(rate / cutoff) + 1
    taken = np.maximum(uniform_filter1d(missing, width, axis=1, mode="nearest"), 0.0)
    lasting = np.abs(stacked(smooth(body, rate, cutoff)))
    deviation = np.sqrt((noise * noise_gain(count, rate, cutoff)) ** 2 + lasting**2 + taken)
    for k, ends in enumerate(_UNKNOWN_ENDS):
        cut = int(np.ceil(ends * rate / cutoff))
        near_end = np.minimum(np.arange(count), np.arange(count)[::-1]) < cut
        for part in (value, deviation, lasting):
            part[k, near_end] = np.nan
    return value, deviation, lasting


def _evenly(times: Floats, values: Floats) -> Floats:
    """Values (N,) at N even instants from the first time to the last."""
    return values if len(values) < 2 else np.interp(np.linspace(times[0], times[-1], len(times)), times, values)


def _back(times: Floats, even: Floats) -> Floats:
    """Rows of even values (3, N) at the times themselves."""
    instants = np.linspace(times[0], times[-1], len(times))
    return np.stack([np.interp(times, instants, row) for row in even])
