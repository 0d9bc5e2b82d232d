"""Slices of skin between two planes that fan out from the line where the two meet (adapt.model.deformers.bend)."""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Floats
from adapt.model.derivatives import Motion, Points, d_reach_along, reach_along
from capture.rigid import hat


def slices(start: Motion, end: Motion, skin: Points) -> tuple[Floats, Floats, Floats, Floats]:
    """Shares t (N,) and widths a + b (N,) m of points between two planes, then their derivatives (N, n).

    A plane goes through a frame's origin across its y axis. Derivatives are 0 outside the bend, where no one asks.
    """
    (a, b), n = (reach_along(plane, y_axis(plane)[0], skin) for plane in (start, end)), start.n
    past, before = np.maximum(a, 0.0), np.maximum(-b, 0.0)
    width = np.maximum(past + before, 1e-12)
    t = past / width  # 0 where neither plane has been passed
    dt, d_width = np.zeros((len(t), n)), np.zeros((len(t), n))
    bending = np.flatnonzero((t > 0.0) & (t < 1.0))
    d_past, d_before = (d_reach_along(plane, *y_axis(plane), skin.at(bending)) for plane in (start, end))
    past, before, over = past[bending, None], before[bending, None], width[bending, None] ** 2
    dt[bending], d_width[bending] = (before * d_past + past * d_before) / over, d_past - d_before
    return t, width, dt, d_width


def y_axis(frame: Motion) -> tuple[Floats, Floats]:
    """A frame's y axis (3,) and its derivative (3, n)."""
    axis = frame.rotation[:, 1]
    return axis, hat(-axis) @ frame.d_rotation
