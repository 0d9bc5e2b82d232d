"""The rigid deformer D = T_b v_tilde: linear blend skinning is a blend of these (equation 2)."""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Anatomy, Deformer, Floats
from adapt.model.compiled.layout import RIGID, Layout
from adapt.model.deformers.deformer_type import DeformerType
from adapt.model.derivatives import Motion, Points, move


class Rigid(DeformerType):
    """Skin that rides on one bone."""

    name = "rigid"
    bones = 1

    def bind(self, anatomy: Anatomy, deformer: Deformer, p: Points, skin: Points) -> Points:
        """The points as they are."""
        return skin

    def carry(self, bound: Points, motions: tuple[Motion, ...]) -> Points:
        """The points carried by the bone."""
        return move(motions[0], bound)

    def bone_shares(self, bound: Points) -> tuple[Floats, ...]:
        """All of each point."""
        return (np.ones(len(bound.value)),)

    def layout(self, anatomy: Anatomy, deformer: Deformer, p: Points, skin: Points) -> Layout:
        """There is nothing to say."""
        return Layout(RIGID)
