"""Levenberg-Marquardt on normal equations, and the data term that all fitting steps share."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from adapt.anatomy import Floats
from adapt.match.correspondences import Correspondences
from adapt.model.derivatives import Points, mere_points
from capture.compiled import compiled_sums

SEARCH_PLANE_WEIGHT = 10.0  # point-to-plane against point-to-point, as in the paper: forgiving from far away,
PLANE_WEIGHT = 100.0  # but sliding along the skin creeps: from near by the points count less
CERTAINTY_PLANE_WEIGHT = 1e4  # nearest points follow the skin when it slides: they hardly tell where along it a pose is
SIGMA_M = 0.002  # what one independent patch of surface disagrees by where the skin is known
_MOST_REFUSED = 8
_LEAST_CURVATURE = 1.0  # of what is damped: as of a parameter known to 1 rad or 1 m
PATCH_M2 = 0.03**2  # errors of neighbouring points are alike: this much skin counts as one observation


@dataclass(frozen=True)
class Quadratic:
    """A sum of squares near a point: energy 0.5 |r|^2, its gradient J^T r and Gauss-Newton matrix J^T J."""

    energy: float
    gradient: Floats
    hessian: Floats

    def __add__(self, other: Quadratic) -> Quadratic:
        return Quadratic(self.energy + other.energy, self.gradient + other.gradient, self.hessian + other.hessian)


def data_term(
    skin: Points, matches: Correspondences, weights: Floats, *, plane_weight: float = PLANE_WEIGHT
) -> Quadratic:
    """Energy of matched skin points (the M matched vertices, in order, with derivatives (M, 3, n)).

    0.5 sum_i w_i [P (n_i . (v_i - t_i))^2 + |v_i - t_i|^2] / ((P + 1) sigma^2), with P the plane's weight and w_i
    (M,) the number of independent observations that the vertex stands for.
    """
    jacobian, residual = weighted(skin, matches, weights, plane_weight=plane_weight)
    flat, far = jacobian.reshape(-1, skin.d.shape[2]), residual.ravel()
    return Quadratic(0.5 * float(np.vdot(far, far)), flat.T @ far, flat.T @ flat)


def data_energy(
    skin: Floats, matches: Correspondences, weights: Floats, *, plane_weight: float = PLANE_WEIGHT
) -> float:
    """The energy of ``data_term`` alone, for matched skin points (M, 3)."""
    _, residual = weighted(mere_points(skin), matches, weights, plane_weight=plane_weight)
    return 0.5 * float(np.vdot(residual, residual))


def weighted(skin: Points, matches: Correspondences, weights: Floats, *, plane_weight: float) -> tuple[Floats, Floats]:
    """J (M, 3, n) and r (M, 3) of which ``data_term`` is made: the energy is 0.5 |r|^2, and J is r's derivative.

    With the scale s = w / ((P + 1) sigma^2) of a match, (v - t) is multiplied by the root of its metric,
    s^(1/2) (I + ((1 + P)^(1/2) - 1) n n^T).
    """
    jacobian, residual = np.zeros_like(skin.d), np.zeros_like(skin.value)
    scale = np.sqrt(weights / ((plane_weight + 1.0) * SIGMA_M**2))
    more = math.sqrt(1.0 + plane_weight) - 1.0
    _weigh(skin.d, skin.value, matches.target, matches.normal, scale, more, jacobian, residual)
    return jacobian, residual


@compiled_sums
def _weigh(
    d: Floats,
    value: Floats,
    target: Floats,
    normal: Floats,
    scale: Floats,
    more: float,
    jacobian: Floats,
    residual: Floats,
) -> None:
    for i in range(len(value)):
        s, a, b, c = scale[i], normal[i, 0], normal[i, 1], normal[i, 2]
        x, y, z = value[i, 0] - target[i, 0], value[i, 1] - target[i, 1], value[i, 2] - target[i, 2]
        along = more * (a * x + b * y + c * z)
        residual[i, 0], residual[i, 1] = s * (x + along * a), s * (y + along * b)
        residual[i, 2] = s * (z + along * c)
        for k in range(d.shape[2]):
            along = more * (a * d[i, 0, k] + b * d[i, 1, k] + c * d[i, 2, k])
            jacobian[i, 0, k] = s * (d[i, 0, k] + along * a)
            jacobian[i, 1, k] = s * (d[i, 1, k] + along * b)
            jacobian[i, 2, k] = s * (d[i, 2, k] + along * c)


def gaussian_term(x: Floats, mean: Floats, precision: Floats) -> Quadratic:
    """A Gaussian prior: 0.5 (x - mean)^T precision (x - mean).

    >>> prior = gaussian_term(np.array([3.0]), np.array([1.0]), np.array([[4.0]]))  # a standard deviation of 0.5
    >>> prior.energy, prior.gradient.tolist(), prior.hessian.tolist()
    (8.0, [8.0], [[4.0]])
    """
    pull = precision @ (x - mean)
    return Quadratic(0.5 * float((x - mean) @ pull), pull, precision)


def levenberg_marquardt(
    evaluate: Callable[[Floats], Quadratic],
    start: Floats,
    *,
    steps: int = 5,
    tolerance: float = 1e-4,
    energy: Callable[[Floats], float] | None = None,
) -> Floats:
    """Minimise a sum of squares from ``start`` (n,) in at most ``steps`` steps that lower it.

    A refused step only raises the damping. What the data hardly tell is damped as if they told a little: its step, far
    too long, would be refused until nothing else moved either. Stops early when a step lowers the energy by less than
    the fraction ``tolerance``, or when no damping helps any more. Where the ``energy`` alone is cheaper than
    ``evaluate``, it judges the steps, and derivatives are worked out only where a step starts.
    """
    x, here, damping, taken, refused = start, evaluate(start), 1e-4, 0, 0
    while taken < steps and refused < _MOST_REFUSED:
        diagonal = np.maximum(np.diag(here.hessian), _LEAST_CURVATURE)
        candidate = x - np.linalg.solve(here.hessian + damping * np.diag(diagonal), here.gradient)
        there = evaluate(candidate) if energy is None else energy(candidate)
        gain = here.energy - (there.energy if isinstance(there, Quadratic) else there)
        if gain <= 0.0:
            damping, refused = 10.0 * damping, refused + 1
            continue
        x, damping, taken, refused = candidate, damping / 5.0, taken + 1, 0
        if gain < tolerance * here.energy or taken == steps:
            break
        here = there if isinstance(there, Quadratic) else evaluate(x)
    return x
