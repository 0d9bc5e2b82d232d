"""Levenberg-Marquardt on normal equations, and the data term that all fitting steps share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from adapt.anatomy import Floats
from adapt.fit.correspondences import Correspondences
from adapt.model.variation import Points

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
    scale, residual = _data_residual(skin.value, matches, weights, plane_weight)
    n = skin.d.shape[2]
    across = (scale[:, None, None] * skin.d).reshape(-1, n)
    along = np.sqrt(plane_weight) * np.matmul(matches.normal[:, None, :], across.reshape(-1, 3, n))[:, 0]
    point, plane = residual[:, :3].ravel(), residual[:, 3]
    return Quadratic(
        0.5 * float(np.vdot(residual, residual)),
        across.T @ point + along.T @ plane,
        across.T @ across + along.T @ along,
    )


def data_energy(
    skin: Floats, matches: Correspondences, weights: Floats, *, plane_weight: float = PLANE_WEIGHT
) -> float:
    """The energy of ``data_term`` alone, for matched skin points (M, 3)."""
    _, residual = _data_residual(skin, matches, weights, plane_weight)
    return 0.5 * float(np.vdot(residual, residual))


def _data_residual(
    skin: Floats, matches: Correspondences, weights: Floats, plane_weight: float
) -> tuple[Floats, Floats]:
    """The scale (M,) of each match, and its residuals (M, 4): between the points (3), then along the normal (1)."""
    scale = np.sqrt(weights / ((plane_weight + 1.0) * SIGMA_M**2))
    residual = np.zeros((len(skin), 4))
    residual[:, :3] = scale[:, None] * (skin - matches.target)
    residual[:, 3] = np.sqrt(plane_weight) * np.einsum("ij,ij->i", matches.normal, residual[:, :3])
    return scale, residual


def gaussian_term(x: Floats, mean: Floats, precision: Floats) -> Quadratic:
    """A Gaussian prior: 0.5 (x - mean)^T precision (x - mean)."""
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
