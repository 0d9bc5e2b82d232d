"""Functions of arrays in which frames that are not known are rows of NaN."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from adapt.anatomy import Floats


def of_known_rows(rows: Floats, function: Callable[[Floats], Floats]) -> Floats:
    """A function from (N, 3) to (N, 3) of the finite rows; the others give NaN.

    >>> of_known_rows(np.array([[1.0, 2.0, 3.0], [np.nan, 0.0, 0.0]]), lambda rows: 2.0 * rows).tolist()
    [[2.0, 4.0, 6.0], [nan, nan, nan]]
    """
    known = np.isfinite(rows).all(axis=1)
    result = np.full((len(rows), 3), np.nan)
    if known.any():
        result[known] = function(rows[known])
    return result
