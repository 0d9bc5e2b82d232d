"""Depth images of analytic surfaces, exact or quantised like a structured-light sensor's."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from capture.camera import Camera, ray_slopes

STEP = 0.0029  # of depth readings at 1 m (1 / m)


def rays(camera: Camera) -> NDArray[np.float64]:
    """Ray of each pixel (H, W, 3), z = 1."""
    slopes = ray_slopes(camera).astype(np.float64)
    return np.concatenate([slopes, np.ones((*slopes.shape[:2], 1))], axis=-1)


def quantised(depth: NDArray[np.floating]) -> NDArray[np.float32]:
    """Readings on even steps of inverse depth, ``STEP * z**2`` apart."""
    with np.errstate(divide="ignore"):
        levels = np.rint(1.0 / depth / STEP)
    return np.where(depth > 0, 1.0 / (levels * STEP), 0.0).astype(np.float32)


def sphere(camera: Camera, centre: NDArray[np.float64], radius: float) -> NDArray[np.float64]:
    """Depth (H, W) of a sphere (0 beside it)."""
    ray = rays(camera)
    a, b = (ray**2).sum(-1), ray @ centre
    inside = b**2 - a * (centre @ centre - radius**2)
    return np.where(inside > 0, (b - np.sqrt(np.maximum(inside, 0))) / a, 0.0)


def cylinder(
    camera: Camera, centre: NDArray[np.float64], axis: NDArray[np.float64], radius: float
) -> NDArray[np.float64]:
    """Depth (H, W) of an endless cylinder (0 beside it)."""
    across = np.eye(3) - np.outer(axis, axis) / (axis @ axis)
    ray, middle = rays(camera) @ across, across @ centre
    a, b = (ray**2).sum(-1), ray @ middle
    inside = b**2 - a * (middle @ middle - radius**2)
    return np.where(inside > 0, (b - np.sqrt(np.maximum(inside, 0))) / a, 0.0)


def plane(camera: Camera, normal: NDArray[np.float64], point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Depth (H, W) of a plane."""
    return (normal @ point) / (rays(camera) @ normal)
