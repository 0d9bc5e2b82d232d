"""The elementary motions that the compiled chain is made of: a joint's type lays its own out as rows of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adapt.anatomy import Floats
from adapt.model.derivatives import Line, Motion

PLACE, SCREW, GLIDE, HOLD, SWING, ARC, POLE, TOWARDS = range(8)
_NOWHERE = Line(np.zeros(3), np.zeros(3), np.zeros((3, 0)), np.zeros((3, 0)))
_STILL = Motion(np.eye(3), np.zeros(3), np.zeros((3, 0)), np.zeros((3, 0)))


class Row(NamedTuple):
    """One elementary motion H = G(q) A, with its derivatives by what the landmarks vary with: m columns.

    What a kind does not need has no meaning, and no columns.
    """

    kind: int
    coordinates: tuple[int, ...]  # which of the joint's own q is: six to be placed, three to swing, one or none
    rest: float = 0.0  # rad or m, of a screw: q at rest
    axis: Line = _NOWHERE  # of a screw
    turn: float = 0.0  # of a screw: radians for one of q
    shift: float = 0.0  # of a screw: metres for one of q
    knots: Floats = np.zeros(2)  # (K,) of a glide
    pieces: Floats = np.zeros((4, 1, 6))  # (4, K - 1, 6) of a glide: r (rad) and o (m) as cubics of q - knot
    d_pieces: Floats = np.zeros((4, 1, 6, 0))  # (4, K - 1, 6, m)
    size: Floats = np.zeros(3)  # (3,) m, of what reaches along an arc or to an ellipsoid
    d_size: Floats = np.zeros((3, 0))  # (3, m)
    after: Motion = _STILL  # A


def place(after: Motion) -> Row:
    """G = [exp(q_r), q_t] of six coordinates."""
    return Row(PLACE, (0, 1, 2, 3, 4, 5), after=after)


def hold(after: Motion) -> Row:
    """G = I: A alone, which no coordinate moves."""
    return Row(HOLD, (), after=after)


def swing(after: Motion) -> Row:
    """G = [exp(q), 0] of three coordinates."""
    return Row(SWING, (0, 1, 2), after=after)


def reach(kind: int, size: Floats, d_size: Floats) -> Row:
    """G = [I, size * w(q)] of three coordinates, axis by axis; w is of that kind (adapt.model.compiled.reach)."""
    return Row(kind, (0, 1, 2), size=size, d_size=d_size)


def towards(end: Line, side: float, after: Motion) -> Row:
    """G = [Ry Rx, 0] so that z (-z where ``side`` is -1) points at a landmark that the joint's other bone carries."""
    return Row(TOWARDS, (), axis=end, turn=side, after=after)


def turn_about(axis: int, coordinate: int, *, turn: float = 1.0, after: Motion = _STILL) -> Row:
    """A turn by ``turn`` q about one of the axes x, y, z, through the origin."""
    line = Line(np.zeros(3), np.eye(3)[axis], np.zeros((3, 0)), np.zeros((3, 0)))
    return Row(SCREW, (coordinate,), axis=line, turn=turn, after=after)


def screw(coordinate: int, rest: float, axis: Line, *, turn: float = 0.0, shift: float = 0.0) -> Row:
    """A turn by ``turn`` (q - rest) about a line, and a shift by ``shift`` (q - rest) along it."""
    return Row(SCREW, (coordinate,), rest, axis, turn, shift)


def glide(knots: Floats, pieces: Floats, d_pieces: Floats, after: Motion) -> Row:
    """G = [exp(r(q)), o(q)] by cubics between knots, the highest power first, and straight lines beyond."""
    return Row(GLIDE, (0,), knots=knots, pieces=pieces, d_pieces=d_pieces, after=after)
