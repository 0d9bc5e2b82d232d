"""Where the surface is at a pixel, and its normal: a smooth patch fitted to the readings around.

Inverse depth is the natural unknown: a plane of space is exactly linear in it, and a structured-light sensor
quantises it evenly. Around a pixel with depth z0, with u, v the distance along the row and down the column in units
of the window's radius r, and q = z0 (1 - z0 / z) (metres along the ray, equal to z - z0 to first order), we find

    argmin over a, b, c, d, e, f of
        sum_k w_k g_k (q_k - a - b u - c v - d u^2 / 2 - e u v - f v^2 / 2)^2
        + s^2 (b^2 + c^2) / B^2 + s^2 (d^2 + e^2 + f^2) / C^2

The quadratic terms keep a curved limb where it is and its normals true at the silhouette, where only one side has
readings; s is the reading's noise, B and C are how steep and how curved skin can be expected to be, and keep fits
to few pixels sane. The weights w fall with distance from the pixel, the same for all pixels; the gates g leave out
readings of other surfaces.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from capture.camera import Camera, ray_slopes
from capture.preprocess import DEPTH_STEP, Image
from capture.rigid import Floats

Pixels = NDArray[np.intp]

SMOOTHING_ANGLE = 0.0125
"""The window's radius seen from the sensor (rad): 15 mm at 1.2 m. Noise grows with distance, so the window does."""

_STEEPEST_SLOPE = 3.0  # readings beyond a cone of this slope around the pixel belong to another surface
_EXPECTED_SLOPE = 2.0  # B, metres along the ray per metre across it
_EXPECTED_CURVATURE = 25.0  # C (1 / m): a limb of 4 cm radius
_NOISE_STEPS = 0.3  # standard deviation of even rounding, in steps
_FARTHEST_RESIDUAL = 8.0  # in standard deviations; beyond it the second pass leaves a reading out


def surface_at(depth: Image, camera: Camera, pixels: Pixels) -> tuple[Floats, Floats]:
    """Points (N, 3) (m) and unit normals (N, 3) of the surface at pixels (N, 2) (row, column), in the sensor frame.

    Normals point towards the sensor. Each point stays on its pixel's ray. Every pixel must have a reading.
    """
    if not len(pixels):
        return np.zeros((0, 3)), np.zeros((0, 3))
    offsets, terms, products = _window(_radius_px(camera))
    z0 = depth[pixels[:, 0], pixels[:, 1]]
    q, gates = _neighbourhoods(depth, camera, pixels, offsets)
    noise = (_NOISE_STEPS * DEPTH_STEP) * z0**2
    fit = _fit(q, gates, terms, products, z0, noise)
    off = (q - fit.astype(np.float32) @ terms.T) / (_FARTHEST_RESIDUAL * noise[:, None])
    gates *= np.maximum(1.0 - off * off, 0.0)
    fit = _fit(q, gates, terms, products, z0, noise)
    return _on_rays(fit, camera, pixels, z0)


def _radius_px(camera: Camera) -> int:
    return max(2, round(SMOOTHING_ANGLE * camera.fx))


@lru_cache(maxsize=16)
def _window(radius: int) -> tuple[Pixels, Image, Image]:
    """Offsets (K, 2) (row, column), the patch's terms (K, 6), and weighted products of them and of pairs of them.

    The products (K, 6 + 36) turn gated readings into both sides of the normal equations.
    """
    row, column = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    inside = row**2 + column**2 < (radius + 0.5) ** 2
    row, column = row[inside], column[inside]
    u, v = column / radius, row / radius
    terms = np.stack([np.ones_like(u), u, v, 0.5 * u**2, u * v, 0.5 * v**2], axis=1)
    weights = np.maximum(1.0 - (u**2 + v**2) * (radius / (radius + 1)) ** 2, 0.0) ** 2
    weighted = terms * weights[:, None]
    pairs = (weighted[:, :, None] * terms[:, None, :]).reshape(-1, 36)
    products = np.concatenate([weighted, pairs], axis=1).astype(np.float32)
    return np.stack([row, column], axis=1), terms.astype(np.float32), products


