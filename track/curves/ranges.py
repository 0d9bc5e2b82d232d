"""How far an angle moves, and how sure that is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adapt.anatomy import Floats
from track.curves.curve import Curve, Quantity


@dataclass(frozen=True)
class Extreme:
    """A least or largest value (rad or m), its standard deviation, and when it is reached (s)."""

    value: float
    sd: float
    time: float


@dataclass(frozen=True)
class Range:
    """The least and the largest value of a curve and how far apart they are, with its standard deviation.

    An error that lasts moves both ends alike: of it only counts by how much its size differs between them.
    """

    low: Extreme
    high: Extreme
    span: float
    span_sd: float


def range_of(curve: Curve, times: Floats) -> Range | None:
    """The range of a curve's smoothed angle; None where it is not known at all."""
    angle = curve.angle
    if not np.isfinite(angle.value).any():
        return None
    low, high = int(np.nanargmin(angle.value)), int(np.nanargmax(angle.value))
    passing = sum(angle.sd[k] ** 2 - angle.lasting[k] ** 2 for k in (low, high))
    span_sd = float(np.sqrt(passing + (angle.lasting[high] - angle.lasting[low]) ** 2))
    ends = [Extreme(float(angle.value[k]), float(angle.sd[k]), float(times[k])) for k in (low, high)]
    return Range(ends[0], ends[1], ends[1].value - ends[0].value, span_sd)


def peak(quantity: Quantity, times: Floats) -> Extreme | None:
    """The largest size of a speed or an acceleration, with its sign; None where it is not known at all."""
    if not np.isfinite(quantity.value).any():
        return None
    k = int(np.nanargmax(np.abs(quantity.value)))
    return Extreme(float(quantity.value[k]), float(quantity.sd[k]), float(times[k]))
