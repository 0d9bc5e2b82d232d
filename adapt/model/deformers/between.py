"""The frames that stand between two others: origins blended linearly, rotations by SLERP; and skin bound to them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adapt.anatomy import Floats, Ints
from adapt.model.derivatives import Motion, Points, compose, mere_points, still_points
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


@dataclass(frozen=True)
class BoundBetween:
    """Skin at rest in its blended frames, and the two frames at rest.

    ``t`` (N,) says how far on the way between the two each point is; ``dt`` (N, n) is its derivative, or (1, 1) where
    it does not vary; ``local`` are the points' coordinates in the blended frames.
    """

    proximal: Motion
    distal: Motion
    t: Floats
    dt: Floats
    local: Points

    def at(self, index: Ints | slice) -> BoundBetween:
        """Some of the points."""
        dt = self.dt if len(self.dt) == 1 else self.dt[index]
        return BoundBetween(self.proximal, self.distal, self.t[index], dt, self.local.at(index))


def bind_between(
    proximal: Motion, distal: Motion, t: Floats, dt: Floats, skin: Points, *, varying: bool
) -> BoundBetween:
    """Skin points at rest in the frames between the two at ``t``; unless ``varying``, nothing varies at rest."""
    frame = blended_frames(proximal, distal, t, dt)
    reach = skin.value - frame.origin
    local = np.einsum("nji,nj->ni", frame.rotation, reach)
    if not varying:
        return BoundBetween(proximal, distal, t, np.zeros((1, 1)), still_points(local))
    moved = skin.d - frame.d_origin + np.matmul(hat(reach), frame.d_rotation)
    d_local = np.matmul(np.swapaxes(frame.rotation, 1, 2), moved)
    return BoundBetween(proximal, distal, t, dt, Points(local, d_local))


def carry_between(bound: BoundBetween, motions: tuple[Motion, ...]) -> Points:
    """The bound points where the frames carry them whose two ends ride on two bones, with derivatives."""
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


def _combined(shares: Floats, matrices: Floats) -> Floats:
    """For each column of ``shares`` (K, N) the sum (N, 3, n) of those shares of the ``matrices`` (K, 3, n)."""
    combined = shares.T @ matrices.reshape(len(matrices), -1)
    return np.asarray(combined.reshape(shares.shape[1], *matrices.shape[1:]))
