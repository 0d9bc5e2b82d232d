"""Frames as functions of landmarks (paper, section 3.1; the recipe is ISB's, see anatomy.Frame)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adapt.anatomy import Anatomy, Floats, Frame
from adapt.model.variation import Line, Motion, Points
from capture.rigid import hat


def landmark_mean(anatomy: Anatomy, p: Points, names: tuple[str, ...]) -> tuple[Floats, Floats]:
    """Mean of some landmarks: the point (3,) and its derivative (3, n)."""
    index = [anatomy.landmark_index(name) for name in names]
    return p.value[index].sum(axis=0) / len(index), p.d[index].sum(axis=0) / len(index)


def line_through(anatomy: Anatomy, axis: tuple[str, str], landmarks: Floats) -> tuple[Floats, Floats]:
    """A point (3,) and the direction (3,) of the line through two of the landmarks (P, 3), from the first."""
    first, second = (landmarks[anatomy.landmark_index(name)] for name in axis)
    return first, (second - first) / np.linalg.norm(second - first)


def varying_line(anatomy: Anatomy, axis: tuple[str, str], p: Points) -> Line:
    """The same of landmarks that vary."""
    first, second = (anatomy.landmark_index(name) for name in axis)
    direction, d_direction = unit(p.value[second] - p.value[first], p.d[second] - p.d[first])
    return Line(p.value[first], direction, p.d[first], d_direction)


def frame_from_landmarks(anatomy: Anatomy, frame: Frame, p: Points) -> Motion:
    """The frame C(p) as a motion from its own coordinates to those of the landmarks.

    With u = y_to - y_from and w = z_to - z_from:  y = u / |u|,  z = (w - (w.y) y) / |...|,  x = y x z.
    """
    origin, d_origin = landmark_mean(anatomy, p, frame.origin)
    u, du = _difference(anatomy, p, frame.y_from, frame.y_to)
    w, dw = _difference(anatomy, p, frame.z_from, frame.z_to)
    y, dy = unit(u, du)
    across = w - (w @ y) * y
    length, k = np.sqrt(across @ across), hat(y)
    z = across / length
    x = k @ z
    about_y = (x @ dw - (w @ y) * (x @ dy)) / length
    d_rotation = k @ dy + y[:, None] * about_y
    return Motion(np.column_stack([x, y, z]), origin, d_rotation, d_origin)


def mirrored_frame(frame: Frame) -> Frame:
    """The other side's: of mirrored landmarks a right-handed frame, z from the opposite ends (adapt.mirror)."""
    return replace(frame, z_from=frame.z_to, z_to=frame.z_from)


def unit(u: Floats, du: Floats) -> tuple[Floats, Floats]:
    """u / |u| (3,) and its derivative (3, n)."""
    length = np.sqrt(u @ u)
    direction = u / length
    return direction, (du - direction[:, None] * (direction @ du)) / length


def _difference(anatomy: Anatomy, p: Points, start: tuple[str, ...], end: tuple[str, ...]) -> tuple[Floats, Floats]:
    first, d_first = landmark_mean(anatomy, p, start)
    last, d_last = landmark_mean(anatomy, p, end)
    return last - first, d_last - d_first
