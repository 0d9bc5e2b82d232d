"""Room for what the compiled loops work out for some vertices at a time (adapt.model.compiled.skin)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adapt.anatomy import Floats, Ints
from capture.compiled import compiled, compiled_sums


class Room(NamedTuple):
    """What is worked out for up to N vertices at once that ride on the frames between two bones."""

    row: Ints  # (N,) which of the vertices at hand
    vertex: Ints  # (N,)
    entry: Ints  # (N,) which of the skin's entries
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
    row, vertex, entry = order.copy(), order.copy(), order.copy()
    return Room(row, vertex, entry, order, share, squeeze, bare, arm, across, reach, rotation, d_arm)


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


class Listed(NamedTuple):
    """The entries of some vertices, deformer after deformer: those of one begin at ``first`` (D + 1,) of it."""

    first: Ints
    row: Ints  # (K,) which of the vertices at hand
    entry: Ints  # (K,)


def lists_for(n: int, deformers: int) -> Listed:
    """Room for the entries of n vertices."""
    return Listed(*(np.zeros(size, dtype=np.int64) for size in (deformers + 1, n * deformers, n * deformers)))


@compiled
def fill_lists(first: Ints, deformer: Ints, rows: Ints, listed: Listed) -> None:
    """Lists the entries of some ``rows``, of which those of a vertex lie from its ``first`` on."""
    begin, count = listed.first, len(listed.first) - 1
    begin[:] = 0
    for m in range(len(rows)):
        for s in range(first[rows[m]], first[rows[m] + 1]):
            begin[deformer[s] + 1] += 1
    for e in range(count):
        begin[e + 1] += begin[e]
    for m in range(len(rows)):
        for s in range(first[rows[m]], first[rows[m] + 1]):
            at = begin[deformer[s]]
            listed.row[at], listed.entry[at] = m, s
            begin[deformer[s]] += 1
    for e in range(count, 0, -1):
        begin[e] = begin[e - 1]
    begin[0] = 0
