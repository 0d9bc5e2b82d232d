"""Rotations of ``capture.rigid`` for single vectors (3,), compiled, and products of matrices as small as they are.

Results go where the caller has room for them. All is written in single numbers: numba takes long to compile array
expressions, and these matrices are too small to gain by them.
"""

from __future__ import annotations

import math

from adapt.anatomy import Floats
from capture.compiled import compiled

_SMALL = 1e-4  # below this angle (rad) Taylor series replace the closed forms


@compiled
def add_product(a: Floats, x: Floats, out: Floats) -> None:
    """Adds a @ x to ``out`` for a (3, 3) and x (3, K)."""
    for i in range(3):
        for k in range(x.shape[1]):
            out[i, k] += a[i, 0] * x[0, k] + a[i, 1] * x[1, k] + a[i, 2] * x[2, k]


@compiled
def add_cross(u: Floats, x: Floats, scale: float, out: Floats) -> None:
    """Adds ``scale`` times the cross products of u (3,) and each column of x (3, K) to ``out``."""
    for k in range(x.shape[1]):
        out[0, k] += scale * (u[1] * x[2, k] - u[2] * x[1, k])
        out[1, k] += scale * (u[2] * x[0, k] - u[0] * x[2, k])
        out[2, k] += scale * (u[0] * x[1, k] - u[1] * x[0, k])


@compiled
def turn(a: Floats, x: Floats, out: Floats) -> None:
    """a @ x for (3, 3) and (3,)."""
    for i in range(3):
        out[i] = a[i, 0] * x[0] + a[i, 1] * x[1] + a[i, 2] * x[2]


@compiled
def length(r: Floats) -> float:
    """|r| of r (3,)."""
    return math.sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2])


@compiled
def _series(r: Floats, first: float, second: float, out: Floats) -> None:
    """I + first K + second K^2, with K = hat(r) and K^2 = r r^T - |r|^2 I."""
    rest = 1.0 - second * (r[0] * r[0] + r[1] * r[1] + r[2] * r[2])
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[i, i] = rest + second * r[i] * r[i]
        out[i, j] = second * r[i] * r[j] - first * r[k]
        out[i, k] = second * r[i] * r[k] + first * r[j]


@compiled
def exp(r: Floats, out: Floats) -> None:
    """The rotation (3, 3) of a rotation vector."""
    angle = length(r)
    if angle < _SMALL:
        _series(r, 1.0 - angle**2 / 6.0, 0.5 - angle**2 / 24.0, out)
    else:
        _series(r, math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle**2, out)


@compiled
def left_jacobian(r: Floats, out: Floats) -> None:
    """J (3, 3) with exp(r + dr) = exp(J dr) exp(r) to first order."""
    angle = length(r)
    if angle < _SMALL:
        _series(r, 0.5 - angle**2 / 24.0, 1.0 / 6.0 - angle**2 / 120.0, out)
    else:
        _series(r, (1.0 - math.cos(angle)) / angle**2, (angle - math.sin(angle)) / angle**3, out)


@compiled
def inverse_left_jacobian(r: Floats, out: Floats) -> None:
    """J^-1 (3, 3) = I - K / 2 + (1 / x^2 - cot(x / 2) / (2 x)) K^2, for x = |r| below a whole turn."""
    angle = length(r)
    if angle < 1e-2:  # the closed form's two terms cancel
        _series(r, -0.5, 1.0 / 12.0 + angle**2 / 720.0, out)
    else:
        _series(r, -0.5, 1.0 / angle**2 - 0.5 / (angle * math.tan(0.5 * angle)), out)


@compiled
def log(rotation: Floats, out: Floats) -> None:
    """The rotation vector (3,), no longer than pi, of a rotation (3, 3)."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[i] = 0.5 * (rotation[k, j] - rotation[j, k])
    sine, cosine = length(out), 0.5 * (rotation[0, 0] + rotation[1, 1] + rotation[2, 2] - 1.0)
    angle = math.atan2(sine, cosine)
    if cosine > -0.5:
        for i in range(3):
            out[i] *= angle / sine if sine > 0.0 else 1.0
        return
    # Near half a turn the skew part fades: the axis is the longest column of 2 (1 - cos(x)) u u^T.
    best = 0
    for i in range(1, 3):
        if rotation[i, i] > rotation[best, best]:
            best = i
    square, side = 0.0, 0.0
    for i in range(3):
        entry = rotation[i, best] + rotation[best, i] - (2.0 * cosine if i == best else 0.0)
        square, side = square + entry * entry, side + entry * out[i]
    scale = math.copysign(angle, side) / math.sqrt(square)
    for i in range(3):
        out[i] = scale * (rotation[i, best] + rotation[best, i] - (2.0 * cosine if i == best else 0.0))


@compiled
def shortest_way(e: Floats, u: Floats, out: Floats) -> None:
    """The rotation vector (3,) that leads from one direction to another by the shortest way."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[i] = e[j] * u[k] - e[k] * u[j]
    sine = length(out)
    angle = math.atan2(sine, e[0] * u[0] + e[1] * u[1] + e[2] * u[2])
    for i in range(3):
        out[i] *= angle / sine if sine > 0.0 else 1.0
