"""Where a point inside one body lies in another whose skin has the same vertices: carried by the skin around it.

The map is the biharmonic spline that takes the one skin's vertices to the other's,

    f(x) = sum_i c_i |x - v_i| + A x + b,   f(v_i) = v'_i,   sum_i c_i = 0,   sum_i c_i v_i^T = 0,

|x| being the biharmonic operator's fundamental solution in space. It reproduces affine maps, is smooth between the
skins, and is linear in v': a point is a fixed weighted sum of the skin's vertices, W v', in whoever's body.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from adapt.anatomy import Floats


def carrying_weights(points: Floats, skin: Floats) -> Floats:
    """W (N, V) that carries points (N, 3) inside a skin (V, 3): they are W @ v' in the skin v' (V, 3).

    >>> corners = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    >>> weights = carrying_weights(np.array([[0.2, 0.5, 0.7]]), corners)
    >>> (weights @ (2.0 * corners + [0.0, 0.0, 1.0])).round(6)
    array([[0.4, 1. , 2.4]])
    """
    count = len(skin)
    flat = np.column_stack([skin, np.ones(count)])
    system = np.zeros((count + 4, count + 4))
    system[:count, :count] = np.linalg.norm(skin[:, None] - skin[None], axis=2)
    system[:count, count:], system[count:, :count] = flat, flat.T
    kernel = np.linalg.norm(points[:, None] - skin[None], axis=2)
    rows = np.column_stack([kernel, points, np.ones(len(points))])
    return np.asarray(lu_solve(lu_factor(system), rows.T)[:count].T)  # the system is symmetric
