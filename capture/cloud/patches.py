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

SMOOTHING_ANGLE = 0.0125
"""The window's radius seen from the sensor (rad): 15 mm at 1.2 m. Noise grows with distance, so the window does."""

_STEEPEST_SLOPE = 3.0  # readings beyond a cone of this slope around the pixel belong to another surface
_EXPECTED_SLOPE = 2.0  # B, metres along the ray per metre across it
_EXPECTED_CURVATURE = 25.0  # C (1 / m): a limb of 4 cm radius
_NOISE_STEPS = 0.3  # standard deviation of even rounding, in steps
_FARTHEST_RESIDUAL = 8.0  # in standard deviations; beyond it the second pass leaves a reading out
_LEAST_SUPPORT = 0.1  # of the first pass's weight that the second has to keep
_PAIRS = np.tril_indices(6)
_KNOWN = np.zeros((6, 6), dtype=np.bool_)  # pairs of terms of which another pair has the product, but for a factor
_KNOWN[[3, 4, 5, 4, 5, 5], [0, 0, 0, 1, 1, 3]] = True


def fit_patches(depth: Image, pixels: Pixels, *, radius_px: int, focal_px: float) -> Floats:
    """The coefficients (N, 6) of the patches around pixels (N, 2) (row, column), each with a reading.

    ``focal_px`` is the camera's focal length along the row.
    """
    offsets, terms, products = _window(radius_px)
    padded = np.pad(depth, radius_px)
    corners = (pixels[:, 0] + radius_px) * padded.shape[1] + pixels[:, 1] + radius_px
    steps = offsets[:, 0] * padded.shape[1] + offsets[:, 1]
    cone = ((_STEEPEST_SLOPE / focal_px) * np.hypot(offsets[:, 0], offsets[:, 1])).astype(np.float32)
    fit = np.zeros((len(pixels), 6))
    _fit_each(padded.ravel(), corners, steps, cone, terms, products, fit)
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
    depth: Image, corners: Pixels, steps: Pixels, cone: Image, terms: Image, products: Image, fit: Floats
) -> None:
    """Both passes, pixel by pixel: of depth (flat), at ``corners`` (N,) with the window's ``steps`` (K,)."""
    one, two = np.float32(1.0), np.float32(2.0 * DEPTH_STEP)
    q, gates = np.zeros(len(steps), dtype=np.float32), np.zeros(len(steps), dtype=np.float32)
    squared = np.zeros(len(steps), dtype=np.float32)
    normal, known = np.zeros((6, 6)), np.zeros(6, dtype=np.float32)
    for m in range(len(corners)):
        z0 = depth[corners[m]]
        noise = np.float32(_NOISE_STEPS * DEPTH_STEP) * z0 * z0
        for k in range(len(steps)):
            z = depth[corners[m] + steps[k]]
            q[k] = z0 - z0 * z0 / (z if z > 0.0 else z0)
            gates[k] = 1.0 if z > 0.0 and abs(q[k]) <= cone[k] * z0 + two * z0 * z0 else 0.0
        _solve(q, gates, products, z0, noise, normal, fit[m])
        for j in range(6):
            known[j] = fit[m, j]
        per_noise = one / (np.float32(_FARTHEST_RESIDUAL) * noise)
        before, kept = np.float32(0.0), np.float32(0.0)
        for k in range(len(steps)):
            off = q[k] - known[0] * terms[0, k] - known[1] * terms[1, k] - known[2] * terms[2, k]
            off = (off - known[3] * terms[3, k] - known[4] * terms[4, k] - known[5] * terms[5, k]) * per_noise
            squared[k] = off * off
            before += gates[k] * products[0, k]
            kept += gates[k] * products[0, k] * max(one - squared[k], np.float32(0.0))
        while kept < np.float32(_LEAST_SUPPORT) * before:
            kept = np.float32(0.0)
            for k in range(len(steps)):
                squared[k] *= np.float32(0.25)
                kept += gates[k] * products[0, k] * max(one - squared[k], np.float32(0.0))
        for k in range(len(steps)):
            gates[k] *= max(one - squared[k], np.float32(0.0))
        _solve(q, gates, products, z0, noise, normal, fit[m])


@compiled_sums
def _solve(q: Image, gates: Image, products: Image, z0: float, noise: float, normal: Floats, fit: Floats) -> None:
    """One pass of one patch: the normal equations, and their solution (6,) by Cholesky's factors.

    No pivot is below its prior but for rounding, and rounding must not take a root of less than nothing.
    """
    for i in range(6):
        total = np.float32(0.0)
        for k in range(len(q)):
            total += gates[k] * q[k] * products[i, k]
        fit[i] = total
    at = 6
    for i in range(6):
        for j in range(i + 1):
            if not _KNOWN[i, j]:
                total = np.float32(0.0)
                for k in range(len(q)):
                    total += gates[k] * products[at, k]
                normal[i, j] = total
            at += 1
    normal[3, 0], normal[4, 0], normal[5, 0] = 0.5 * normal[1, 1], normal[2, 1], 0.5 * normal[2, 2]
    normal[4, 1], normal[5, 1], normal[5, 3] = 2.0 * normal[3, 2], 0.5 * normal[4, 2], 0.25 * normal[4, 4]
    radius_m = SMOOTHING_ANGLE * z0
    slope = (noise / (_EXPECTED_SLOPE * radius_m)) ** 2
    curvature = (noise / (_EXPECTED_CURVATURE * radius_m**2)) ** 2
    for i in range(6):
        prior = 0.0 if i == 0 else slope if i < 3 else curvature
        normal[i, i] += prior
        for j in range(i + 1):
            rest = normal[i, j]
            for k in range(j):
                rest -= normal[i, k] * normal[j, k]
            normal[i, j] = np.sqrt(max(rest, prior)) if i == j else rest / normal[j, j]
        for k in range(i):
            fit[i] -= normal[i, k] * fit[k]
        fit[i] /= normal[i, i]
    for i in range(5, -1, -1):
        for k in range(i + 1, 6):
            fit[i] -= normal[k, i] * fit[k]
        fit[i] /= normal[i, i]


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
