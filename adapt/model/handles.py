"""Anthropometric deformation by point handles (paper, section 3.2), and the affine set A it lives in.

A handle h scales uniformly about its position and translates: x -> s_h (x - h) + h + t_h. The parameters of
all H handles are a (H, 4) = [s, tx, ty, tz]; the identity is s = 1, t = 0. Handles of one joint must act as
one similarity, (s - 1)(h2 - h1) = t2 - t1 with one s (equation 4): the joint cannot dislocate. Those
constraints are eliminated exactly: ``shape`` (4 per joint: one scale, one translation) are the free parameters.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.model.variation import Points


@dataclass(frozen=True)
class AffineSet:
    """A = {origin + basis @ shape}: every handle setting (4H,) that keeps the joints together.

    ``shape`` is (J, 4) flattened, [s, tx, ty, tz] per group of handles in the order of ``groups``; the
    similarity of a group is x -> s (x - centre) + centre + t.
    """

    groups: tuple[str, ...]
    centres: Floats  # (J, 3) m
    origin: Floats  # (4H,)
    basis: Floats  # (4H, 4J)

    @property
    def identity(self) -> Floats:
        """The shape (4J,) that leaves the template as it is."""
        return np.tile([1.0, 0.0, 0.0, 0.0], len(self.groups))

    def handle_parameters(self, shape: Floats) -> Floats:
        """a (H, 4) of a shape (4J,)."""
        return np.asarray(self.origin + self.basis @ shape).reshape(-1, 4)


def affine_set(anatomy: Anatomy) -> AffineSet:
    """The affine set A of an anatomy: a_h = (s, (s - 1)(h - centre) + t) for every handle of a group."""
    groups = tuple(dict.fromkeys(handle.joint for handle in anatomy.handles))
    positions = handle_positions(anatomy)
    member = np.array([groups.index(handle.joint) for handle in anatomy.handles])
    centres = np.array([positions[member == j].mean(axis=0) for j in range(len(groups))])
    origin = np.zeros((len(positions), 4))
    basis = np.zeros((len(positions), 4, len(groups), 4))
    for i, (position, j) in enumerate(zip(positions, member, strict=True)):
        origin[i, 1:] = centres[j] - position
        basis[i, 0, j, 0] = 1.0
        basis[i, 1:, j, 0] = position - centres[j]
        basis[i, 1:, j, 1:] = np.eye(3)
    return AffineSet(groups, centres, origin.ravel(), basis.reshape(4 * len(positions), -1))


def handle_positions(anatomy: Anatomy) -> Floats:
    """Rest positions (H, 3) of the handles in metres."""
    return np.array([handle.position for handle in anatomy.handles])


def deform(points: Floats, weights: Floats, positions: Floats, a: Floats) -> Floats:
    """Points (N, 3) moved by handles: sum_h w_h (s_h (x - h) + h + t_h); weights (N, H), a (H, 4)."""
    offsets = a[:, 1:] + (1.0 - a[:, :1]) * positions
    return np.asarray((weights @ a[:, 0])[:, None] * points + weights @ offsets)


def d_deform_d_shape(points: Floats, weights: Floats, positions: Floats, basis: Floats) -> Floats:
    """Derivative (N, 3, 4J) of ``deform`` with respect to the shape, through da = basis dshape.

    d/ds_h = w_h (x - h), d/dt_h = w_h: constant in a, because ``deform`` is affine in a.
    """
    d_shape = basis.reshape(len(positions), 4, -1)
    scale_part = weights @ d_shape[:, 0]  # (N, 4J): sum_h w_h ds_h
    offset = d_shape[:, 1:] - positions[:, :, None] * d_shape[:, None, 0]
    moved = np.tensordot(weights, offset, axes=(1, 0))  # (N, 3, 4J)
    return np.asarray(points[:, :, None] * scale_part[:, None, :] + moved)


def local_scale(weights: Floats, a: Floats) -> Floats:
    """d deform / d point is this number (N,) times the identity: sum_h w_h s_h."""
    return np.asarray(weights @ a[:, 0])


def deform_varying(points: Floats, weights: Floats, positions: Floats, a: Floats, basis: Floats) -> Points:
    """``deform`` together with its derivative with respect to the shape."""
    return Points(deform(points, weights, positions, a), d_deform_d_shape(points, weights, positions, basis))
