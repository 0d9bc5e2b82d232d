"""Frames as functions of landmarks (paper, section 3.1; the recipe is ISB's, see anatomy.Frame)."""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Anatomy, Floats, Frame
from adapt.model.variation import Motion, Points, cross_columns


def landmark_mean(anatomy: Anatomy, p: Points, names: tuple[str, ...]) -> tuple[Floats, Floats]:
    """Mean of some landmarks: the point (3,) and its derivative (3, n)."""
    index = [anatomy.landmark_index(name) for name in names]
    return p.value[index].mean(axis=0), p.d[index].mean(axis=0)


def frame_from_landmarks(anatomy: Anatomy, frame: Frame, p: Points) -> Motion:
    """The frame C(p) as a motion from its own coordinates to those of the landmarks.

    With u = y_to - y_from and w = z_to - z_from:  y = u / |u|,  z = (w - (w.y) y) / |...|,  x = y x z.
    """
    origin, d_origin = landmark_mean(anatomy, p, frame.origin)
    u, du = _difference(anatomy, p, frame.y_from, frame.y_to)
    w, dw = _difference(anatomy, p, frame.z_from, frame.z_to)
    rotation, d_rotation = rotations_from_directions(u, du, w, dw)
    return Motion(rotation, origin, d_rotation, d_origin)


def rotations_from_directions(u: Floats, du: Floats, w: Floats, dw: Floats) -> tuple[Floats, Floats]:
    """The rotation (..., 3, 3) of a frame, or of several, from u and w (..., 3), and its derivative (..., 3, n)."""
    y, dy = unit(u, du)
    along = np.sum(w * y, axis=-1, keepdims=True)
    across = w - along * y
    length = np.linalg.norm(across, axis=-1, keepdims=True)
    z = across / length
    x = np.cross(y, z)
    about_y = (x[..., None, :] @ (dw - along[..., None] * dy)) / length[..., None]
    return np.stack([x, y, z], axis=-1), cross_columns(y[..., None], dy) + y[..., None] * about_y


def unit(u: Floats, du: Floats) -> tuple[Floats, Floats]:
    """u / |u| (..., 3) and its derivative (..., 3, n)."""
    length = np.linalg.norm(u, axis=-1, keepdims=True)
    direction = u / length
    along = direction[..., None, :] @ du
    return direction, (du - direction[..., None] * along) / length[..., None]


def _difference(anatomy: Anatomy, p: Points, start: tuple[str, ...], end: tuple[str, ...]) -> tuple[Floats, Floats]:
    first, d_first = landmark_mean(anatomy, p, start)
    last, d_last = landmark_mean(anatomy, p, end)
    return last - first, d_last - d_first
