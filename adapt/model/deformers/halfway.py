"""The halfway deformer: skin that follows the turn from one bone to the next by half, wherever it lies.

So does what slides between two segments, as the pad over a kneecap or the tissue over a shoulder blade. It is the
blended frame of the forearm (deformers.between) at t = 1/2 for every point.
"""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Floats
from adapt.model.deformers.turning import Turning
from adapt.model.derivatives import Motion, Points


class Halfway(Turning):
    """Skin half-way between two bones: between ``frames[0]`` on the first and ``frames[1]`` on the second."""

    name = "halfway"

    def along(self, first: Motion, second: Motion, skin: Points) -> tuple[Floats, Floats]:
        """A half, whatever the point."""
        return np.full(len(skin.value), 0.5), np.zeros((len(skin.value), first.n))
