"""The halfway deformer: skin that follows the turn from one bone to the next by half, wherever it lies.

So does what slides between two segments, as the pad over a kneecap or the tissue over a shoulder blade. It is the
blended frame of the forearm (deformers.between) at t = 1/2 for every point.
"""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Anatomy, Floats, Frame
from adapt.model.compiled.layout import Layout
from adapt.model.deformers.between import BoundBetween, between_layout, bind_between, carry_between
from adapt.model.deformers.deformer_type import DeformerType
from adapt.model.derivatives import Motion, Points
from adapt.model.frames import frame_from_landmarks


class Halfway(DeformerType):
    """Skin half-way between two bones: between ``frames[0]`` on the first and ``frames[1]`` on the second."""

    name = "halfway"
    bones = 2
    frames = 2

    def bind(self, anatomy: Anatomy, frames: tuple[Frame, ...], p: Points, skin: Points) -> BoundBetween:
        """Skin points at rest in the frame in the middle, with derivatives."""
        first, second = (frame_from_landmarks(anatomy, frame, p) for frame in frames)
        half, dt = np.full(len(skin.value), 0.5), np.zeros((len(skin.value), p.d.shape[2]))
        return bind_between(first, second, half, dt, skin, varying=not skin.still or bool(p.d.any()))

    def carry(self, bound: BoundBetween, motions: tuple[Motion, ...]) -> Points:
        """The bound points where the frame in the middle carries them, with derivatives."""
        return carry_between(bound, motions)

    def bone_shares(self, bound: BoundBetween) -> tuple[Floats, ...]:
        """Half and half."""
        return 1.0 - bound.t, bound.t

    def layout(self, bound: BoundBetween) -> Layout:
        """The points in the frame in the middle, and the two frames."""
        return between_layout(bound)

    def turning_frames(
        self, anatomy: Anatomy, frames: tuple[Frame, ...], p: Points, bound: BoundBetween
    ) -> tuple[Motion, Motion]:
        """The two frames."""
        return bound.proximal, bound.distal
