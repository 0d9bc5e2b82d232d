"""The skin as other tools can pose it: linear blend skinning with four joints a vertex at most, and what that costs.

Each of our bones is a joint. Where a deformer turns skin bit by bit from one bone to the next (a forearm's twist, a
bend), linear blending of the two bones alone would collapse the skin. So helper joints stand between them, at
t = 1/8, 2/8, ... 7/8 of the turn: each is the frame that the deformer itself puts there, and a vertex hangs on the two
frames on either side of its own t.

Inside a bend tissue also swells away from the limb's axis, each vertex by its own gain g_i(theta). Each helper of a
bend has a twin that is scaled across the axis by 1 + G(theta), and a vertex hangs on the twins by its share b_i in
[0, 1]: min over b, G of the sum over vertices and some poses of |r_i (g_i(theta) - b_i G(theta))|^2, with r_i the
distance from the axis: the first singular vectors. What all this leaves out is measured against the model's own skin.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from adapt.anatomy import Deformer, Floats, Ints
from adapt.model.along import still_motion
from adapt.model.body import Body, bone_frames, bone_transforms, pose_skin, rest_theta
from adapt.model.deformers import DEFORMER_TYPES, Bound, DeformerType, bone_shares
from adapt.model.derivatives import Motion, compose
from track.export.linear_bones import BoneAlong, bones_along

STEPS = 8
"""Pieces that a deformer's turn is cut into: of a turn by 160 degrees, each blends linearly over 20."""
INFLUENCES = 4
"""Joints a vertex may hang on: what one set of glTF's attributes holds, and what engines expect."""
_NOTHING_M = 1e-6  # what swells less in all poses does not
_POSES = 40  # that the shares of a bend's twins are fitted to


@dataclass(frozen=True, eq=False)
class _Swelling:
    """How tissue swells inside a bend: points (M,) of it, their distances r (M,) m from the axis and shares b (M,)."""

    kind: DeformerType
    bound: Bound
    reach: Floats
    share: Floats

    def gain(self, motions: tuple[Motion, Motion]) -> float:
        """G: what serves the points best."""
        weights = self.share * self.reach**2
        whole = float(weights @ self.share)
        return float(weights @ self.kind.swelling(self.bound, motions)) / whole if whole else 0.0


@dataclass(frozen=True, eq=False)
class _Span:
    """The frames of a deformer between two bones: where they stand at rest on each, and at which ``t``.

    A bend's have their y axis along the limb, and twins that swell.
    """

    bones: tuple[str, str]
    kind: DeformerType
    bound: Bound
    ends: tuple[Motion, Motion]
    t: Floats
    swelling: _Swelling | None

    def frames(self, transforms: dict[str, Floats]) -> Floats:
        """The helper joints' frames (N, 4, 4), twins last, where the bones have moved by ``transforms`` (4, 4)."""
        first, second = motions = _motions(self.bones, transforms)
        moved = (compose(first, self.ends[0]), compose(second, self.ends[1]))
        between = self.kind.between(self.bound, *moved, self.t)
        frames = np.tile(np.eye(4), (len(self.t), 1, 1))
        frames[:, :3, :3], frames[:, :3, 3] = between.rotation, between.origin
        if self.swelling is None:
            return frames
        scale = 1.0 + self.swelling.gain(motions)
        return np.concatenate([frames, frames @ np.diag([scale, 1.0, scale, 1.0])])


@dataclass(frozen=True, eq=False)
class LinearSkin:
    """A body's skin hung on J joints: its bones, then the helpers, last those of bones along a curve.

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
    along: tuple[BoneAlong, ...] = field(default=(), repr=False)

    def frames(self, theta: Floats) -> Floats:
        """The joints' frames (J, 4, 4) in a pose (n,): rigid, but for the twins' scales."""
        transforms = bone_transforms(self.body, theta)
        moved = np.array([transforms[bone.name] for bone in self.body.anatomy.bones])
        helpers = [span.frames(transforms) for span in self.spans] + [bone.frames(transforms) for bone in self.along]
        return np.concatenate([moved @ self.rest[: len(moved)], *helpers])

    def bone_hung(self, bone: str) -> tuple[Ints, Floats]:
        """On which joints the vertices of a bone's surface hang (N, I), the bone or its helpers, and their weights."""
        along = next((some for some in self.along if some.name == bone), None)
        if along is not None:
            return along.hung(self.first_helper(along))
        whole = np.ones((len(self.body.rest_bones[bone]), 1))
        return self.names.index(bone) * whole.astype(np.int64), whole

    def first_helper(self, bone: BoneAlong) -> int:
        """Which joint is the first of a bone along a curve."""
        return self.names.index(bone.helpers[0])

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


