"""The forearm deformer (paper, section 3.5): a twist that neither collapses nor bends the forearm.

A proximal frame rides on the ulna, a distal one on the radius. Between them, at t in [0, 1] along the forearm
(0: elbow end, follows the ulna; 1: wrist end, follows the radius), stands the blended frame

    o(t) = (1 - t) o_p + t o_d,      R(t) = exp(t rho) R_p,   rho = log(R_d R_p^T)      (SLERP)

and a point is carried by F_blend(theta, t) F_blend(rest, t)^-1, with its own t(v_tilde). What F_blend(rest, t)^-1
makes of a point does not depend on the pose: it is worked out once for a body (``bind_forearm``).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adapt.anatomy import Anatomy, Floats, Frame, Ints
from adapt.model.deformers.between import blended_frames
from adapt.model.frames import frame_from_landmarks
from adapt.model.variation import Motion, Points, compose, mere_points, still_points
from capture.rigid import hat


@dataclass(frozen=True)
class BoundForearm:
    """Skin at rest in its blended frames, and the two frames at rest.

    ``t`` (N,) is the ramp along the forearm and ``dt`` (N, n) its derivative, or (1, 1) where it does not vary;
    ``local`` are the points' coordinates in the blended frames.
    """

    proximal: Motion
    distal: Motion
    t: Floats
    dt: Floats
    local: Points

    def at(self, index: Ints | slice) -> BoundForearm:
        """Some of the points."""
        dt = self.dt if len(self.dt) == 1 else self.dt[index]
        return BoundForearm(self.proximal, self.distal, self.t[index], dt, self.local.at(index))


def bind_forearm(anatomy: Anatomy, frames: tuple[Frame, ...], p: Points, skin: Points) -> BoundForearm:
    """Skin points at rest in the frames that stand between the two, with derivatives."""
    proximal, distal = (frame_from_landmarks(anatomy, frame, p) for frame in frames)
    t, dt = _along(proximal, distal, skin)
    frame = blended_frames(proximal, distal, t, dt)
    reach = skin.value - frame.origin
    local = np.einsum("nji,nj->ni", frame.rotation, reach)
    if skin.still and not p.d.any():  # then nothing varies at rest
        return BoundForearm(proximal, distal, t, np.zeros((1, 1)), still_points(local))
    moved = skin.d - frame.d_origin + np.matmul(hat(reach), frame.d_rotation)
    d_local = np.matmul(np.swapaxes(frame.rotation, 1, 2), moved)
    return BoundForearm(proximal, distal, t, dt, Points(local, d_local))


def carry_forearm(bound: BoundForearm, motions: tuple[Motion, Motion]) -> Points:
    """The bound points where the twisting forearm carries them, with derivatives."""
    proximal, distal = compose(motions[0], bound.proximal), compose(motions[1], bound.distal)
    frame = blended_frames(proximal, distal, bound.t, bound.dt)
    arm = np.einsum("nij,nj->ni", frame.rotation, bound.local.value)
    if not proximal.n:
        return mere_points(arm + frame.origin)
    d = np.matmul(hat(-arm), frame.d_rotation)
    d += frame.d_origin
    if not bound.local.still:
        d += np.matmul(frame.rotation, bound.local.d)
    return Points(arm + frame.origin, d)


def _along(proximal: Motion, distal: Motion, skin: Points) -> tuple[Floats, Floats]:
    """The ramp t (N,) in [0, 1] along the forearm and its derivative (N, n)."""
    axis, d_axis = distal.translation - proximal.translation, distal.d_translation - proximal.d_translation
    reach, d_reach = skin.value - proximal.translation, skin.d - proximal.d_translation
    length2 = axis @ axis
    t = reach @ axis / length2
    dt = (np.matmul(axis, d_reach) + reach @ d_axis - 2.0 * t[:, None] * (axis @ d_axis)) / length2
    inside = (t > 0.0) & (t < 1.0)
    return np.clip(t, 0.0, 1.0), dt * inside[:, None]
