"""Anthropometric deformation by point handles (paper, section 3.2).

A handle h scales uniformly about its position and translates: x -> s_h (x - h) + h + t_h. The parameters of
all H handles are a (H, 4) = [s, tx, ty, tz]; the identity is s = 1, t = 0. Which of them keep the joints together, and
the free numbers of a body's shape: ``adapt.model.shape``.
"""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.model.derivatives import Points


def handle_positions(anatomy: Anatomy) -> Floats:
    """Rest positions (H, 3) of the handles in metres."""
    return np.array([handle.position for handle in anatomy.handles])


def deform(points: Floats, weights: Floats, positions: Floats, a: Floats) -> Floats:
    """Points (N, 3) moved by handles: sum_h w_h (s_h (x - h) + h + t_h); weights (N, H), a (H, 4).

    >>> point, position = np.array([[0.0, 0.1, 0.0]]), np.zeros((1, 3))
    >>> deform(point, np.ones((1, 1)), position, np.array([[2.0, 0.0, 0.0, 0.3]])).tolist()  # twice as far, then 0.3 m
    [[0.0, 0.2, 0.3]]
    """
    offsets = a[:, 1:] + (1.0 - a[:, :1]) * positions
    return np.asarray((weights @ a[:, 0])[:, None] * points + weights @ offsets)


def d_deform_d_shape(points: Floats, weights: Floats, positions: Floats, basis: Floats) -> Floats:
    """Derivative (N, 3, 4J) of ``deform`` with respect to the shape, through da = basis dshape.

    d/ds_h = w_h (x - h), d/dt_h = w_h: constant in a, because ``deform`` is affine in a.

    >>> point, position, basis = np.array([[0.0, 0.1, 0.0]]), np.zeros((1, 3)), np.eye(4)  # one handle
    >>> d_deform_d_shape(point, np.ones((1, 1)), position, basis)[0].tolist()  # by its scale, then by its shift
    [[0.0, 1.0, 0.0, 0.0], [0.1, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
    """
    d_shape = basis.reshape(len(positions), 4, -1)
    scale_part = weights @ d_shape[:, 0]  # (N, 4J): sum_h w_h ds_h
    offset = d_shape[:, 1:] - positions[:, :, None] * d_shape[:, None, 0]
    moved = np.tensordot(weights, offset, axes=(1, 0))  # (N, 3, 4J)
    return np.asarray(points[:, :, None] * scale_part[:, None, :] + moved)


def local_scale(weights: Floats, a: Floats) -> Floats:
    """d deform / d point is this number (N,) times the identity: sum_h w_h s_h.

    >>> local_scale(np.array([[0.5, 0.5]]), np.array([[1.0, 0.0, 0.0, 0.0], [1.2, 0.0, 0.0, 0.0]])).tolist()
    [1.1]
    """
    return np.asarray(weights @ a[:, 0])


def deform_varying(points: Floats, weights: Floats, positions: Floats, a: Floats, basis: Floats) -> Points:
    """``deform`` together with its derivative with respect to the shape."""
    return Points(deform(points, weights, positions, a), d_deform_d_shape(points, weights, positions, basis))
