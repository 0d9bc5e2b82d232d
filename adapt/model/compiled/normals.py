"""Normals of the vertices that fitting uses (adapt.model.surface), compiled."""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Floats, Ints
from capture.compiled import compiled


@compiled
def fill_normals(vertices: Floats, faces: Ints, starts: Ints, around: Ints, rows: Ints, normals: Floats) -> None:
    """Writes unit normals of some ``rows`` (M,) of the vertices into ``normals`` (V, 3).

    The faces of row m are ``around[starts[m]:starts[m + 1]]``: a sparse matrix's index arrays.
    """
    for m in range(len(rows)):
        x, y, z = 0.0, 0.0, 0.0
        for k in range(starts[m], starts[m + 1]):
            a, b, c = faces[around[k], 0], faces[around[k], 1], faces[around[k], 2]
            p, q, r = vertices[b, 0] - vertices[a, 0], vertices[b, 1] - vertices[a, 1], vertices[b, 2] - vertices[a, 2]
            u, v, w = vertices[c, 0] - vertices[a, 0], vertices[c, 1] - vertices[a, 1], vertices[c, 2] - vertices[a, 2]
            x += q * w - r * v
            y += r * u - p * w
            z += p * v - q * u
        scale = 1.0 / max(np.sqrt(x * x + y * y + z * z), 1e-12)
        normals[rows[m], 0], normals[rows[m], 1], normals[rows[m], 2] = scale * x, scale * y, scale * z
