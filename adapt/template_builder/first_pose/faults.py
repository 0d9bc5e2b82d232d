"""What depth sensors do to a clean depth window: noise, steps, bands, holes, lost edges, shadows, flying pixels."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from adapt.search.figure.window import PIXEL_M

Floats32 = NDArray[np.float32]
Codes = NDArray[np.uint8]
Bools = NDArray[np.bool_]

_EDGE_M = 0.07
_SQUARE = np.ones((3, 3), np.uint8)


def spoil(rng: np.random.Generator, depth: Floats32, codes: Codes) -> tuple[Floats32, Codes]:
    """Depth (H, W) m, 0 where none, and codes (H, W) as a sensor would give them; each fault comes at times only."""
    if rng.random() < 0.8:
        depth, codes = _shaken(rng, depth, codes)
    near, far = _around(depth)
    edge = (far - near) > _EDGE_M
    noisy = _noise(rng, depth)
    if rng.random() < 0.4:  # flying pixels between what is near and what is behind
        flying = edge & (rng.random(depth.shape, np.float32) < rng.uniform(0.0, 0.5))
        between = near + (np.minimum(far, near + 0.6) - near) * rng.random(depth.shape, np.float32)
        noisy = np.where(flying, between, noisy)
    kept = (depth > 0.0) & ~_lost(rng, depth, edge)
    return np.where(kept, noisy, 0.0).astype(np.float32), np.where(kept, codes, 0).astype(np.uint8)


def _shaken(rng: np.random.Generator, depth: Floats32, codes: Codes) -> tuple[Floats32, Codes]:
    """Pixels that look a little aside: a sensor's grid is not the window's."""
    rows, columns = depth.shape
    off = rng.standard_normal((2, rows, columns), np.float32) * rng.uniform(0.0, 0.45)
    i = np.clip(np.rint(np.arange(rows)[:, None] + off[0]), 0, rows - 1).astype(np.intp)
    j = np.clip(np.rint(np.arange(columns) + off[1]), 0, columns - 1).astype(np.intp)
    return depth[i, j], codes[i, j]


def _around(depth: Floats32) -> tuple[Floats32, Floats32]:
    """The nearest and the farthest depth (H, W) m about each pixel; nothing counts as 9 m away."""
    filled = np.where(depth > 0.0, depth, np.float32(9.0))
    return cv2.erode(filled, _SQUARE), cv2.dilate(filled, _SQUARE)


def _noise(rng: np.random.Generator, depth: Floats32) -> Floats32:
    """Noise that grows with the square of depth, waves over the image, and at times the steps of a disparity."""
    square = depth * depth
    coarse = rng.standard_normal((12, 12), np.float32)
    waves = cv2.resize(coarse, depth.shape[::-1], interpolation=cv2.INTER_CUBIC)
    noisy = depth + square * (
        rng.standard_normal(depth.shape, np.float32) * np.float32(rng.uniform(0.0003, 0.003))
        + waves * np.float32(rng.uniform(0.0, 0.003))
    )
    if rng.random() < 0.35:
        step = np.maximum(0.0029 * square, 1e-4) * rng.uniform(0.5, 1.5)
        noisy = np.rint(noisy / step) * step
    return np.asarray(noisy, dtype=np.float32)


def _lost(rng: np.random.Generator, depth: Floats32, edge: Bools) -> Bools:
    """Pixels (H, W) without depth."""
    lost = np.zeros(depth.shape, bool)
    if rng.random() < 0.6:
        lost |= edge & (rng.random(depth.shape, np.float32) < rng.uniform(0.0, 1.0))
    if rng.random() < 0.4:
        lost |= _shadow(rng, depth)
    if rng.random() < 0.5:
        lost |= rng.random(depth.shape, np.float32) < rng.uniform(0.0, 0.06)
    if rng.random() < 0.5:
        lost |= _steep(rng, depth)
    holes = np.zeros(depth.shape, np.uint8)
    for _ in range(rng.integers(0, 5)):
        centre = tuple(int(rng.integers(0, size)) for size in depth.shape[::-1])
        sizes = int(rng.integers(1, 6)), int(rng.integers(1, 6))
        cv2.ellipse(holes, centre, sizes, rng.uniform(0.0, 180.0), 0.0, 360.0, 1, -1)
    return lost | (holes > 0)


def _shadow(rng: np.random.Generator, depth: Floats32) -> Bools:
    """What a projector beside the camera does not reach: a rim beside what is nearer."""
    filled = np.where(depth > 0.0, depth, np.float32(9.0))
    side, dark = int(rng.choice([-1, 1])), np.zeros(depth.shape, bool)
    for k in range(1, int(rng.integers(2, 5))):
        dark |= np.roll(filled, side * k, axis=1) < filled - 0.12 * k
    return dark


def _steep(rng: np.random.Generator, depth: Floats32) -> Bools:
    """Surfaces seen at a grazing angle give no depth."""
    dx, dy = (cv2.Sobel(depth, cv2.CV_32F, a, b) / (8.0 * PIXEL_M) for a, b in ((1, 0), (0, 1)))
    steep = np.hypot(dx, dy) > rng.uniform(2.0, 6.0)
    return np.asarray(steep & (rng.random(depth.shape, np.float32) < rng.uniform(0.2, 1.0)))
