"""The one finite-difference checker that every block of the model is held against."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def check_jacobian(
    function: Callable[[Floats], Floats],
    jacobian: Floats,
    at: Floats,
    *,
    step: float = 1e-6,
    relative: float = 1e-6,
) -> None:
    """Compare ``jacobian`` (output shape + (n,)) with central differences of ``function`` at ``at`` (n,)."""
    columns = [(function(at + step * unit) - function(at - step * unit)) / (2.0 * step) for unit in np.eye(len(at))]
    expected = np.stack(columns, axis=-1)
    assert jacobian.shape == expected.shape
    scale = max(1.0, float(np.abs(expected).max()))
    worst = np.unravel_index(np.abs(jacobian - expected).argmax(), expected.shape)
    assert np.abs(jacobian - expected).max() < relative * scale, (
        f"worst at {worst}: {jacobian[worst]} instead of {expected[worst]}"
    )
