"""The frames that stand between two others: origins blended linearly, rotations by SLERP."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adapt.anatomy import Floats
from adapt.model.derivatives import Motion
from capture.rigid import hat, left_jacobian_so3, log_so3


@dataclass(frozen=True)
class BlendedFrames:
    """One frame per point: origin (N, 3), rotation (N, 3, 3) and their derivatives (N, 3, n)."""

    origin: Floats
    rotation: Floats
    d_origin: Floats
    d_rotation: Floats


def blended_frames(proximal: Motion, distal: Motion, t: Floats, dt: Floats) -> BlendedFrames:
    """The frames at ``t`` (N,): all turn about the one axis rho, so each is a few numbers times fixed matrices.

    With K = hat(rho) / |rho| and x = t |rho|:  exp(t rho) = I + sin(x) K + (1 - cos(x)) K^2. The derivative of R(t)
    is t J_l(t rho) d_rho + rho dt + exp(t rho) d_R_p, because J_l(t rho) rho = rho, with the left Jacobian
    t J_l(t rho) = t I + (1 - cos(x)) / |rho| K + (t - sin(x) / |rho|) K^2.
    """
    rho = log_so3(distal.rotation @ proximal.rotation.T)
    angle = np.sqrt(rho @ rho) or 1.0  # without a twist K is 0, and any angle will do
    k = hat(rho) / angle
    powers, sine, versine = np.array([np.eye(3), k, k @ k]), np.sin(angle * t), 1.0 - np.cos(angle * t)
    slide, turn = np.array([np.ones_like(t), t]), np.array([np.ones_like(t), sine, versine])
    span = distal.translation - proximal.translation
    origin = _combined(slide, np.array([proximal.translation, span])[:, :, None])[:, :, 0]
    rotation = _combined(turn, powers @ proximal.rotation)
    if not proximal.n:
        return BlendedFrames(origin, rotation, *np.zeros((2, len(t), 3, 0)))

    d_span = distal.d_translation - proximal.d_translation
    d_between = distal.d_rotation - distal.rotation @ proximal.rotation.T @ proximal.d_rotation
    d_rho = np.linalg.solve(left_jacobian_so3(rho), d_between)
    swing = np.array([t, versine / angle, t - sine / angle])
    d_origin = _combined(slide, np.array([proximal.d_translation, d_span]))
    d_rotation = _combined(
        np.concatenate([turn, swing]), np.concatenate([powers @ proximal.d_rotation, powers @ d_rho])
    )
    by_t = dt[:, None, :]
    return BlendedFrames(origin, rotation, d_origin + span[:, None] * by_t, d_rotation + rho[:, None] * by_t)


def _combined(shares: Floats, matrices: Floats) -> Floats:
    """For each column of ``shares`` (K, N) the sum (N, 3, n) of those shares of the ``matrices`` (K, 3, n)."""
    combined = shares.T @ matrices.reshape(len(matrices), -1)
    return np.asarray(combined.reshape(shares.shape[1], *matrices.shape[1:]))
