"""The arrays that the compiled chain of joints reads, and those that it fills."""

from __future__ import annotations

from typing import NamedTuple

from adapt.anatomy import Floats, Ints


class Chain(NamedTuple):
    """S elementary motions, parents before children: H = G(q) A, T_bone = T_before H.

    They are the rows of ``adapt.model.compiled.rows``. A joint may have several, each with the bone that the one before
    has moved as its ``before``, which is -1 where the motion starts from the recording's frame.
    """

    kind: Ints  # (S,)
    before: Ints  # (S,) bone
    bone: Ints  # (S,)
    other: Ints  # (S,) bone that is pointed at, or -1
    coordinates: Ints  # (S, 6) where q stands in theta: six of what is placed, three, or the first
    rest: Floats  # (S,) of a screw: q at rest
    point: Floats  # (S, 3) of a screw: on its axis; of what points: what is pointed at
    direction: Floats  # (S, 3) of a screw
    turn: Floats  # (S,) of a screw: rad for one of q; of what points: the side
    shift: Floats  # (S,) of a screw: m for one of q
    knots: Floats  # (S, K) of a glide, the last repeated to fill the row
    pieces: Floats  # (S, 4, K - 1, 6) of a glide: r (rad) and o (m) as cubics of q - knot, highest power first
    size: Floats  # (S, 3) m of what reaches
    after_rotation: Floats  # (S, 3, 3) of A
    after_translation: Floats  # (S, 3)
    d_point: Floats  # (S, 3, m), and so on
    d_direction: Floats
    d_pieces: Floats  # (S, 4, K - 1, 6, m)
    d_size: Floats
    d_after_rotation: Floats  # (S, 3, m)
    d_after_translation: Floats


class Bones(NamedTuple):
    """Motions of B bones with their n + m derivatives, as in ``adapt.model.derivatives.Motion``.

    The last one is no bone but the recording's frame, which stays where it is.
    """

    rotation: Floats  # (B, 3, 3)
    translation: Floats  # (B, 3)
    d_rotation: Floats  # (B, 3, n + m)
    d_translation: Floats  # (B, 3, n + m)
