"""Levenberg-Marquardt: how a sum of squares, put together in ``adapt.fit.problem``, is made small."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from adapt.anatomy import Floats
from adapt.fit.problem import Quadratic

_MOST_REFUSED = 8
_LEAST_CURVATURE = 1.0  # of what is damped: as of a parameter known to 1 rad or 1 m


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
