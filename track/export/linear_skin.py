"""The skin as other tools can pose it: linear blend skinning with four joints a vertex at most, and what that costs.

Each of our bones is a joint. Where a deformer turns skin bit by bit from one bone to the next (a forearm's twist, a
bend), linear blending of the two bones alone would collapse the skin. So helper joints stand between them, at
t = 1/8, 2/8, ... 7/8 of the turn: each is the frame that the deformer itself puts there, and a vertex hangs on the two
frames on either side of its own t. What this leaves out (four joints a vertex; the evasion of tissue inside a bend)
is measured against the model's own skin.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from adapt.anatomy import Floats, Ints
from adapt.model.body import Body, bone_frames, bone_transforms, pose_skin, rest_theta
from adapt.model.deformers.bend import BoundBend
from adapt.model.deformers.between import blended_frames
from adapt.model.deformers.forearm import BoundForearm
from adapt.model.variation import Motion, Points, compose

STEPS = 8
"""Pieces that a deformer's turn is cut into: of a turn by 160 degrees, each blends linearly over 20."""
INFLUENCES = 4
"""Joints a vertex may hang on: what one set of glTF's attributes holds, and what engines expect."""


@dataclass(frozen=True, eq=False)
class _Span:
    """The frames of a deformer between two bones: where they stand at rest on each, and at which ``t``."""

    bones: tuple[str, str]
    ends: tuple[Motion, Motion]
    t: Floats

    def frames(self, transforms: dict[str, Floats]) -> Floats:
        """The helper joints' frames (N, 4, 4) where the bones have moved by ``transforms`` (4, 4)."""
        first, second = (compose(_still(transforms[b]), e) for b, e in zip(self.bones, self.ends, strict=True))
        between = blended_frames(first, second, self.t, np.zeros((len(self.t), 0)))
        frames = np.tile(np.eye(4), (len(self.t), 1, 1))
        frames[:, :3, :3], frames[:, :3, 3] = between.rotation, between.origin
        return frames


@dataclass(frozen=True, eq=False)
class LinearSkin:
    """A body's skin hung on J joints: its bones, then the helpers.

    ``parents`` are indices of joints, None for the root; ``rest`` (J, 4, 4) are the joints' frames at rest in the
    recording's axes; vertex i hangs on ``joints[i]`` (V, 4) by ``weights[i]`` (V, 4), which sum up to 1.
    """

    body: Body
    names: tuple[str, ...]
    parents: tuple[int | None, ...]
    rest: Floats = field(repr=False)
    joints: Ints = field(repr=False)
    weights: Floats = field(repr=False)
    spans: tuple[_Span, ...] = field(repr=False)

    def frames(self, theta: Floats) -> Floats:
        """The joints' frames (J, 4, 4) in a pose (n,)."""
        transforms = bone_transforms(self.body, theta)
        moved = np.array([transforms[bone.name] for bone in self.body.anatomy.bones])
        return np.concatenate([moved @ self.rest[: len(moved)], *(span.frames(transforms) for span in self.spans)])

    def posed(self, frames: Floats) -> Floats:
        """The skin (V, 3) as linear blending poses it where the joints stand at ``frames`` (J, 4, 4)."""
        moved = (frames @ np.linalg.inv(self.rest))[:, :3]
        skin = np.column_stack([self.body.v_tilde.value, np.ones(len(self.joints))])
        posed = np.zeros((len(skin), 3))
        for joint, weight in zip(self.joints.T, self.weights.T, strict=True):
            posed += weight[:, None] * np.einsum("nij,nj->ni", moved[joint], skin)
        return posed


@dataclass(frozen=True)
class SkinGap:
    """How far linear blending is off the model's skin over some poses: mean and largest distance in m."""

    mean_m: float
    largest_m: float
    worst_pose: int


def linear_skin(body: Body, *, steps: int = STEPS) -> LinearSkin:
    """Joints and weights for a body's skin; a deformer's turn is cut into ``steps`` by one helper joint less."""
    bones = [bone.name for bone in body.anatomy.bones]
    parents = {joint.child: joint.parent for joint in body.anatomy.joints}
    names, hangs_on = list(bones), [parents[name] for name in bones]
    weights, spans = np.zeros((len(body.v_hat), len(bones))), []
    for deformer, bound, share in zip(
        body.anatomy.deformers, body.bound_skin, body.anatomy.deformer_weights.T, strict=True
    ):
        if isinstance(bound, Points):
            weights[:, bones.index(deformer.bones[0])] += share
            continue
        first, second = deformer.bones
        helpers = range(len(names), len(names) + steps - 1)
        names += [f"{deformer.name}_{k + 1}_of_{steps}" for k in range(len(helpers))]
        hangs_on += [first] * len(helpers)
        weights = np.pad(weights, ((0, 0), (0, len(helpers))))
        _hang(weights, [bones.index(first), *helpers, bones.index(second)], bound.t, share)
        spans.append(_Span((first, second), _ends(bound), np.arange(1, steps) / steps))
    at_rest = bone_frames(body, rest_theta(body))
    still = {name: np.eye(4) for name in bones}
    rest = np.concatenate([np.array([at_rest[name] for name in bones]), *(span.frames(still) for span in spans)])
    index = tuple(None if name is None else bones.index(name) for name in hangs_on)
    return LinearSkin(body, tuple(names), index, rest, *_strongest(weights), tuple(spans))


def skin_gap(skin: LinearSkin, thetas: Iterable[Floats]) -> SkinGap:
    """The distance of linear blending from the model's own skin over poses (n,)."""
    means, largest = [], []
    for theta in thetas:
        off = np.linalg.norm(skin.posed(skin.frames(theta)) - pose_skin(skin.body, theta), axis=1)
        means.append(off.mean())
        largest.append(off.max())
    return SkinGap(float(np.mean(means)), float(np.max(largest)), int(np.argmax(largest)))


def _ends(bound: BoundForearm | BoundBend) -> tuple[Motion, Motion]:
    """The two frames at rest that a deformer blends between: a forearm's own, or the recording's axes at a joint."""
    if isinstance(bound, BoundForearm):
        return _still(bound.proximal.matrix()), _still(bound.distal.matrix())
    centre = np.eye(4)
    centre[:3, 3] = bound.centre.value[0]
    return _still(centre), _still(centre)


def _still(matrix: Floats) -> Motion:
    """A rigid transform (4, 4) that varies with nothing."""
    return Motion(matrix[:3, :3], matrix[:3, 3], np.zeros((3, 0)), np.zeros((3, 0)))


def _hang(weights: Floats, columns: list[int], t: Floats, share: Floats) -> None:
    """Give the ``share`` (V,) of each vertex to the two of the columns on either side of its ``t`` (V,)."""
    rows, column, steps = np.arange(len(t)), np.array(columns), len(columns) - 1
    below = np.minimum((t * steps).astype(int), steps - 1)
    beyond = t * steps - below
    weights[rows, column[below]] += share * (1.0 - beyond)
    weights[rows, column[below + 1]] += share * beyond


def _strongest(weights: Floats) -> tuple[Ints, Floats]:
    """The four largest of each row of ``weights`` (V, J), largest first, and their columns; 0 and 0 where fewer are."""
    joints = np.argsort(-weights, axis=1, kind="stable")[:, :INFLUENCES]
    kept = np.take_along_axis(weights, joints, axis=1)
    return np.where(kept > 0.0, joints, 0), kept / kept.sum(axis=1, keepdims=True)
