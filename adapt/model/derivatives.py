"""Values that know how they vary: points and rigid motions with their partial derivatives.

Everything varies with the same n parameters q (columns). A rotation's derivative is an angular one, in the
frame its images live in: R(q + dq) = exp(hat(d_rotation @ dq)) R(q) to first order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adapt.anatomy import Floats, Ints
from capture.rigid import hat


@dataclass(frozen=True)
class Points:
    """N points (N, 3) in metres and their derivative d (N, 3, n).

    Points that all vary alike may share one derivative, (1, 3, n); see ``still_points``.
    """

    value: Floats
    d: Floats

    @property
    def n(self) -> int:
        """How many parameters the points vary with."""
        return int(self.d.shape[-1])

    @property
    def still(self) -> bool:
        """Whether the points are known to vary with nothing."""
        return len(self.d) == 1 and not self.d.any()

    def at(self, index: Ints | slice) -> Points:
        """Some of the points."""
        return Points(self.value[index], self.d if len(self.d) == 1 else self.d[index])


@dataclass(frozen=True)
class Motion:
    """A rigid motion x' = R x + t, with the derivatives of R (angular, (3, n)) and of t (3, n)."""

    rotation: Floats
    translation: Floats
    d_rotation: Floats
    d_translation: Floats

    @property
    def n(self) -> int:
        """How many parameters the motion varies with."""
        return int(self.d_rotation.shape[1])

    def matrix(self) -> Floats:
        """The motion as a (4, 4) transform."""
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = self.rotation, self.translation
        return matrix


@dataclass(frozen=True)
class Line:
    """A line through a point (3,) m along a direction (3,) of length 1, with the derivatives (3, n) of both."""

    point: Floats
    direction: Floats
    d_point: Floats
    d_direction: Floats


def constant_points(value: Floats, n: int) -> Points:
    """Points (N, 3) that vary with none of the n parameters.

    >>> constant_points(np.ones((5, 3)), 2).d.shape
    (5, 3, 2)
    """
    return Points(value, np.zeros((*value.shape, n)))


def still_points(value: Floats) -> Points:
    """Points (N, 3) that vary with nothing: their one column of zeros broadcasts against any number of columns.

    >>> points = still_points(np.ones((5, 3)))
    >>> points.still, points.d.shape, (points.d + np.ones((5, 3, 7))).shape
    (True, (1, 3, 1), (5, 3, 7))
    """
    return Points(value, np.zeros((1, 3, 1)))


def mere_points(value: Floats) -> Points:
    """Points (N, 3) of which no derivative is asked for: it has no columns.

    >>> mere_points(np.ones((5, 3))).n
    0
    """
    return Points(value, np.zeros((*value.shape, 0)))


def compose(outer: Motion, inner: Motion) -> Motion:
    """First ``inner``, then ``outer``: x' = R_o (R_i x + t_i) + t_o.

    >>> shift = Motion(np.eye(3), np.array([1.0, 0.0, 0.0]), np.zeros((3, 1)), np.zeros((3, 1)))
    >>> turn = Motion(np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]]), np.zeros(3), np.eye(3)[:, 2:], np.zeros((3, 1)))
    >>> compose(turn, shift).translation.tolist(), compose(shift, turn).translation.tolist()
    ([0.0, 1.0, 0.0], [1.0, 0.0, 0.0])
    >>> compose(turn, shift).d_translation[:, 0].tolist()  # it swings on about z
    [-1.0, 0.0, 0.0]
    """
    carried = outer.rotation @ inner.translation
    return Motion(
        outer.rotation @ inner.rotation,
        carried + outer.translation,
        outer.d_rotation + outer.rotation @ inner.d_rotation,
        outer.d_translation + outer.rotation @ inner.d_translation - hat(carried) @ outer.d_rotation,
    )


def invert(motion: Motion) -> Motion:
    """The motion back: x = R^T (x' - t).

    >>> turn = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    >>> back = invert(Motion(turn, np.array([1.0, 0.0, 0.0]), np.zeros((3, 0)), np.zeros((3, 0))))
    >>> (back.rotation @ [1.0, 0.0, 0.0] + back.translation).tolist()
    [0.0, 0.0, 0.0]
    """
    back = motion.rotation.T
    return Motion(
        back,
        -back @ motion.translation,
        -back @ motion.d_rotation,
        -back @ (motion.d_translation + hat(motion.translation) @ motion.d_rotation),
    )


def move(motion: Motion, points: Points) -> Points:
    """Points carried by a motion: R x + t, derivative R dx + dt + d_rotation x (R x).

    >>> turn = Motion(np.eye(3), np.zeros(3), np.eye(3)[:, 2:], np.zeros((3, 1)))  # its one parameter turns about z
    >>> moved = move(turn, still_points(np.array([[0.3, 0.0, 0.0]])))
    >>> moved.value.tolist(), moved.d[0, :, 0].tolist()
    ([[0.3, 0.0, 0.0]], [0.0, 0.3, 0.0])
    """
    turned = points.value @ motion.rotation.T
    if not motion.n:
        return mere_points(turned + motion.translation)
    # hat(-turned) d_rotation of all points at once: one large product is far faster than many small ones.
    swing = hat(-turned).reshape(-1, 3) @ motion.d_rotation
    d = swing.reshape(*turned.shape, motion.n) + motion.d_translation
    if not points.still:
        d += np.matmul(motion.rotation, points.d)
    return Points(turned + motion.translation, d)


def reach_along(frame: Motion, axis: Floats, points: Points) -> Floats:
    """How far (N,) points lie from a frame's origin along an axis (3,), times its length.

    >>> origin = Motion(np.eye(3), np.array([0.0, 0.1, 0.0]), np.zeros((3, 0)), np.zeros((3, 0)))
    >>> reach_along(origin, np.array([0.0, 2.0, 0.0]), still_points(np.ones((1, 3)))).tolist()
    [1.8]
    """
    return np.asarray((points.value - frame.translation) @ axis)


def d_reach_along(frame: Motion, axis: Floats, d_axis: Floats, points: Points) -> Floats:
    """The derivative (N, n) of ``reach_along``; the axis varies by (3, n).

    >>> origin = Motion(np.eye(3), np.zeros(3), np.zeros((3, 1)), np.eye(3)[:, 1:2])  # it moves along y
    >>> d_reach_along(origin, np.array([0.0, 2.0, 0.0]), np.zeros((3, 1)), still_points(np.ones((1, 3)))).tolist()
    [[-2.0]]
    """
    by_points = np.einsum("j,njk->nk", axis, points.d) - axis @ frame.d_translation
    return np.asarray(by_points + (points.value - frame.translation) @ d_axis)
