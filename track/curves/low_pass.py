"""A low-pass filter without phase, its derivatives, and what noise they let through.

A Butterworth filter of second order runs over the values forward and backward, which shifts nothing in time and makes
it one of fourth order. Both passes together have the amplitude

    A(f) = 1 / (1 + (w / w_d)^4),     w = tan(pi f / rate),     w_d = tan(pi cutoff / rate) / (sqrt(2) - 1)^(1/4),

so that what changes at the cut-off keeps 1 / sqrt(2) of its size (Winter 2009, *Biomechanics and Motor Control of
Human Movement*, section 3.4.4.2). Speed and acceleration are central differences of the smoothed values. All three
are linear in the values: they let through noise by the root sum of squares of the rows of a matrix, which
``noise_gain`` works out by smoothing unit impulses.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from scipy.signal import butter, sosfiltfilt

from adapt.anatomy import Floats

_BOTH_PASSES = (np.sqrt(2.0) - 1.0) ** 0.25
_REACH = 3.0  # of 1 / cutoff: farther away an impulse changes less than 1e-3 of its size


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Smoothed values (N, ...), their speed (1 / s) and their acceleration (1 / s^2)."""

    value: Floats = field(repr=False)
    velocity: Floats = field(repr=False)
    acceleration: Floats = field(repr=False)


def smooth(values: Floats, rate: float, cutoff: float) -> Smoothed:
    """Values (N, ...) at N even instants, ``rate`` (Hz) of them a second, without what changes faster than ``cutoff``.

    >>> t = np.arange(200) / 50.0
    >>> slow = smooth(np.sin(2.0 * np.pi * t), rate=50.0, cutoff=8.0)
    >>> bool(abs(slow.value[50] - np.sin(2.0 * np.pi * t[50])) < 1e-3), round(float(slow.velocity[50]), 1)
    (True, 6.3)
    """
    value = low_pass(values, rate, cutoff)
    velocity = np.gradient(value, 1.0 / rate, axis=0, edge_order=2)
    return Smoothed(value, velocity, np.gradient(velocity, 1.0 / rate, axis=0, edge_order=2))


def low_pass(values: Floats, rate: float, cutoff: float) -> Floats:
    """Values (N, ...) without what changes faster than ``cutoff`` (Hz), not shifted in time."""
    design = rate / np.pi * np.arctan(np.tan(np.pi * cutoff / rate) / _BOTH_PASSES)
    padding = min(len(values) - 1, int(np.ceil(1.5 * rate / cutoff)))
    return np.asarray(sosfiltfilt(butter(2, design, fs=rate, output="sos"), values, axis=0, padlen=padding))


def least_frames(rate: float, cutoff: float) -> int:
    """How many frames a span needs, so that more of it is known than lies at its ends.

    >>> least_frames(30.0, 6.0), least_frames(50.0, 2.0)
    (10, 50)
    """
    return max(8, int(np.ceil(2.0 * rate / cutoff - 1e-6)))


@lru_cache(maxsize=256)
def noise_gain(count: int, rate: float, cutoff: float) -> Floats:
    """How much of white noise is left (3, N) in the smoothed values, their speeds (1 / s) and accelerations (1 / s^2).

    >>> gain = noise_gain(300, 30.0, 6.0)
    >>> [float(gain[0, k].round(2)) for k in (0, 150, 299)]  # the ends are told by fewer frames
    [1.0, 0.63, 1.0]
    """
    return _row_sizes(count, rate, cutoff, lambda impulses: stacked(smooth(impulses, rate, cutoff)))


@lru_cache(maxsize=256)
def difference_gain(count: int, rate: float, cutoff: float, higher: float) -> Floats:
    """How much of white noise is left (3, N) in what smoothing at a higher cut-off keeps and at this one does not."""
    return _row_sizes(
        count, rate, cutoff, lambda one: stacked(smooth(one, rate, higher)) - stacked(smooth(one, rate, cutoff))
    )


def stacked(smoothed: Smoothed) -> Floats:
    """Values, speeds and accelerations as one array (3, N, ...)."""
    return np.stack([smoothed.value, smoothed.velocity, smoothed.acceleration])


def _row_sizes(count: int, rate: float, cutoff: float, of: Callable[[Floats], Floats]) -> Floats:
    """Root sums of squares (3, N) of the rows of a linear map, from its answer (3, M, M) to M unit impulses.

    Away from the ends of a long span all rows are alike, so the middle one of a shorter span stands for them.
    """
    window = 2 * int(np.ceil(_REACH * rate / cutoff)) + 1
    near = min(count, window)
    rows = np.linalg.norm(of(np.eye(near)), axis=2)
    if count <= window:
        return np.asarray(rows)
    half = near // 2
    between = np.repeat(rows[:, half : half + 1], count - 2 * half, axis=1)
    return np.concatenate([rows[:, :half], between, rows[:, -half:]], axis=1)


def residual_share(rate: float, cutoff: float) -> float:
    """The share of white noise's variance that the filter takes away: the mean of (1 - A(f))^2 over all frequencies."""
    half = np.pi * (np.arange(2000) + 0.5) / 4000.0
    w_d = np.tan(np.pi * cutoff / rate) / _BOTH_PASSES
    kept = 1.0 / (1.0 + (np.tan(half) / w_d) ** 4)
    return float(np.mean((1.0 - kept) ** 2))
