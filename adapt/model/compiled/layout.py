"""How skin at rest is laid out in the arrays of the compiled loops (adapt.model.compiled.skin)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Floats, Ints
from adapt.model.derivatives import Motion

Unsigned = NDArray[np.uint64]

RIGID, TURNING, BENDING, CURVING = range(4)
"""The loops there are: skin rides on one bone; turns bit by bit from one bone to the next; swells meanwhile; or rides
on shares of an arc."""


@dataclass(frozen=True)
class Layout:
    """N points at rest for one of the loops; what a loop does not use keeps its default.

    ``t`` (N,) are the shares of the turn; ``ends`` the two frames at rest; ``width`` (N,) m and ``axis`` (3,) are a
    bend's (deformers.bend), ``length`` (m) is an arc's, and ``local`` (N, 3) m where points lie in its frames. The
    derivatives have m columns, by what the points and the landmarks vary with.
    """

    kind: int
    t: Floats | float = 0.0
    width: Floats | float = 1.0
    ends: tuple[Motion, ...] = ()
    axis: Floats = field(default_factory=lambda: np.zeros(3))
    length: float = 0.0
    local: Floats | None = field(default=None, repr=False)
    d_t: Floats | float = field(default=0.0, repr=False)  # (N, m)
    d_width: Floats | float = field(default=0.0, repr=False)  # (N, m)
    d_axis: Floats | float = 0.0  # (3, m)
    d_length: Floats | float = 0.0  # (m,)
    d_local: Floats | float = field(default=0.0, repr=False)  # (N, 3, m)


class BoundSkin(NamedTuple):
    """V vertices at rest as each of D deformers wants them: see ``Layout``.

    E entries, vertex after vertex, tell of each deformer in which a vertex has a share.
    """

    kind: Ints  # (D,)
    bones: Ints  # (D, 2)
    frame_rotation: Floats  # (D, 2, 3, 3): the two frames at rest; of a bend, the centre with no rotation
    frame_translation: Floats  # (D, 2, 3)
    axis: Floats  # (D, 3) of a bend
    length: Floats  # (D,) of an arc
    runs: Unsigned  # (D, R, 2): from where to where columns of derivatives are that its bones vary by
    flat: Unsigned  # (D, Q, 2): the same of rows of x, y and z one after the other
    first: Ints  # (V + 1,): where the entries of a vertex begin; they end where the next one's begin
    deformer: Ints  # (E,)
    weight: Floats  # (E,)
    local: Floats  # (E, 3): at rest; of what turns, in the blended frames, and of what curves, in those of the arc
    t: Floats  # (E,)
    width: Floats  # (E,) of a bend


class Varying(NamedTuple):
    """How V vertices at rest, as their deformers want them, vary with m parameters of the body (``BoundSkin``).

    m is 0 where only the pose varies. Where a kind of deformer has no such thing, numbers have no meaning.
    """

    rest: Floats  # (V, 3, m)
    local: Floats  # (E, 3, m) of what lies in frames between two bones
    t: Floats  # (E, m)
    width: Floats  # (E, m) of a bend
    frame_rotation: Floats  # (D, 2, 3, m)
    frame_translation: Floats  # (D, 2, 3, m)
    axis: Floats  # (D, 3, m) of a bend
    length: Floats  # (D, m) of an arc
