"""The affine set A of an anatomy (paper, section 3.2, equation 4): shapes whose handles keep the joints together.

Handles of one joint must act as one similarity, (s - 1)(h2 - h1) = t2 - t1 with one s: the joint cannot dislocate.
Those constraints are eliminated exactly: a ``shape`` is one scale and one translation for each group of handles,
[s, tx, ty, tz] per group. Only this file knows that; whoever needs a part of a shape asks for it by name.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adapt.anatomy import Anatomy, Floats, Ints
from adapt.model.handles import handle_positions

_PER_GROUP = 4
_LEAST_SCALE = 0.1  # a joint smaller than that is outside the model's domain


@dataclass(frozen=True)
class AffineSet:
    """A = {origin + basis @ shape}: every handle setting (4H,) that keeps the joints together.

    The similarity of a group of handles is x -> s (x - centre) + centre + t; J groups, in the order of ``groups``, from
    the trunk outwards.
    """

    groups: tuple[str, ...]
    centres: Floats  # (J, 3) m
    origin: Floats  # (4H,)
    basis: Floats  # (4H, 4J)

    @property
    def identity(self) -> Floats:
        """The shape (4J,) that leaves the template as it is."""
        return self.shape(np.ones(len(self.groups)), np.zeros((len(self.groups), 3)))

    def shape(self, scales: Floats, shifts: Floats) -> Floats:
        """The shape (4J,) with these scales (J,) and shifts (J, 3) m of the groups of handles."""
        return np.column_stack([scales, shifts]).ravel()

    @property
    def scale_columns(self) -> Ints:
        """Where in a shape the groups' scales (J,) stand."""
        return np.arange(0, _PER_GROUP * len(self.groups), _PER_GROUP)

    @property
    def shift_columns(self) -> Ints:
        """Where in a shape the groups' shifts (J, 3) stand."""
        return self.scale_columns[:, None] + np.arange(1, _PER_GROUP)

    def scales(self, shape: Floats) -> Floats:
        """How many times as large as the template's the body is at each joint (J,)."""
        return shape[self.scale_columns]

    def shifts(self, shape: Floats) -> Floats:
        """How far (J, 3) m each group of handles is shifted."""
        return shape[self.shift_columns]

    def heads(self, shape: Floats) -> Floats:
        """Where the groups of handles (J, 3) m stand in the body at rest: near its joints' centres."""
        return self.centres + self.shifts(shape)

    def resized(self, shape: Floats, size: float) -> Floats:
        """The shape (4J,) ``size`` times as large; the first group of handles stays where the template has it."""
        heads = size * self.heads(shape) + (1.0 - size) * self.centres[0]
        return self.shape(size * self.scales(shape), heads - self.centres)

    def mirrored(self, shape: Floats) -> Floats:
        """The shape (4J,) of the mirror image, across z = 0, in the mirrored anatomy's affine set."""
        return self.shape(self.scales(shape), self.shifts(shape) * [1.0, 1.0, -1.0])

    def is_possible(self, shape: Floats) -> bool:
        """Whether every group of handles has a positive scale."""
        return bool((self.scales(shape) > 0.0).all())

    def nearest_possible(self, shape: Floats) -> Floats:
        """The shape (4J,) with scales that are not too small for the model."""
        return self.shape(np.maximum(self.scales(shape), _LEAST_SCALE), self.shifts(shape))

    def handle_parameters(self, shape: Floats) -> Floats:
        """a (H, 4) of a shape (4J,)."""
        return np.asarray(self.origin + self.basis @ shape).reshape(-1, 4)


def affine_set(anatomy: Anatomy) -> AffineSet:
    """The affine set A of an anatomy: a_h = (s, (s - 1)(h - centre) + t) for every handle of a group.

    >>> from adapt.anatomy_file import load_anatomy
    >>> handles = affine_set(load_anatomy("upper-limb-right"))
    >>> handles.groups, handles.basis.shape  # four numbers for each of 8 handles, four for each group
    (('shoulder', 'elbow', 'wrist', 'knuckles'), (32, 16))
    """
    groups = tuple(dict.fromkeys(handle.joint for handle in anatomy.handles))
    positions = handle_positions(anatomy)
    member = np.array([groups.index(handle.joint) for handle in anatomy.handles])
    centres = np.array([positions[member == j].mean(axis=0) for j in range(len(groups))])
    origin = np.zeros((len(positions), 4))
    basis = np.zeros((len(positions), 4, len(groups), _PER_GROUP))
    for i, (position, j) in enumerate(zip(positions, member, strict=True)):
        origin[i, 1:] = centres[j] - position
        basis[i, 0, j, 0] = 1.0
        basis[i, 1:, j, 0] = position - centres[j]
        basis[i, 1:, j, 1:] = np.eye(3)
    return AffineSet(groups, centres, origin.ravel(), basis.reshape(4 * len(positions), -1))
