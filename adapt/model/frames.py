"""Frames as functions of landmarks (paper, section 3.1; the recipe is ISB's, see anatomy.Frame)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adapt.anatomy import Anatomy, Floats, Frame
from adapt.model.derivatives import Line, Motion, Points
from capture.rigid import hat


def landmark_mean(anatomy: Anatomy, p: Points, names: tuple[str, ...]) -> tuple[Floats, Floats]:
    """Mean of some landmarks: the point (3,) and its derivative (3, n).

    >>> from adapt.anatomy_file import load_anatomy
    >>> arm = load_anatomy("upper-limb-right")
    >>> p = Points(arm.landmarks, np.zeros((*arm.landmarks.shape, 2)))
    >>> middle, derivative = landmark_mean(arm, p, ("EM", "EL"))
    >>> np.allclose(middle, (p.value[1] + p.value[2]) / 2.0), derivative.shape
    (True, (3, 2))
    """
    index = [anatomy.landmark_index(name) for name in names]
    return p.value[index].sum(axis=0) / len(index), p.d[index].sum(axis=0) / len(index)


def line_through(anatomy: Anatomy, axis: tuple[str, str], landmarks: Floats) -> tuple[Floats, Floats]:
    """A point (3,) and the direction (3,) of the line through two of the landmarks (P, 3), from the first.

    >>> from adapt.anatomy_file import load_anatomy
    >>> arm = load_anatomy("upper-limb-right")
    >>> _, direction = line_through(arm, ("GH", "EM"), arm.landmarks)
    >>> round(float(direction[1]), 1)  # y is up, and from the shoulder to the elbow it goes down
    -0.8
    """
    first, second = (landmarks[anatomy.landmark_index(name)] for name in axis)
    return first, (second - first) / np.linalg.norm(second - first)


def varying_line(anatomy: Anatomy, axis: tuple[str, str], p: Points) -> Line:
    """The same of landmarks that vary.

    >>> from adapt.anatomy_file import load_anatomy
    >>> from adapt.model.derivatives import constant_points
    >>> arm = load_anatomy("upper-limb-right")
    >>> varying_line(arm, ("EM", "EL"), constant_points(arm.landmarks, 5)).d_direction.shape
    (3, 5)
    """
    first, second = (anatomy.landmark_index(name) for name in axis)
    direction, d_direction = unit(p.value[second] - p.value[first], p.d[second] - p.d[first])
    return Line(p.value[first], direction, p.d[first], d_direction)


def frame_from_landmarks(anatomy: Anatomy, frame: Frame, p: Points) -> Motion:
    """The frame C(p) as a motion from its own coordinates to those of the landmarks.

    With u = y_to - y_from and w = z_to - z_from:  y = u / |u|,  z = (w - (w.y) y) / |...|,  x = y x z.

    >>> from adapt.anatomy_file import load_anatomy
    >>> from adapt.model.derivatives import constant_points
    >>> arm = load_anatomy("upper-limb-right")
    >>> p = constant_points(arm.landmarks, 1)
    >>> frame = frame_from_landmarks(arm, arm.bone("humerus").frame, p)
    >>> round(float(frame.rotation[1, 1]), 1), round(float(np.linalg.det(frame.rotation)), 6)
    (0.8, 1.0)
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
    """The other side's: of mirrored landmarks a right-handed frame, z from the opposite ends (adapt.mirror).

    >>> mirrored_frame(Frame(("GH",), ("EM", "EL"), ("GH",), ("EM",), ("EL",)))
    Frame(origin=('GH',), y_from=('EM', 'EL'), y_to=('GH',), z_from=('EL',), z_to=('EM',))
    """
    return replace(frame, z_from=frame.z_to, z_to=frame.z_from)


def unit(u: Floats, du: Floats) -> tuple[Floats, Floats]:
    """u / |u| (3,) and its derivative (3, n).

    >>> direction, derivative = unit(np.array([0.0, 0.0, 2.0]), np.eye(3))
    >>> direction.tolist(), derivative.tolist()
    ([0.0, 0.0, 1.0], [[0.5, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.0]])
    """
    length = np.sqrt(u @ u)
    direction = u / length
    return direction, (du - direction[:, None] * (direction @ du)) / length


def _difference(anatomy: Anatomy, p: Points, start: tuple[str, ...], end: tuple[str, ...]) -> tuple[Floats, Floats]:
    first, d_first = landmark_mean(anatomy, p, start)
    last, d_last = landmark_mean(anatomy, p, end)
    return last - first, d_last - d_first
