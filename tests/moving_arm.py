"""A limb made of primitives, curved and unlike its own mirror images, for recordings that tests simulate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from capture.rigid import exp_so3

Floats = NDArray[np.float64]

_RINGS, _SIDES = 24, 20


def arm_motion(count: int) -> tuple[list[Floats], NDArray[np.int64], list[float]]:
    """Vertices (V, 3) m of ``count`` frames, faces (F, 3), times (s): it bends, twists and swings."""
    times = np.arange(count) / 30.0
    phases = np.linspace(0.0, 1.0, count)
    return [_arm(phase) for phase in phases], _tube_faces(), times.tolist()


def _arm(phase: float) -> Floats:
    """A bent tapering tube from the shoulder (origin) down, with a flat paddle of a hand at its end."""
    along = np.linspace(0.0, 1.0, _RINGS)
    bend = np.deg2rad(50.0 + 50.0 * phase) / (1.0 + np.exp(-(along - 0.5) * 25.0))
    tangent = np.column_stack([np.sin(bend), -np.cos(bend), np.zeros(_RINGS)])
    centre = np.vstack([np.zeros(3), np.cumsum(tangent[:-1], axis=0)]) * 0.6 / (_RINGS - 1)
    width = np.interp(
        along, (0.0, 0.02, 0.3, 0.5, 0.6, 0.85, 0.98, 1.0), (0.0, 0.05, 0.055, 0.04, 0.045, 0.04, 0.04, 0)
    )
    depth = np.interp(along, (0.0, 0.02, 0.3, 0.5, 0.6, 0.85, 0.98, 1.0), (0.0, 0.05, 0.05, 0.04, 0.04, 0.015, 0.01, 0))
    side = np.column_stack([np.cos(bend), np.sin(bend), np.zeros(_RINGS)])
    angles = np.arange(_SIDES) * 2.0 * np.pi / _SIDES
    ring = width[:, None, None] * np.cos(angles)[:, None] * side[:, None, :]
    ring = ring + depth[:, None, None] * np.sin(angles)[:, None] * np.array([0.0, 0.0, 1.0])
    points = (centre[:, None, :] + ring).reshape(-1, 3)
    swing = exp_so3(np.array([0.5 * phase, 0.9 * phase - 0.3, -0.4 * phase]))
    return np.asarray(points @ swing.T)


def _tube_faces() -> NDArray[np.int64]:
    ring, side = np.meshgrid(np.arange(_RINGS - 1), np.arange(_SIDES), indexing="ij")
    a = (ring * _SIDES + side).ravel()
    b = (ring * _SIDES + (side + 1) % _SIDES).ravel()
    return np.concatenate([np.column_stack([a, b, a + _SIDES]), np.column_stack([b, b + _SIDES, a + _SIDES])])
