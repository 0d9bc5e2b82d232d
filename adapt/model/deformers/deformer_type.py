"""What a type of deformer states about itself: nothing else in the package tests a type's name."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Any, ClassVar, Protocol, Self

import numpy as np

from adapt.anatomy import Anatomy, Deformer, Floats, Ints
from adapt.model.blended_frames import BlendedFrames, blended_frames
from adapt.model.compiled.layout import Layout
from adapt.model.derivatives import Motion, Points
from adapt.model.frames import mirrored_frame


class Bound(Protocol):
    """N points of skin at rest, as their deformer wants them."""

    def at(self, index: Ints | slice) -> Self:
        """Some of the points."""


class DeformerType(ABC):
    """One type of deformer. A new one is a file with a subclass, and its line in ``DEFORMER_TYPES``.

    It first binds the skin at rest, once for a body, then carries what it bound, once for a pose. ``bind`` makes what
    the type's other methods are given as ``bound``.
    """

    name: ClassVar[str]
    bones: ClassVar[int]  # how many it rides on
    frames: ClassVar[int] = 0  # how many it needs
    swells: ClassVar[bool] = False  # whether tissue moves away from the limb's axis as well

    def problem(self, anatomy: Anatomy, deformer: Deformer) -> str | None:
        """Why these parts make no deformer of this type in the anatomy, or None."""
        if (len(deformer.bones), len(deformer.frames)) != (self.bones, self.frames):
            return f"a deformer of type {self.name} has {self.bones} bone(s) and {self.frames} frame(s)"
        return None

    @abstractmethod
    def bind(self, anatomy: Anatomy, deformer: Deformer, p: Points, skin: Points) -> Any:
        """What it has to know of rest points of ``skin`` and of the landmarks, whatever the pose: a ``Bound``."""

    @abstractmethod
    def carry(self, bound: Any, motions: tuple[Motion, ...]) -> Points:
        """D_d(theta, p, v_tilde): where it carries each bound point when its bones move so, with derivatives."""

    @abstractmethod
    def bone_shares(self, bound: Any) -> tuple[Floats, ...]:
        """The share (N,) of each bound point that rides on each of its bones; they sum up to 1."""

    def mirrored(self, deformer: Deformer) -> Deformer:
        """The other side's deformer (adapt.mirror): frames with z from the opposite ends."""
        return replace(deformer, frames=tuple(mirrored_frame(frame) for frame in deformer.frames))

    @abstractmethod
    def layout(self, anatomy: Anatomy, deformer: Deformer, p: Points, skin: Points) -> Layout:
        """What ``bind`` says, for the compiled loops (adapt.model.compiled.skin)."""

    def turning_frames(
        self, anatomy: Anatomy, deformer: Deformer, p: Points, bound: Any
    ) -> tuple[Motion, Motion] | None:
        """The frames on its two bones at rest between which skin turns bit by bit; None where linear blending will do.

        Of one that swells, their y axes run along the limb.
        """
        return None

    def between(self, bound: Any, first: Motion, second: Motion, t: Floats) -> BlendedFrames:
        """The frames at shares ``t`` (N,) between those two, where its bones have carried them."""
        return blended_frames(first, second, t, np.zeros((len(t), first.n)))

    def swelling(self, bound: Any, motions: tuple[Motion, Motion]) -> Floats:
        """By how much of its distance from the limb's axis (N,) each bound point swells when the bones move so."""
        return np.zeros(len(self.bone_shares(bound)[0]))

    def reach(self, bound: Any) -> Floats:
        """The distance (N,) m of each bound point from that axis."""
        return np.zeros(len(self.bone_shares(bound)[0]))
