"""How skin at rest is laid out in the arrays of the compiled loops (adapt.model.compiled.skin)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from adapt.anatomy import Floats, Ints
from adapt.model.derivatives import Motion

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
    """V vertices at rest as each of D deformers wants them: see ``Layout``."""

    kind: Ints  # (D,)
    bones: Ints  # (D, 2)
    weights: Floats  # (V, D)
    local: Floats  # (D, V, 3): at rest; of what turns, in the blended frames, and of what curves, in those of the arc
    t: Floats  # (D, V)
    width: Floats  # (D, V) of a bend
    frame_rotation: Floats  # (D, 2, 3, 3): the two frames at rest; of a bend, the centre with no rotation
    frame_translation: Floats  # (D, 2, 3)
    axis: Floats  # (D, 3) of a bend
    length: Floats  # (D,) of an arc


class Varying(NamedTuple):
    """How V vertices at rest, as each of D deformers wants them, vary with m parameters of the body (``BoundSkin``).

    m is 0 where only the pose varies. Where a vertex has no weight, and where a kind of deformer has no such thing,
    numbers have no meaning.
    """

    rest: Floats  # (V, 3, m)
    local: Floats  # (D, V, 3, m) of what lies in frames between two bones
    t: Floats  # (D, V, m)
    width: Floats  # (D, V, m) of a bend
    frame_rotation: Floats  # (D, 2, 3, m)
    frame_translation: Floats  # (D, 2, 3, m)
    axis: Floats  # (D, 3, m) of a bend
    length: Floats  # (D, m) of an arc
