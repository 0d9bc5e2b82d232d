"""The nearest of some points, for many others close by: a grid of cubes instead of a tree.

A skin near its cloud asks for neighbours a few millimetres away. A cube of the grid then holds a handful of points,
and the cubes around it are searched faster than a tree is climbed.
"""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Floats, Ints
from capture.compiled import compiled

_CELL_M = 0.015  # twice the spacing of a cloud
_MOST_CELLS = 300_000  # of a wide cloud the cubes are larger


class PointGrid:
    """N points (N, 3), sorted into cubes: ``starts`` (X, Y, Z + 1) says where a cube's points begin in the order.

    Answers as scipy's ``cKDTree`` does.
    """

    def __init__(self, points: Floats) -> None:
        self._origin, extent = points.min(axis=0), np.ptp(points, axis=0)
        self._cell = max(_CELL_M, float((np.prod(extent + _CELL_M) / _MOST_CELLS) ** (1.0 / 3.0)))
        x, y, z = shape = (extent / self._cell).astype(np.int64) + 1
        cell = ((points - self._origin) / self._cell).astype(np.int64)
        row = cell[:, 0] * y + cell[:, 1]
        key = row * (z + 1) + cell[:, 2]  # one more along z, so that the end of a row's last cube is known, too
        self._order = np.argsort(key, kind="stable")
        self._points = points[self._order]
        counts = np.bincount(key, minlength=x * y * (z + 1))
        self._starts = (np.cumsum(counts) - counts).reshape(x, y, z + 1)
        self._shape = shape

    def query(self, points: Floats, distance_upper_bound: float = np.inf) -> tuple[Floats, Ints]:
        """Distance (M,) to, and index (M,) of, the nearest to each of M points; inf and N where none is nearer."""
        distance, found = np.full(len(points), np.inf), np.full(len(points), len(self._order))
        _search(points, self._points, self._starts, self._origin, self._cell, distance_upper_bound, distance, found)
        inside = found < len(self._order)
        found[inside] = self._order[found[inside]]
        return distance, found


@compiled
def _search(
    queries: Floats,
    points: Floats,
    starts: Ints,
    origin: Floats,
    cell: float,
    bound: float,
    distance: Floats,
    found: Ints,
) -> None:
    """Searches ever larger blocks of cubes until nothing outside them can be nearer."""
    count_x, count_y, count_z = starts.shape[0], starts.shape[1], starts.shape[2] - 1
    for m in range(len(queries)):
        a, b, c = queries[m, 0], queries[m, 1], queries[m, 2]
        x, y, z = (a - origin[0]) / cell, (b - origin[1]) / cell, (c - origin[2]) / cell
        i, j, k = int(np.floor(x)), int(np.floor(y)), int(np.floor(z))
        wall = min(min(x - i, i + 1 - x), min(min(y - j, j + 1 - y), min(z - k, k + 1 - z)))
        best, nearest, reach = bound * bound, -1, 1
        while True:
            low, high = max(k - reach, 0), min(k + reach, count_z - 1)
            if low <= high:
                for u in range(max(i - reach, 0), min(i + reach, count_x - 1) + 1):
                    for v in range(max(j - reach, 0), min(j + reach, count_y - 1) + 1):
                        for p in range(starts[u, v, low], starts[u, v, high + 1]):
                            e, f, g = points[p, 0] - a, points[p, 1] - b, points[p, 2] - c
                            square = e * e + f * f + g * g
                            if square < best:
                                best, nearest = square, p
            covered = (reach + wall) * cell
            whole = i - reach <= 0 and j - reach <= 0 and k - reach <= 0
            whole = whole and i + reach >= count_x - 1 and j + reach >= count_y - 1 and k + reach >= count_z - 1
            if best <= covered * covered or whole:
                break
            reach *= 2
        if nearest >= 0:
            distance[m], found[m] = np.sqrt(best), nearest
