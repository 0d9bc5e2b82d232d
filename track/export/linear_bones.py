"""Bones whose vertices ride along a curve, hung on helper joints: linear blending between neighbouring frames of it.

The joints stand at shares 0, 1/8, ... 1 of the curve, and a vertex hangs on the two on either side of its own share.
They are the bone's alone, so that a bone that does not show can be shrunk to nothing by them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from adapt.anatomy import Bone, Floats, Ints
from adapt.model.along import base_of, still_motion
from adapt.model.arc import Arc
from adapt.model.body import Body
from adapt.model.derivatives import mere_points
from adapt.model.joints import arc_to


@dataclass(frozen=True, eq=False)
class BoneAlong:
    """Helper joints of one bone: their shares ``t`` (K,), and the two bones between which the curve runs."""

    name: str
    base: str
    arc: Arc = field(repr=False)
    t: Floats = field(repr=False)
    along: Floats = field(repr=False)

    @property
    def helpers(self) -> tuple[str, ...]:
        """The joints' names."""
        return tuple(f"{self.name}_{k}_of_{len(self.t) - 1}" for k in range(len(self.t)))

    def frames(self, transforms: Mapping[str, Floats]) -> Floats:
        """The joints' frames (K, 4, 4) where the bones have moved by ``transforms`` (4, 4)."""
        moved = self.arc.moved(still_motion(transforms[self.base]), still_motion(transforms[self.name]))
        between = moved.frames(self.t, np.zeros((len(self.t), 0)))
        frames = np.tile(np.eye(4), (len(self.t), 1, 1))
        frames[:, :3, :3], frames[:, :3, 3] = between.rotation, between.origin
        return frames

    def hung(self, first: int) -> tuple[Ints, Floats]:
        """Of every vertex four joints, of which the helpers have numbers from ``first`` on, and weights (N, 4)."""
        steps = len(self.t) - 1
        below = np.minimum((self.along * steps).astype(int), steps - 1)
        beyond = self.along * steps - below
        joints, weights = np.zeros((len(below), 4), dtype=np.int64), np.zeros((len(below), 4))
        joints[:, 0], joints[:, 1] = first + below, first + below + 1
        weights[:, 0], weights[:, 1] = 1.0 - beyond, beyond
        return joints, weights


def bones_along(body: Body, steps: int) -> tuple[BoneAlong, ...]:
    """Every bone along a curve, its curve cut into ``steps``."""
    return tuple(_along(body, bone, bone.along, steps) for bone in body.anatomy.bones if bone.along is not None)


def _along(body: Body, bone: Bone, along: Floats, steps: int) -> BoneAlong:
    arc = arc_to(body.anatomy, bone.name, mere_points(body.p.value))
    return BoneAlong(bone.name, base_of(body.anatomy, bone.name), arc, np.arange(steps + 1) / steps, along)