def linear_skin(body: Body, thetas: Floats, *, steps: int = STEPS) -> LinearSkin:
    """Joints and weights for a body's skin, to serve poses (T, n); a turn is cut into ``steps``."""
    bones = [bone.name for bone in body.anatomy.bones]
    parents = {joint.child: joint.parent for joint in body.anatomy.joints}
    names, hangs_on = list(bones), [parents[name] for name in bones]
    weights, spans = np.zeros((len(body.v_hat), len(bones))), []
    for deformer, bound, share in zip(
        body.anatomy.deformers, body.bound_skin, body.anatomy.deformer_weights.T, strict=True
    ):
        kind = DEFORMER_TYPES[deformer.type]
        rides = bone_shares(deformer, bound)
        ends = kind.turning_frames(body.anatomy, deformer, body.p, bound)
        if ends is None:
            for name, part in rides.items():
                weights[:, bones.index(name)] += share * part
            continue
        t = rides[deformer.bones[1]]
        fixed = (still_motion(ends[0].matrix()), still_motion(ends[1].matrix()))
        span, twin = _span(body, deformer, bound, fixed, share, thetas, steps)
        helpers = [f"{deformer.name}_{k}_of_{steps}" for k in range(1, steps)]
        if span.swelling is not None:
            helpers += [f"{name}_swelling" for name in helpers]
        first, second = (bones.index(name) for name in span.bones)
        own = list(range(len(names), len(names) + len(helpers)))
        columns = [first, *own[: steps - 1], second]
        twins = [first, *(own[steps - 1 :] or own), second]
        names, hangs_on = names + helpers, hangs_on + [span.bones[0]] * len(helpers)
        weights = np.pad(weights, ((0, 0), (0, len(helpers))))
        _hang(weights, columns, twins, t, share, twin)
        spans.append(span)
    along = bones_along(body, STEPS)
    for bone in along:
        names, hangs_on = [*names, *bone.helpers], hangs_on + [bone.base] * len(bone.helpers)
    at_rest, still = bone_frames(body, rest_theta(body)), {name: np.eye(4) for name in bones}
    placed = [span.frames(still) for span in spans] + [bone.frames(still) for bone in along]
    rest = np.concatenate([np.array([at_rest[name] for name in bones]), *placed])
    index = tuple(None if name is None else bones.index(name) for name in hangs_on)
    return LinearSkin(body, tuple(names), index, rest, *_strongest(weights), tuple(spans), along)


def skin_gap(skin: LinearSkin, thetas: Iterable[Floats]) -> SkinGap:
    """The distance of linear blending from the model's own skin over poses (n,)."""
    means, largest = [], []
    for theta in thetas:
        off = np.linalg.norm(skin.posed(skin.frames(theta)) - pose_skin(skin.body, theta), axis=1)
        means.append(off.mean())
        largest.append(off.max())
    return SkinGap(float(np.mean(means)), float(np.max(largest)), int(np.argmax(largest)))


def _span(
    body: Body,
    deformer: Deformer,
    bound: Bound,
    ends: tuple[Motion, Motion],
    weight: Floats,
    thetas: Floats,
    steps: int,
) -> tuple[_Span, Floats]:
    """The frames between a deformer's bones, and by which share (V,) each vertex hangs on their twins."""
    first, second = deformer.bones
    kind, swell, twin = DEFORMER_TYPES[deformer.type], None, np.zeros(len(weight))
    if kind.swells and steps > 1:
        share = kind.bone_shares(bound)[1]
        rows = np.flatnonzero((share > 0.0) & (share < 1.0) & (weight > 0.0))
        swell = _swelling(body, (first, second), kind, bound.at(rows), thetas)
        twin[rows] = swell.share
    return _Span((first, second), kind, bound, ends, np.arange(1, steps) / steps, swell), twin


def _swelling(body: Body, bones: tuple[str, str], kind: DeformerType, bound: Bound, thetas: Floats) -> _Swelling:
    """Shares that serve the poses (T, n) best."""
    picks = np.unique(np.linspace(0, len(thetas) - 1, min(_POSES, len(thetas))).round().astype(int))
    motions = [_motions(bones, bone_transforms(body, theta)) for theta in thetas[picks]]
    gains = np.array([kind.swelling(bound, moved) for moved in motions])
    reach = np.maximum(kind.reach(bound), 1e-6)
    if np.abs(gains * reach).max(initial=0.0) < _NOTHING_M:
        return _Swelling(kind, bound, reach, np.zeros(len(reach)))
    share = np.linalg.svd(gains * reach, full_matrices=False)[2][0] / reach
    share *= np.sign(share[np.abs(share * reach).argmax()])
    return _Swelling(kind, bound, reach, np.clip(share / max(float(share.max()), 1e-12), 0.0, 1.0))


def _motions(bones: tuple[str, str], transforms: dict[str, Floats]) -> tuple[Motion, Motion]:
    return still_motion(transforms[bones[0]]), still_motion(transforms[bones[1]])


def _hang(weights: Floats, columns: list[int], twins: list[int], t: Floats, share: Floats, twin: Floats) -> None:
    """Give the ``share`` (V,) of each vertex to the columns on either side of its ``t`` (V,), ``twin`` (V,) to twins.

    Bones have no twins: next to a bone all of that goes to the other side's twin, as far as that side has weight.
    """
    rows, plain, swollen, steps = np.arange(len(t)), np.array(columns), np.array(twins), len(columns) - 1
    below = np.minimum((t * steps).astype(int), steps - 1)
    beyond = t * steps - below
    first, last = below == 0, below == steps - 1
    above_twin = np.select([last, first], [0.0, np.minimum(twin, beyond)], twin * beyond)
    below_twin = np.select([first, last], [0.0, np.minimum(twin, 1.0 - beyond)], twin * (1.0 - beyond))
    weights[rows, plain[below]] += share * (1.0 - beyond - below_twin)
    weights[rows, plain[below + 1]] += share * (beyond - above_twin)
    weights[rows, swollen[below]] += share * below_twin
    weights[rows, swollen[below + 1]] += share * above_twin


def _strongest(weights: Floats) -> tuple[Ints, Floats]:
    """The four largest of each row of ``weights`` (V, J), largest first, and their columns; 0 and 0 where fewer are."""
    joints = np.argsort(-weights, axis=1, kind="stable")[:, :INFLUENCES]
    kept = np.take_along_axis(weights, joints, axis=1)
    return np.where(kept > 0.0, joints, 0), kept / kept.sum(axis=1, keepdims=True)
