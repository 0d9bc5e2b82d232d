"""The forearm deformer (paper, section 3.5): a twist that neither collapses nor bends the forearm.

A proximal frame rides on the ulna, a distal one on the radius. Between them, at t in [0, 1] along the forearm
(0: elbow end, follows the ulna; 1: wrist end, follows the radius), stands the blended frame

    o(t) = (1 - t) o_p + t o_d,      R(t) = exp(t rho) R_p,   rho = log(R_d R_p^T)      (SLERP)

and a point is carried by F_blend(theta, t) F_blend(rest, t)^-1, with its own t(v_tilde).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adapt.anatomy import Anatomy, Floats, Frame
from adapt.model.frames import frame_from_landmarks
from adapt.model.variation import Motion, Points, compose, cross_columns
from capture.rigid import exp_so3, left_jacobian_so3, log_so3


def forearm(
    anatomy: Anatomy, frames: tuple[Frame, ...], motions: tuple[Motion, Motion], p: Points, skin: Points
) -> Points:
    """Skin points carried by the twisting forearm, with derivatives."""
    rest = [frame_from_landmarks(anatomy, frame, p) for frame in frames]
    posed = [compose(motion, frame) for motion, frame in zip(motions, rest, strict=True)]
    t, dt = _along(rest[0], rest[1], skin)
    before, after = _blend(rest[0], rest[1], t, dt), _blend(posed[0], posed[1], t, dt)
    turn = after.rotation @ np.swapaxes(before.rotation, 1, 2)
    arm = np.matmul(turn, (skin.value - before.origin)[:, :, None])
    d_turn = after.d_rotation - np.matmul(turn, before.d_rotation)
    d = np.matmul(turn, skin.d - before.d_origin) + after.d_origin + cross_columns(d_turn, arm)
    return Points(arm[:, :, 0] + after.origin, d)


@dataclass(frozen=True)
class _Blended:
    """One frame per point: origin (N, 3), rotation (N, 3, 3) and their derivatives (N, 3, n)."""

    origin: Floats
    rotation: Floats
    d_origin: Floats
    d_rotation: Floats


def _along(proximal: Motion, distal: Motion, skin: Points) -> tuple[Floats, Floats]:
    """The ramp t (N,) in [0, 1] along the forearm and its derivative (N, n)."""
    axis, d_axis = distal.translation - proximal.translation, distal.d_translation - proximal.d_translation
    reach, d_reach = skin.value - proximal.translation, skin.d - proximal.d_translation
    length2 = axis @ axis
    t = reach @ axis / length2
    dt = (np.matmul(axis, d_reach) + reach @ d_axis - 2.0 * t[:, None] * (axis @ d_axis)) / length2
    inside = (t > 0.0) & (t < 1.0)
    return np.clip(t, 0.0, 1.0), dt * inside[:, None]


def _blend(proximal: Motion, distal: Motion, t: Floats, dt: Floats) -> _Blended:
    span, d_span = distal.translation - proximal.translation, distal.d_translation - proximal.d_translation
    origin = proximal.translation + t[:, None] * span
    d_origin = proximal.d_translation + t[:, None, None] * d_span + span[:, None] * dt[:, None, :]

    between = distal.rotation @ proximal.rotation.T
    rho = log_so3(between)
    d_rho = np.linalg.solve(left_jacobian_so3(rho), distal.d_rotation - between @ proximal.d_rotation)
    partway = exp_so3(t[:, None] * rho)
    # d exp(t rho) = J_l(t rho) (t d_rho + rho dt), and J_l(t rho) rho = rho.
    d_rotation = np.matmul(left_jacobian_so3(t[:, None] * rho), t[:, None, None] * d_rho)
    d_rotation += rho[:, None] * dt[:, None, :] + np.matmul(partway, proximal.d_rotation)
    return _Blended(origin, partway @ proximal.rotation, d_origin, d_rotation)
