"""Depth images of triangles and boxes on a grid of slopes, compiled: a training image takes a few milliseconds.

A pixel (row i, column j) looks along the ray (x0 + j step, y0 + i step, 1) of the sensor's frame (x right, y down,
z forward); its depth is z in metres, 0 where nothing is met. Along an image line 1 / z of a plane is linear, which is
how triangles are filled. Whole triangles nearer than 10 cm are left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from capture.compiled import compiled

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]
Ints32 = NDArray[np.int32]
Codes = NDArray[np.uint8]

_NEAREST = 0.1  # m


@dataclass(frozen=True)
class Grid:
    """Slopes of the rays: those of the first pixel, the step between pixels, rows and columns."""

    x0: float
    y0: float
    step: float
    rows: int
    columns: int


def empty_image(grid: Grid) -> tuple[Floats32, Codes]:
    """Depth (H, W) m and codes (H, W) of nothing at all."""
    return np.zeros((grid.rows, grid.columns), np.float32), np.zeros((grid.rows, grid.columns), np.uint8)


def draw_mesh(grid: Grid, points: Floats, faces: Ints32, codes: Codes, depth: Floats32, seen: Codes) -> None:
    """Draw triangles (F, 3) of points (V, 3) m in the sensor's frame, each with a code (F,), before what is there."""
    _fill_triangles(grid.x0, grid.y0, grid.step, np.ascontiguousarray(points), faces, codes, depth, seen)


def draw_box(grid: Grid, centre: Floats, axes: Floats, half: Floats, code: int, depth: Floats32, seen: Codes) -> None:
    """Draw a box: its centre (3,) m, its axes as rows (3, 3), half its sizes (3,), in the sensor's frame."""
    _fill_box(grid.x0, grid.y0, grid.step, centre, np.ascontiguousarray(axes), half, code, depth, seen)


@compiled
def _fill_triangles(
    x0: float, y0: float, step: float, points: Floats, faces: Ints32, codes: Codes, depth: Floats32, seen: Codes
) -> None:
    rows, columns = depth.shape
    flat = np.zeros((len(points), 3))  # column, row, 1 / z
    for v in range(len(points)):
        if points[v, 2] >= _NEAREST:
            w = 1.0 / points[v, 2]
            flat[v, 0], flat[v, 1], flat[v, 2] = (points[v, 0] * w - x0) / step, (points[v, 1] * w - y0) / step, w
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ua, va, wa = flat[a, 0], flat[a, 1], flat[a, 2]
        ub, vb, wb = flat[b, 0], flat[b, 1], flat[b, 2]
        uc, vc, wc = flat[c, 0], flat[c, 1], flat[c, 2]
        if min(wa, wb, wc) == 0.0:
            continue
        area = (ub - ua) * (vc - va) - (uc - ua) * (vb - va)
        left, right = max(np.ceil(min(ua, ub, uc)), 0.0), min(np.floor(max(ua, ub, uc)), columns - 1.0)
        top, bottom = max(np.ceil(min(va, vb, vc)), 0.0), min(np.floor(max(va, vb, vc)), rows - 1.0)
        if area == 0.0 or left > right or top > bottom:
            continue
        for i in range(int(top), int(bottom) + 1):
            for j in range(int(left), int(right) + 1):
                p = ((ub - j) * (vc - i) - (uc - j) * (vb - i)) / area
                q = ((uc - j) * (va - i) - (ua - j) * (vc - i)) / area
                r = 1.0 - p - q
                if p >= 0.0 and q >= 0.0 and r >= 0.0:
                    z = 1.0 / (p * wa + q * wb + r * wc)
                    if depth[i, j] == 0.0 or z < depth[i, j]:
                        depth[i, j], seen[i, j] = z, codes[f]


@compiled
def _fill_box(
    x0: float,
    y0: float,
    step: float,
    centre: Floats,
    axes: Floats,
    half: Floats,
    code: int,
    depth: Floats32,
    seen: Codes,
) -> None:
    """Each ray against the three pairs of the box's planes."""
    rows, columns = depth.shape
    for i in range(rows):
        y = y0 + i * step
        for j in range(columns):
            x = x0 + j * step
            enters, leaves = 0.0, np.inf
            for k in range(3):
                along = axes[k, 0] * x + axes[k, 1] * y + axes[k, 2]
                at = axes[k, 0] * centre[0] + axes[k, 1] * centre[1] + axes[k, 2] * centre[2]
                if abs(along) < 1e-9:
                    if abs(at) > half[k]:
                        leaves = -1.0
                    continue
                one, other = (at - half[k]) / along, (at + half[k]) / along
                enters, leaves = max(enters, min(one, other)), min(leaves, max(one, other))
            if _NEAREST < enters < leaves and (depth[i, j] == 0.0 or enters < depth[i, j]):
                depth[i, j], seen[i, j] = enters, code
