"""The curve deformer: a trunk's skin between the two bones of a curve, a belly that neither shears nor collapses.

Two planes at rest bound it as they bound a bend (deformers.slices): before ``start`` skin rides on the first bone,
beyond ``end`` on the second, and t = a / (a + b) is constant on planes that fan out between them. They may stand
farther apart than the curve's own ends, and farther in front than at the back: the deeper the belly, the more length
it needs to be folded in. With soft ends of a width c in t, a slice belongs to the share s of the curve,

    s = g t^2 / (2 c)    up to t = c,      s = g (t - c / 2)    from there to 1 - c,      g = 1 / (1 - c)

and likewise at the other end. Each slice is bound to the frame R(s), o(s) of the curve at rest, bent as it may be,
and is carried by that frame: as a rigid slice, across the curve. The frames are those of ``adapt.model.arc``. Fitting
runs the same equations as compiled loops: CURVING in ``adapt.model.compiled.skin``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adapt.anatomy import Anatomy, Deformer, Floats, Ints
from adapt.model.arc import Arc
from adapt.model.blended_frames import BlendedFrames
from adapt.model.compiled.layout import CURVING, Layout
from adapt.model.deformers.between import into_frames, into_frames_varying, out_of_frames
from adapt.model.deformers.deformer_type import DeformerType
from adapt.model.deformers.slices import slices
from adapt.model.derivatives import Motion, Points, still_points
from adapt.model.frames import frame_from_landmarks
from adapt.model.joints import arc_to, arched_joint

_SOFT = 0.25  # c


@dataclass(frozen=True)
class BoundCurve:
    """Skin at rest in the frames along a curve: shares ``s`` (N,) with derivatives (N, n), or (1, 1) where still.

    ``local`` are the points' coordinates in the frames.
    """

    arc: Arc
    s: Floats
    ds: Floats
    local: Points

    def at(self, index: Ints | slice) -> BoundCurve:
        """Some of the points."""
        ds = self.ds if len(self.ds) == 1 else self.ds[index]
        return BoundCurve(self.arc, self.s[index], ds, self.local.at(index))


class Curve(DeformerType):
    """Skin between the two bones of a curve joint; ``frames`` are the planes where it starts and ends.

    Their y axes point from the first bone to the second.
    """

    name = "curve"
    bones = 2
    frames = 2

    def problem(self, anatomy: Anatomy, deformer: Deformer) -> str | None:
        """Also where no curve leads from the first bone to the second."""
        if problem := super().problem(anatomy, deformer):
            return problem
        joint, (first, second) = arched_joint(anatomy, deformer.bones[1]), deformer.bones
        return f"no curve leads from {first} to {second}" if joint is None or joint.parent != first else None

    def bind(self, anatomy: Anatomy, deformer: Deformer, p: Points, skin: Points) -> BoundCurve:
        """Skin points at rest in the frames along the curve, with derivatives."""
        arc, s, ds = _shares(anatomy, deformer, p, skin)
        frames = arc.frames(s, ds)
        if skin.still and not p.d.any():  # then nothing varies at rest
            return BoundCurve(arc, s, np.zeros((1, 1)), still_points(into_frames(frames, skin.value)))
        return BoundCurve(arc, s, ds, into_frames_varying(frames, skin))

    def carry(self, bound: BoundCurve, motions: tuple[Motion, ...]) -> Points:
        """The bound points where the frames along the curve carry them, with derivatives."""
        return out_of_frames(bound.arc.moved(motions[0], motions[1]).frames(bound.s, bound.ds), bound.local)

    def bone_shares(self, bound: BoundCurve) -> tuple[Floats, ...]:
        """1 - s and s."""
        return 1.0 - bound.s, bound.s

    def layout(self, anatomy: Anatomy, deformer: Deformer, p: Points, skin: Points) -> Layout:
        """The curve at rest, and the points' shares and places in its frames; at its ends, where they are."""
        arc, s, ds = _shares(anatomy, deformer, p, skin)
        local = into_frames_varying(arc.frames(s, ds), skin)
        between = ((s > 0.0) & (s < 1.0))[:, None]
        return Layout(
            CURVING,
            s,
            ends=(arc.base, arc.top),
            length=arc.length,
            local=np.where(between, local.value, skin.value),
            d_t=ds,
            d_length=arc.d_length,
            d_local=local.d,
        )

    def turning_frames(
        self, anatomy: Anatomy, deformer: Deformer, p: Points, bound: BoundCurve
    ) -> tuple[Motion, Motion]:
        """The curve's frames at its base and its top."""
        return bound.arc.base, bound.arc.top

    def between(self, bound: BoundCurve, first: Motion, second: Motion, t: Floats) -> BlendedFrames:
        """The frames along the curve."""
        return Arc(first, second, bound.arc.length, bound.arc.d_length).frames(t, np.zeros((len(t), first.n)))


def _shares(anatomy: Anatomy, deformer: Deformer, p: Points, skin: Points) -> tuple[Arc, Floats, Floats]:
    """The curve at rest, and of points their shares s (N,) of it with derivatives (N, n)."""
    start, end = (frame_from_landmarks(anatomy, frame, p) for frame in deformer.frames)
    t, _, dt, _ = slices(start, end, skin)
    near = np.minimum(t, 1.0 - t)
    soft = near < _SOFT
    steep = 1.0 / (1.0 - _SOFT)
    part = steep * np.where(soft, near**2 / (2.0 * _SOFT), near - 0.5 * _SOFT)
    slope = steep * np.where(soft, near / _SOFT, 1.0)
    return arc_to(anatomy, deformer.bones[1], p), np.where(t < 0.5, part, 1.0 - part), slope[:, None] * dt
