"""Which side a lone arm or leg is of: by its pixels' chances, or undecided where these are too even."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from adapt.search.figure.names import LIMBS
from adapt.search.figure.view import FigureView

Bools = NDArray[np.bool_]

SURE = 0.8
"""The least share of a side for the side to be said."""

_LEAST_SHARE = 0.3  # of the pixels asked must look like such a limb at all


class LimbSide(NamedTuple):
    """``side`` is None where it is undecided; ``share`` (0.5 to 1) is that of the likelier side, ``limb`` (0 to 1) that
    of the pixels that look like such a limb of either side.
    """

    side: Literal["left", "right"] | None
    share: float
    limb: float


def side_of_limb(view: FigureView, limb: Literal["arm", "leg"], pixels: Bools | None = None) -> LimbSide:
    """The side of what a view shows of an arm or a leg, over all pixels with depth or some of them (64, 64).

    Raises:
        ValueError: none of the pixels has depth.
    """
    asked = view.seen if pixels is None else view.seen & pixels
    if not asked.any():
        raise ValueError("no pixel has depth")
    left, right = (float(view.chances[list(LIMBS[f"{limb}_{side}"])][:, asked].sum()) for side in "lr")
    both, share = left + right, max(left, right) / max(left + right, 1e-9)
    looks = both / float(asked.sum())
    if share < SURE or looks < _LEAST_SHARE:
        return LimbSide(None, share, looks)
    return LimbSide("left" if left > right else "right", share, looks)
