"""What the files in this folder show: a slanted wall with noise and a hole, a block that moves in front of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

WIDTH, HEIGHT, FRAMES, FPS = 64, 48, 6, 30.0
FX = FY = 60.0
CX, CY = 31.5, 23.5
DEPTH_UNIT_M = 0.0005
COLOUR_FROM_DEPTH_TURN_DEG, COLOUR_FROM_DEPTH_SHIFT_M = 10.0, (0.015, 0.002, 0.0)
"""The colour camera: turned about z, then shifted."""


def readings(frame: int) -> NDArray[np.uint16]:
    """Depth readings (HEIGHT, WIDTH) of a frame."""
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    wall = 3000 + 8 * u + 3 * v + np.random.default_rng(frame).integers(-4, 5, u.shape)
    block = (abs(v - 20) < 8) & (abs(u - 10 - 4 * frame) < 6)
    hole = (u - 50) ** 2 + (v - 36) ** 2 < 36
    return np.where(hole, 0, np.where(block, 1200 + v, wall)).astype(np.uint16)


def colour(frame: int) -> NDArray[np.uint8]:
    """Colour image (HEIGHT, WIDTH, 3), red, green, blue."""
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    return np.stack([4 * u, 5 * v, np.full_like(u, 40 * frame)], axis=-1).astype(np.uint8)


def time_s(frame: int) -> float:
    """When a frame was taken."""
    return frame / FPS
