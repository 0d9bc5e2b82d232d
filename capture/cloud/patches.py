"""A smooth patch fitted to the readings around a pixel of a depth image.

Inverse depth is the natural unknown: a plane of space is exactly linear in it, and a structured-light sensor
quantises it evenly. Around a pixel with depth z0, with u, v the distance along the row and down the column in units
of the window's radius r, and q = z0 (1 - z0 / z) (metres along the ray, equal to z - z0 to first order), we find

    argmin over a, b, c, d, e, f of
        sum_k w_k g_k (q_k - a - b u - c v - d u^2 / 2 - e u v - f v^2 / 2)^2
        + s^2 (b^2 + c^2) / B^2 + s^2 (d^2 + e^2 + f^2) / C^2

The quadratic terms keep a curved limb where it is and its normals true at the silhouette, where only one side has
readings; s is the reading's noise, B and C are how steep and how curved skin can be expected to be, and keep fits
to few pixels sane. The weights w fall with distance from the pixel, the same for all pixels; the gates g leave out
readings of other surfaces: at first those outside a cone around the pixel, then those far from the first patch. How
far that is follows the readings: where a sensor is so much noisier than assumed that hardly any reading would be left,
it is doubled until enough are.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from capture.cloud.preprocess import DEPTH_STEP, Image
from capture.compiled import compiled_sums
from capture.rigid import Floats

Pixels = NDArray[np.intp]
Steps = NDArray[np.uintp]  # unsigned, for compiled loops ask of signed ones whether they count from behind

SMOOTHING_ANGLE = 0.0125
"""The window's radius seen from the sensor (rad): 15 mm at 1.2 m. Noise grows with distance, so the window does."""

_STEEPEST_SLOPE = 3.0  # readings beyond a cone of this slope around the pixel belong to another surface
_EXPECTED_SLOPE = 2.0  # B, metres along the ray per metre across it
_EXPECTED_CURVATURE = 25.0  # C (1 / m): a limb of 4 cm radius
_NOISE_STEPS = 0.3  # standard deviation of even rounding, in steps
_FARTHEST_RESIDUAL = 8.0  # in standard deviations; beyond it the second pass leaves a reading out
_LEAST_SUPPORT = 0.1  # of the first pass's weight that the second has to keep
_PAIRS = np.tril_indices(6)
_AT_ONCE = 64  # pixels


def fit_patches(depth: Image, pixels: Pixels, *, radius_px: int, focal_px: float) -> Floats:
    """The coefficients (N, 6) of the patches around pixels (N, 2) (row, column), each with a reading.

    ``focal_px`` is the camera's focal length along the row.
    """
    offsets, terms, products = _window(radius_px)
    padded = np.pad(depth, radius_px)
    corners = (pixels[:, 0] * padded.shape[1] + pixels[:, 1]).astype(np.uintp)  # of the square about the window
    steps = ((offsets[:, 0] + radius_px) * padded.shape[1] + offsets[:, 1] + radius_px).astype(np.uintp)
    cone = ((_STEEPEST_SLOPE / focal_px) * np.hypot(offsets[:, 0], offsets[:, 1])).astype(np.float32)
    fit = np.zeros((len(pixels), 6))
    z0 = depth[pixels[:, 0], pixels[:, 1]]
    _fit_each(padded.ravel(), corners, steps, z0, cone, terms, products, fit)
    return fit


@lru_cache(maxsize=16)
def _window(radius: int) -> tuple[Pixels, Image, Image]:
    """Offsets (K, 2) (row, column), the patch's terms (6, K), and weighted products of them and of pairs of them.

    The products (6 + 21, K) turn gated readings into both sides of the normal equations, of which the lower half is
    enough.
    """
    row, column = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    inside = row**2 + column**2 < (radius + 0.5) ** 2
    row, column = row[inside], column[inside]
    u, v = column / radius, row / radius
    terms = np.stack([np.ones_like(u), u, v, 0.5 * u**2, u * v, 0.5 * v**2])
    weights = np.maximum(1.0 - (u**2 + v**2) * (radius / (radius + 1)) ** 2, 0.0) ** 2
    weighted = terms * weights
    products = np.concatenate([weighted, weighted[_PAIRS[0]] * terms[_PAIRS[1]]])
    return np.stack([row, column], axis=1), terms.astype(np.float32), products.astype(np.float32)


