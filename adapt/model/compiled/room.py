"""Room for what the compiled loops work out for some vertices at a time (adapt.model.compiled.skin)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adapt.anatomy import Floats, Ints
from capture.compiled import compiled_sums


class Room(NamedTuple):
    """What is worked out for up to N vertices at once that ride on the frames between two bones."""

    row: Ints  # (N,) which of the vertices at hand
    vertex: Ints  # (N,)
    order: Ints  # (N,) 0, 1, 2 and so on
    share: Floats  # (N, 4): weight, t, sin(t angle), versine(t angle)
    squeeze: Floats  # (N, 3) of a bend: k by q . inward, k by the mitre, k - 1
    bare: Floats  # (N, 3) the place in the frames
    arm: Floats  # (N, 3) the same, squeezed
    across: Floats  # (N, 3) the way in which it evades
    reach: Floats  # (N, 3) the arm where the frames carry it, by the weight
    rotation: Floats  # (N, 9) that carries it, by the weight
    d_arm: Floats  # (N, 3, m)


def room_for(n: int, m: int) -> Room:
    """Room for n vertices that vary with m parameters."""
    squeeze, bare, arm, across, reach = np.zeros((5, n, 3))
    rotation, d_arm, order = np.zeros((n, 9)), np.zeros((n, 3, m)), np.arange(n)
    share = np.zeros((n, 4))
    return Room(order.copy(), order.copy(), order, share, squeeze, bare, arm, across, reach, rotation, d_arm)


@compiled_sums
def add_turned(r: Floats, x: Floats, vertex: Ints, row: Ints, count: int, d: Floats) -> None:
    """Adds r @ x for r (N, 9) and x (N, 3, m) of so many vertices to the last m columns of their rows."""
    m, n = x.shape[2], d.shape[1] // 3
    for at in range(count):
        i, to = vertex[at], row[at]
        for j in range(3):
            first, a, b, c = j * n + n - m, r[at, 3 * j], r[at, 3 * j + 1], r[at, 3 * j + 2]
            for k in range(m):
                d[to, first + k] += a * x[i, 0, k] + b * x[i, 1, k] + c * x[i, 2, k]
