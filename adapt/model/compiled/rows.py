"""The elementary motions that the compiled chain is made of: a joint's type lays its own out as rows of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adapt.anatomy import Floats
from adapt.model.derivatives import Line, Motion

PLACE, SCREW, GLIDE = 0, 1, 2
_NOWHERE = Line(np.zeros(3), np.zeros(3), np.zeros((3, 0)), np.zeros((3, 0)))
_STILL = Motion(np.eye(3), np.zeros(3), np.zeros((3, 0)), np.zeros((3, 0)))


class Row(NamedTuple):
    """One elementary motion H = G(q) A, with its derivatives by what the landmarks vary with: m columns.

    What a kind does not need has no meaning, and no columns.
    """

    kind: int
    coordinates: tuple[int, ...]  # which of the joint's own q is: six to be placed, else one
    rest: float = 0.0  # rad or m, of a screw: q at rest
    axis: Line = _NOWHERE  # of a screw
    turn: float = 0.0  # of a screw: radians for one of q
    shift: float = 0.0  # of a screw: metres for one of q
    knots: Floats = np.zeros(2)  # (K,) of a glide
    pieces: Floats = np.zeros((4, 1, 6))  # (4, K - 1, 6) of a glide: r (rad) and o (m) as cubics of q - knot
    d_pieces: Floats = np.zeros((4, 1, 6, 0))  # (4, K - 1, 6, m)
    after: Motion = _STILL  # A


def place(after: Motion) -> Row:
    """G = [exp(q_r), q_t] of six coordinates."""
    return Row(PLACE, (0, 1, 2, 3, 4, 5), after=after)


def screw(coordinate: int, rest: float, axis: Line, *, turn: float = 0.0, shift: float = 0.0) -> Row:
    """A turn by ``turn`` (q - rest) about a line, and a shift by ``shift`` (q - rest) along it."""
    return Row(SCREW, (coordinate,), rest, axis, turn, shift)


def glide(knots: Floats, pieces: Floats, d_pieces: Floats, after: Motion) -> Row:
    """G = [exp(r(q)), o(q)] by cubics between knots, the highest power first, and straight lines beyond."""
    return Row(GLIDE, (0,), knots=knots, pieces=pieces, d_pieces=d_pieces, after=after)
