"""What forearm and halfway share: skin that turns bit by bit from one bone to the next, each point by its own share."""

from __future__ import annotations

from abc import abstractmethod

from adapt.anatomy import Anatomy, Deformer, Floats
from adapt.model.compiled.layout import TURNING, Layout
from adapt.model.deformers.between import BoundBetween, bind_between, carry_between
from adapt.model.deformers.deformer_type import DeformerType
from adapt.model.derivatives import Motion, Points
from adapt.model.frames import frame_from_landmarks


class Turning(DeformerType):
    """Skin in the frames between ``frames[0]``, which rides on the first bone, and ``frames[1]`` on the second."""

    bones = 2
    frames = 2

    @abstractmethod
    def along(self, first: Motion, second: Motion, skin: Points) -> tuple[Floats, Floats]:
        """How far t (N,) on the way from the first frame to the second each point is, and its derivative (N, n)."""

    def bind(self, anatomy: Anatomy, deformer: Deformer, p: Points, skin: Points) -> BoundBetween:
        """Skin points at rest in the frames that stand between the two, with derivatives."""
        first, second = (frame_from_landmarks(anatomy, frame, p) for frame in deformer.frames)
        t, dt = self.along(first, second, skin)
        return bind_between(first, second, t, dt, skin, varying=not skin.still or bool(p.d.any()))

    def carry(self, bound: BoundBetween, motions: tuple[Motion, ...]) -> Points:
        """The bound points where the frames between the two carry them, with derivatives."""
        return carry_between(bound, motions)

    def bone_shares(self, bound: BoundBetween) -> tuple[Floats, ...]:
        """1 - t and t."""
        return 1.0 - bound.t, bound.t

    def layout(self, anatomy: Anatomy, deformer: Deformer, p: Points, skin: Points) -> Layout:
        """The two frames, and how far between them the points are."""
        first, second = (frame_from_landmarks(anatomy, frame, p) for frame in deformer.frames)
        t, dt = self.along(first, second, skin)
        return Layout(TURNING, t, ends=(first, second), d_t=dt)

    def turning_frames(
        self, anatomy: Anatomy, deformer: Deformer, p: Points, bound: BoundBetween
    ) -> tuple[Motion, Motion]:
        """The two frames."""
        return bound.proximal, bound.distal
