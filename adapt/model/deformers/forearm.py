"""The forearm deformer (paper, section 3.5): a twist that neither collapses nor bends the forearm.

A proximal frame rides on the ulna, a distal one on the radius. Between them, at t in [0, 1] along the forearm
(0: elbow end, follows the ulna; 1: wrist end, follows the radius), stands the blended frame

    o(t) = (1 - t) o_p + t o_d,      R(t) = exp(t rho) R_p,   rho = log(R_d R_p^T)      (SLERP)

and a point is carried by F_blend(theta, t) F_blend(rest, t)^-1, with its own t(v_tilde). What F_blend(rest, t)^-1
makes of a point does not depend on the pose: it is worked out once for a body. Fitting runs the same equations as
compiled loops: TURNING in ``adapt.model.compiled.skin``.
"""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Anatomy, Floats, Frame
from adapt.model.compiled.layout import Layout
from adapt.model.deformers.between import BoundBetween, between_layout, bind_between, carry_between
from adapt.model.deformers.deformer_type import DeformerType
from adapt.model.derivatives import Motion, Points
from adapt.model.frames import frame_from_landmarks


class Forearm(DeformerType):
    """Skin that twists between two bones: ``frames[0]`` rides on the first (the ulna), ``frames[1]`` on the radius."""

    name = "forearm"
    bones = 2
    frames = 2

    def bind(self, anatomy: Anatomy, frames: tuple[Frame, ...], p: Points, skin: Points) -> BoundBetween:
        """Skin points at rest in the frames that stand between the two, with derivatives."""
        proximal, distal = (frame_from_landmarks(anatomy, frame, p) for frame in frames)
        t, dt = _along(proximal, distal, skin)
        return bind_between(proximal, distal, t, dt, skin, varying=not skin.still or bool(p.d.any()))

    def carry(self, bound: BoundBetween, motions: tuple[Motion, ...]) -> Points:
        """The bound points where the twisting forearm carries them, with derivatives."""
        return carry_between(bound, motions)

    def bone_shares(self, bound: BoundBetween) -> tuple[Floats, ...]:
        """1 - t and t."""
        return 1.0 - bound.t, bound.t

    def layout(self, bound: BoundBetween) -> Layout:
        """The points in their blended frames, and the two frames."""
        return between_layout(bound)

    def turning_frames(
        self, anatomy: Anatomy, frames: tuple[Frame, ...], p: Points, bound: BoundBetween
    ) -> tuple[Motion, Motion]:
        """The proximal and the distal frame."""
        return bound.proximal, bound.distal


def _along(proximal: Motion, distal: Motion, skin: Points) -> tuple[Floats, Floats]:
    """The ramp t (N,) in [0, 1] along the forearm and its derivative (N, n)."""
    axis, d_axis = distal.translation - proximal.translation, distal.d_translation - proximal.d_translation
    reach, d_reach = skin.value - proximal.translation, skin.d - proximal.d_translation
    length2 = axis @ axis
    t = reach @ axis / length2
    dt = (np.matmul(axis, d_reach) + reach @ d_axis - 2.0 * t[:, None] * (axis @ d_axis)) / length2
    inside = (t > 0.0) & (t < 1.0)
    return np.clip(t, 0.0, 1.0), dt * inside[:, None]