def _neighbourhoods(depth: Image, camera: Camera, pixels: Pixels, offsets: Pixels) -> tuple[Image, Image]:
    """For each pixel and offset (N, K): q (m, 0 without a reading) and the gate (0 or 1)."""
    z = _gathered(depth, pixels, offsets)
    z0 = depth[pixels[:, 0], pixels[:, 1]][:, None]
    seen = z > 0.0
    q = (z0 - z0 * z0 / np.where(seen, z, z0)).astype(np.float32, copy=False)
    distance = np.hypot(offsets[:, 0], offsets[:, 1]).astype(np.float32)
    cone = (_STEEPEST_SLOPE / camera.fx) * z0 * distance + (2.0 * DEPTH_STEP) * z0**2
    gates = (seen & (np.abs(q) <= cone)).astype(np.float32)
    return q, gates


def _gathered(depth: Image, pixels: Pixels, offsets: Pixels) -> Image:
    """Depth (N, K) (m) at each offset from each pixel; 0 outside the image."""
    reach = int(np.abs(offsets).max())
    first = np.maximum(pixels.min(axis=0) - reach, 0)
    end = pixels.max(axis=0) + reach + 1
    window = depth[first[0] : end[0], first[1] : end[1]]
    padded = np.pad(window, reach)
    corner = (pixels - first + reach).astype(np.int32)
    width = padded.shape[1]
    flat = (corner[:, 0] * width + corner[:, 1])[:, None]
    steps = (offsets[:, 0] * width + offsets[:, 1]).astype(np.int32)
    return np.asarray(padded.reshape(-1).take(flat + steps))


def _fit(q: Image, gates: Image, terms: Image, products: Image, z0: Image, noise: Image) -> Floats:
    """The coefficients (N, 6) of each patch."""
    count = terms.shape[1]
    right = ((q * gates) @ products[:, :count]).astype(np.float64)
    normal = (gates @ products[:, count:]).astype(np.float64).reshape(-1, count, count)
    radius_m = SMOOTHING_ANGLE * z0.astype(np.float64)
    slope, curvature = (_EXPECTED_SLOPE * radius_m) ** -2, (_EXPECTED_CURVATURE * radius_m**2) ** -2
    prior = np.stack([np.zeros_like(slope), slope, slope, curvature, curvature, curvature], axis=1)
    diagonal = np.arange(count)
    normal[:, diagonal, diagonal] += noise.astype(np.float64)[:, None] ** 2 * prior
    return np.asarray(np.linalg.solve(normal, right[..., None])[..., 0])


def _on_rays(fit: Floats, camera: Camera, pixels: Pixels, z0: Image) -> tuple[Floats, Floats]:
    """Points and normals of patches at their pixels: z = z0 / (1 - a / z0), n from the gradient of 1 / z.

    On the plane n . P = h, P = z (x, y, 1), the inverse depth w = n . (x, y, 1) / h is linear in the ray slopes x, y,
    so n is along (dw/dx, dw/dy, w - x dw/dx - y dw/dy); its product with P is positive, so -n faces the sensor.
    """
    slopes = ray_slopes(camera)[pixels[:, 0], pixels[:, 1]].astype(np.float64)
    rays = np.column_stack([slopes, np.ones(len(slopes))])
    inverse = 1.0 - fit[:, 0] / z0
    by_pixel = fit[:, 1:3] / (_radius_px(camera) * z0[:, None])
    along = np.linalg.solve(_slope_changes(camera, pixels), by_pixel[..., None])[..., 0]
    normals = np.column_stack([along, -inverse - (slopes * along).sum(axis=1)])
    return rays * (z0 / inverse)[:, None], normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _slope_changes(camera: Camera, pixels: Pixels) -> Floats:
    """Change of the ray slopes per pixel (N, 2, 2): entry (i, j) of slope j along the row (0), down the column (1)."""
    slopes = ray_slopes(camera)
    row, column = pixels[:, 0], pixels[:, 1]
    right, left = np.minimum(column + 1, camera.width - 1), np.maximum(column - 1, 0)
    down, up = np.minimum(row + 1, camera.height - 1), np.maximum(row - 1, 0)
    along_row = (slopes[row, right] - slopes[row, left]) / (right - left)[:, None]
    down_column = (slopes[down, column] - slopes[up, column]) / (down - up)[:, None]
    return np.stack([along_row, down_column], axis=1).astype(np.float64)
