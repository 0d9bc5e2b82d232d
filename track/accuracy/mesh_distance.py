"""Distances from points to a surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Floats


def distance_to_mesh(points: Floats, vertices: Floats, faces: NDArray[np.int64]) -> Floats:
    """Distance (N,) in metres from points (N, 3) to the nearest place on a triangle mesh.

    >>> triangle, face = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]]), np.array([[0, 1, 2]])
    >>> distance_to_mesh(np.array([[0.2, 0.2, 0.3], [-0.4, 0.0, 0.0]]), triangle, face).round(6).tolist()
    [0.3, 0.4]
    """
    import igl

    squared, _, _ = igl.point_mesh_squared_distance(
        np.ascontiguousarray(points), np.ascontiguousarray(vertices), np.ascontiguousarray(faces)
    )
    return np.asarray(np.sqrt(squared), dtype=np.float64)
