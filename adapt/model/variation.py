"""Values that know how they vary: points and rigid motions with their partial derivatives.

Everything varies with the same n parameters q (columns). A rotation's derivative is an angular one, in the
frame its images live in: R(q + dq) = exp(hat(d_rotation @ dq)) R(q) to first order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adapt.anatomy import Floats
from capture.rigid import hat


@dataclass(frozen=True)
class Points:
    """N points (N, 3) in metres and their derivative d (N, 3, n)."""

    value: Floats
    d: Floats

    @property
    def n(self) -> int:
        """How many parameters the points vary with."""
        return int(self.d.shape[-1])


@dataclass(frozen=True)
class Motion:
    """A rigid motion x' = R x + t, with the derivatives of R (angular, (3, n)) and of t (3, n)."""

    rotation: Floats
    translation: Floats
    d_rotation: Floats
    d_translation: Floats

    def matrix(self) -> Floats:
        """The motion as a (4, 4) transform."""
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = self.rotation, self.translation
        return matrix


def constant_points(value: Floats, n: int) -> Points:
    """Points (N, 3) that vary with none of the n parameters."""
    return Points(value, np.zeros((*value.shape, n)))


def identity_motion(n: int) -> Motion:
    """The motion that leaves everything where it is."""
    return Motion(np.eye(3), np.zeros(3), np.zeros((3, n)), np.zeros((3, n)))


def compose(outer: Motion, inner: Motion) -> Motion:
    """First ``inner``, then ``outer``: x' = R_o (R_i x + t_i) + t_o."""
    carried = outer.rotation @ inner.translation
    return Motion(
        outer.rotation @ inner.rotation,
        carried + outer.translation,
        outer.d_rotation + outer.rotation @ inner.d_rotation,
        outer.d_translation + outer.rotation @ inner.d_translation - hat(carried) @ outer.d_rotation,
    )


def invert(motion: Motion) -> Motion:
    """The motion back: x = R^T (x' - t)."""
    back = motion.rotation.T
    return Motion(
        back,
        -back @ motion.translation,
        -back @ motion.d_rotation,
        -back @ (motion.d_translation + hat(motion.translation) @ motion.d_rotation),
    )


def move(motion: Motion, points: Points) -> Points:
    """Points carried by a motion: R x + t, derivative R dx + dt + d_rotation x (R x)."""
    turned = points.value @ motion.rotation.T
    d = np.matmul(motion.rotation, points.d) + motion.d_translation
    d += cross_columns(motion.d_rotation[None], turned[:, :, None])
    return Points(turned + motion.translation, d)


def cross_columns(left: Floats, right: Floats) -> Floats:
    """Cross product along the axis before the last, with broadcasting: (..., 3, n) x (..., 3, m)."""
    a, b, c = left[..., 0, :], left[..., 1, :], left[..., 2, :]
    x, y, z = right[..., 0, :], right[..., 1, :], right[..., 2, :]
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=-2)
