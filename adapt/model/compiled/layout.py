"""How one deformer's skin is laid out in the arrays of the compiled loops (adapt.model.compiled.skin)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from adapt.anatomy import Floats
from adapt.model.derivatives import Motion

RIGID, TURNING, BENDING = 0, 1, 2
"""The loops there are: skin rides on one bone; turns bit by bit from one bone to the next; and swells meanwhile."""


@dataclass(frozen=True)
class Layout:
    """N points at rest for one of the loops; what a loop does not use keeps its default.

    ``local`` (N, 3) are the points, for TURNING in the blended frames; ``t`` (N,) the shares of the turn; ``ends`` the
    two frames at rest; ``width`` (N,) m and ``axis`` (3,) are a bend's (deformers.bend). The derivatives, of local
    (N, 3, m) for TURNING alone, have any shape that broadcasts where nothing varies.
    """

    kind: int
    local: Floats = field(repr=False)
    t: Floats | float = 0.0
    width: Floats | float = 1.0
    ends: tuple[Motion, ...] = ()
    axis: Floats = field(default_factory=lambda: np.zeros(3))
    d_local: Floats | float = field(default=0.0, repr=False)
    d_t: Floats | float = 0.0  # (N, m)
    d_width: Floats | float = 0.0  # (N, m)
    d_axis: Floats | float = 0.0  # (3, m)