@compiled_sums
def _fit_each(
    depth: Image, corners: Steps, steps: Steps, z0: Image, cone: Image, terms: Image, products: Image, fit: Floats
) -> None:
    """Both passes, some pixels at once: of depth (flat), from ``corners`` (N,) with the window's ``steps`` (K,).

    Sums over the windows of some pixels are one matrix product, and few enough that these stay in the fastest memory.
    """
    first, second = np.ascontiguousarray(products[:6].T), np.ascontiguousarray(products[6:].T)
    q, gates = np.zeros((_AT_ONCE, len(steps)), dtype=np.float32), np.zeros((_AT_ONCE, len(steps)), dtype=np.float32)
    squared = np.zeros(len(steps), dtype=np.float32)
    for begin in range(0, len(corners), _AT_ONCE):
        end = min(begin + _AT_ONCE, len(corners))
        for m in range(end - begin):
            _read(depth, corners[begin + m], steps, z0[begin + m], cone, q[m], gates[m])
        count, own, mine = end - begin, z0[begin:end], fit[begin:end]
        support = _solve(q[:count], gates[:count], first, second, own, mine)
        patch = np.dot(mine.astype(np.float32), terms)
        for m in range(count):
            _close_gates(q[m], patch[m], products[0], support[m], own[m], squared, gates[m])
        _solve(q[:count], gates[:count], first, second, own, mine)


@compiled_sums
def _read(depth: Image, corner: np.uintp, steps: Steps, z0: float, cone: Image, q: Image, gates: Image) -> None:
    """The readings q (K,) around a pixel, and their gates, 1 in the cone or 0."""
    squared, least = z0 * z0, np.float32(2.0 * DEPTH_STEP) * z0 * z0
    for k in range(len(steps)):
        z = depth[corner + steps[k]]
        off = z0 - squared / (z if z > 0.0 else z0)
        q[k] = off
        gates[k] = np.float32(1.0) if z > 0.0 and abs(off) <= cone[k] * z0 + least else np.float32(0.0)


@compiled_sums
def _close_gates(
    q: Image, patch: Image, weights: Image, support: float, z0: float, squared: Image, gates: Image
) -> None:
    """Leaves out readings (K,) far from the first patch (K,), how far being doubled until enough support is left."""
    one = np.float32(1.0)
    per_noise = one / (np.float32(_FARTHEST_RESIDUAL * _NOISE_STEPS * DEPTH_STEP) * z0 * z0)
    kept = np.float32(0.0)
    for k in range(len(q)):
        off = (q[k] - patch[k]) * per_noise
        squared[k] = off * off
        kept += gates[k] * weights[k] * max(one - squared[k], np.float32(0.0))
    while kept < np.float32(_LEAST_SUPPORT) * support:
        kept = np.float32(0.0)
        for k in range(len(q)):
            squared[k] *= np.float32(0.25)
            kept += gates[k] * weights[k] * max(one - squared[k], np.float32(0.0))
    for k in range(len(q)):
        gates[k] *= max(one - squared[k], np.float32(0.0))


@compiled_sums
def _solve(q: Image, gates: Image, first: Image, second: Image, z0: Image, fit: Floats) -> Image:
    """One pass of some patches: normal equations, their solutions (M, 6) by Cholesky's factors; readings' weight (M,).

    Each step is taken for all patches before the next, for so the processor takes several at a time. No pivot is
    below its prior but for rounding, and rounding must not take a root of less than nothing.
    """
    pairs, right = np.dot(gates, second), np.dot(q * gates, first)
    normal, solution, prior = np.zeros((6, 6, len(z0))), np.zeros((6, len(z0))), np.zeros((6, len(z0)))
    at = 0
    for i in range(6):
        for m in range(len(z0)):
            solution[i, m] = right[m, i]
        for j in range(i + 1):
            for m in range(len(z0)):
                normal[i, j, m] = pairs[m, at]
            at += 1
    for m in range(len(z0)):
        noise, radius_m = np.float32(_NOISE_STEPS * DEPTH_STEP) * z0[m] * z0[m], SMOOTHING_ANGLE * z0[m]
        prior[1:3, m] = (noise / (_EXPECTED_SLOPE * radius_m)) ** 2
        prior[3:6, m] = (noise / (_EXPECTED_CURVATURE * radius_m**2)) ** 2
    _by_factors(normal, prior, solution)
    for i in range(6):
        for m in range(len(z0)):
            fit[m, i] = solution[i, m]
    return np.asarray(pairs[:, 0])


