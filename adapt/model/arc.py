"""The frames along an arc that leads from one bone to another: where vertebrae, ribs and the skin of a trunk ride.

A frame P at the arc's base rides on the first bone, a frame D at its top on the second; the arc runs along their y
axes, e = P e_y and u = D e_y, and has the constant length l (adapt.model.joints.curve). With rho the rotation vector
that leads from e to u by the shortest way, a = |rho|, and b what D is twisted by about u besides,

    R(s) = exp(s rho) P Ry(s b),      o(s) = o_P + l (f e + h rho x e)
    f = sin(s a) / a,      h = (1 - cos(s a)) / a^2,      o'(s) = l R(s) e_y

Bends up to half a turn are told by the two frames. The shortest way turns about nothing that lies along e + u, so that

    db = (d_D - d_P) . (e + u) / (1 + e . u).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adapt.anatomy import Floats
from adapt.model.blended_frames import BlendedFrames, blended_frames
from adapt.model.derivatives import Motion, compose
from capture.rigid import exp_so3, hat, left_jacobian_so3

_SMALL = 1e-3  # below this angle (rad) series replace the closed forms
_Y = np.eye(3)[1]


@dataclass(frozen=True)
class Arc:
    """An arc at rest: its frames at base and top, on the first and the second bone, and its length (m), (n,)."""

    base: Motion
    top: Motion
    length: float
    d_length: Floats

    def moved(self, first: Motion, second: Motion) -> Arc:
        """The arc where its bones have moved."""
        return Arc(compose(first, self.base), compose(second, self.top), self.length, self.d_length)

    def frames(self, s: Floats, ds: Floats) -> BlendedFrames:
        """The frames at shares ``s`` (N,) of the way, whose derivatives are ``ds`` (N, n), or (1, 1) where still."""
        e, u = self.base.rotation[:, 1], self.top.rotation[:, 1]
        twist, d_twist = self._twist(e, u)
        straight = Motion(
            self.top.rotation @ exp_so3(-twist * _Y),
            self.top.translation,
            self.top.d_rotation - np.outer(u, d_twist),
            self.top.d_translation,
        )
        bent = blended_frames(self.base, straight, s, ds)
        twists = np.zeros((len(s), 3, 3))
        sine, cosine = np.sin(s * twist), np.cos(s * twist)
        twists[:, 0, 0] = twists[:, 2, 2] = cosine
        twists[:, 0, 2], twists[:, 2, 0], twists[:, 1, 1] = sine, -sine, 1.0
        origin, d_origin = self._origins(straight, s)
        tangent = bent.rotation[:, :, 1]
        if not self.base.n:
            return BlendedFrames(origin, bent.rotation @ twists, d_origin, bent.d_rotation)
        d_twists = s[:, None] * d_twist + twist * ds
        return BlendedFrames(
            origin,
            bent.rotation @ twists,
            d_origin + self.length * tangent[:, :, None] * ds[:, None, :],
            bent.d_rotation + tangent[:, :, None] * d_twists[:, None, :],
        )

    def _twist(self, e: Floats, u: Floats) -> tuple[float, Floats]:
        """b and its derivative (n,)."""
        untwisted = exp_so3(_between(e, u)) @ self.base.rotation
        rest = untwisted.T @ self.top.rotation
        d_twist = (e + u) @ (self.top.d_rotation - self.base.d_rotation) / (1.0 + e @ u)
        return float(np.arctan2(rest[0, 2], rest[0, 0])), d_twist

    def _origins(self, straight: Motion, s: Floats) -> tuple[Floats, Floats]:
        """o(s) (N, 3) and its derivatives (N, 3, n) for the same s; ``straight`` is the top without its twist."""
        base, e = self.base, self.base.rotation[:, 1]
        rho = _between(e, straight.rotation[:, 1])
        angle = float(np.linalg.norm(rho))
        sinc, versed, d_sinc, d_versed = ratios(s * angle)
        w = np.cross(rho, e)
        f, h = s * sinc, s**2 * versed
        way = np.outer(f, e) + np.outer(h, w)
        origin = base.translation + self.length * way
        if not base.n:
            return origin, np.zeros((len(s), 3, 0))
        turned = straight.d_rotation - exp_so3(rho) @ base.d_rotation
        d_rho = np.linalg.solve(left_jacobian_so3(rho), turned)
        de = hat(-e) @ base.d_rotation
        dw = hat(-e) @ d_rho + hat(rho) @ de
        slope = np.outer(s**3 * d_sinc, e) + np.outer(s**4 * d_versed, w)
        d_way = f[:, None, None] * de + h[:, None, None] * dw + slope[:, :, None] * (rho @ d_rho)
        return origin, base.d_translation + way[:, :, None] * self.d_length + self.length * d_way


def ratios(x: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """sin(x) / x and (1 - cos(x)) / x^2 of angles, and the derivatives of both by x, divided by x.

    >>> [round(float(each), 6) for each in ratios(np.array(0.0))]
    [1.0, 0.5, -0.333333, -0.083333]
    """
    small = np.abs(x) < _SMALL
    y = np.where(small, 1.0, x)
    sine, versed = np.sin(y), 2.0 * np.sin(0.5 * y) ** 2
    return (
        np.where(small, 1.0 - x**2 / 6.0, sine / y),
        np.where(small, 0.5 - x**2 / 24.0, versed / y**2),
        np.where(small, -1.0 / 3.0 + x**2 / 30.0, (y * np.cos(y) - sine) / y**3),
        np.where(small, -1.0 / 12.0 + x**2 / 180.0, (y * sine - 2.0 * versed) / y**4),
    )


def _between(e: Floats, u: Floats) -> Floats:
    """rho (3,): the rotation vector that leads from one direction to another by the shortest way."""
    across = np.cross(e, u)
    sine = float(np.linalg.norm(across))
    return across * (float(np.arctan2(sine, e @ u)) / sine if sine > 0.0 else 1.0)