@compiled_sums
def _by_factors(normal: Floats, prior: Floats, solution: Floats) -> None:
    """Solves M systems, of (6, 6, M) with (6, M) on their diagonals: right-hand sides (6, M) become solutions."""
    count = normal.shape[2]
    for i in range(6):
        for m in range(count):
            normal[i, i, m] += prior[i, m]
        for j in range(i + 1):
            for k in range(j):
                for m in range(count):
                    normal[i, j, m] -= normal[i, k, m] * normal[j, k, m]
            if j < i:
                for m in range(count):
                    normal[i, j, m] *= normal[j, j, m]
        for m in range(count):  # what is kept of the diagonal is one over the factor's
            normal[i, i, m] = 1.0 / np.sqrt(max(normal[i, i, m], prior[i, m]))
        for k in range(i):
            for m in range(count):
                solution[i, m] -= normal[i, k, m] * solution[k, m]
        for m in range(count):
            solution[i, m] *= normal[i, i, m]
    for i in range(5, -1, -1):
        for k in range(i + 1, 6):
            for m in range(count):
                solution[i, m] -= normal[k, i, m] * solution[k, m]
        for m in range(count):
            solution[i, m] *= normal[i, i, m]


def fit_patches_by_arrays(depth: Image, pixels: Pixels, *, radius_px: int, focal_px: float) -> Floats:
    """``fit_patches`` in plain NumPy: what the compiled loop is compared with.

    >>> wall = np.full((32, 32), 1.5, dtype=np.float32)
    >>> fit = fit_patches_by_arrays(wall, np.array([[16, 16]]), radius_px=5, focal_px=500.0)
    >>> fit.shape, float(np.abs(fit).max())  # a wall straight ahead neither leans nor bends
    ((1, 6), 0.0)
    """
    offsets, terms, products = _window(radius_px)
    z0 = depth[pixels[:, 0], pixels[:, 1]][:, None]
    row, column = (pixels[:, None, k] + offsets[:, k] + radius_px for k in range(2))
    z = np.pad(depth, radius_px)[row, column]
    q = z0 - z0 * z0 / np.where(z > 0.0, z, z0)
    cone = (_STEEPEST_SLOPE / focal_px) * z0 * np.hypot(offsets[:, 0], offsets[:, 1]) + 2.0 * DEPTH_STEP * z0**2
    gates = ((z > 0.0) & (np.abs(q) <= cone)).astype(np.float64)
    noise, radius_m = _NOISE_STEPS * DEPTH_STEP * z0.astype(np.float64) ** 2, SMOOTHING_ANGLE * z0
    expected = np.repeat([_EXPECTED_SLOPE * radius_m[:, 0], _EXPECTED_CURVATURE * radius_m[:, 0] ** 2], [2, 3], axis=0)
    prior = np.pad((noise / expected.T) ** 2, ((0, 0), (1, 0)))
    for _ in range(2):
        normal = np.zeros((len(pixels), 6, 6))
        normal[:, _PAIRS[0], _PAIRS[1]] = normal[:, _PAIRS[1], _PAIRS[0]] = gates @ products[6:].T
        normal[:, np.arange(6), np.arange(6)] += prior
        fit = np.linalg.solve(normal, ((q * gates) @ products[:6].T)[..., None])[..., 0]
        squared = ((q - fit @ terms) / (_FARTHEST_RESIDUAL * noise)) ** 2
        while True:
            kept = gates * np.maximum(1.0 - squared, 0.0)
            lost = kept @ products[0] < _LEAST_SUPPORT * (gates @ products[0])
            if not lost.any():
                break
            squared[lost] *= 0.25
        gates = kept
    return np.asarray(fit)
