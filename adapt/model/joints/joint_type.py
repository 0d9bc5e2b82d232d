"""What a type of joint states about itself: nothing else in the package tests a type's name."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np

from adapt.anatomy import Anatomy, Floats, Joint
from adapt.model.arc import Arc
from adapt.model.compiled.rows import Row
from adapt.model.derivatives import Motion, Points, compose
from adapt.model.frames import mirrored_frame
from adapt.model.joints.opensim import OsimJoint, Resting


class JointType(ABC):
    """One type of joint. A new one is a file with a subclass, and its line in ``JOINT_TYPES``."""

    name: ClassVar[str]
    units: ClassVar[tuple[Literal["rad", "m"], ...]]  # of its coordinates
    axes: ClassVar[int] = 0  # how many
    free: ClassVar[bool] = False  # whether the coordinates place the child in the recording: it has no parent
    reaches: ClassVar[bool] = False  # whether the child reaches to a second bone, the joint's ``other``
    holds: ClassVar[bool] = False  # whether it holds something besides its ranges, which ``held`` tells
    arched: ClassVar[bool] = False  # whether an arc leads from the parent to the child, which ``arc`` tells
    child_carries_centre: ClassVar[bool] = False  # as well as the parent: the child only turns about it
    rotation_vector: ClassVar[tuple[int, ...]] = ()  # which coordinates are one: they neither add nor subtract
    turned_over: ClassVar[tuple[int, ...]] = ()  # which coordinates change their signs in the mirror image

    def problem(self, joint: Joint) -> str | None:
        """Why these parts make no joint of this type, or None."""
        if (len(joint.coordinates), len(joint.axes)) != (len(self.units), self.axes):
            return f"a joint of type {self.name} has {len(self.units)} coordinate(s) and {self.axes} axes"
        if self.free != (joint.parent is None):
            return "a free joint has no parent, and every other has one"
        if self.reaches != (joint.other is not None):
            return f"a joint of type {self.name} has {'an' if self.reaches else 'no'} other bone"
        return self.knots_problem(joint)

    def knots_problem(self, joint: Joint) -> str | None:
        """The same for knots and frames, of which most types have none."""
        return f"a joint of type {self.name} has no knots and no frames" if joint.knots or joint.frames else None

    @abstractmethod
    def motion(self, anatomy: Anatomy, joint: Joint, q: Floats, p: Points, columns: list[int]) -> Motion:
        """H in rest space at the coordinates ``q`` (rad, m), whose derivatives are those ``columns``; I at rest."""

    def carried(
        self, anatomy: Anatomy, joint: Joint, q: Floats, p: Points, columns: list[int], motions: Mapping[str, Motion]
    ) -> Motion:
        """T_child, given the motions of the bones that are placed before it: as a rule T_parent H."""
        motion = self.motion(anatomy, joint, q, p, columns)
        return motion if joint.parent is None else compose(motions[joint.parent], motion)

    def held(self, anatomy: Anatomy, joint: Joint, p: Points, motions: Mapping[str, Motion]) -> tuple[float, Floats]:
        """Of a joint that ``holds``: how far off it is, in standard deviations, with the derivative (n,) of that."""
        raise NotImplementedError(f"a joint of type {self.name} holds nothing")

    def arc(self, anatomy: Anatomy, joint: Joint, p: Points) -> Arc:
        """Of a joint that is ``arched``: the arc at rest, on shares of which bones and skin may ride."""
        raise NotImplementedError(f"a joint of type {self.name} has no arc")

    @abstractmethod
    def rows(self, anatomy: Anatomy, joint: Joint, p: Points) -> list[Row]:
        """The same motion for the compiled chain, each row after the one before, varying as the landmarks do."""

    def rest(self, anatomy: Anatomy, joint: Joint, p: Points) -> Floats:
        """The coordinates (rad, m) of a body with landmarks p where H = I: as a rule the template's."""
        return rest_values(anatomy, joint)

    def reported(self, joint: Joint, q: Floats) -> dict[str, Floats]:
        """Values (T, k) of the coordinates as named columns (T,) in degrees and metres; NaN stays NaN."""
        columns = zip(joint.coordinates, self.units, q.T, strict=True)
        return {name: np.rad2deg(values) if unit == "rad" else values for name, unit, values in columns}

    def mirrored(self, joint: Joint) -> Joint:
        """The other side's joint (adapt.mirror): axes from the opposite ends, frames with z from the opposite ends."""
        axes = tuple((second, first) for first, second in joint.axes)
        return replace(joint, axes=axes, frames=tuple(mirrored_frame(frame) for frame in joint.frames))

    @abstractmethod
    def in_opensim(self, rest: Resting, joint: Joint, *, follows: bool) -> tuple[OsimJoint, ...]:
        """Its form in OpenSim; ``follows``: coordinates are a joint's before, which followers are held equal to."""

    def opensim_followers(
        self, anatomy: Anatomy, joint: Joint, p: Floats, transforms: Mapping[str, Floats]
    ) -> dict[str, Floats]:
        """Values (T,) in degrees of what that form has besides the coordinates, from bones' transforms (T, 4, 4).

        ``p`` (P, 3) are the landmarks at rest.
        """
        return {}

    def opensim_owners(self, joint: Joint) -> dict[str, str]:
        """The coordinates of that form, under names of no followers, and the joint of that form that has each."""
        return dict.fromkeys(joint.coordinates, joint.name)


def rest_values(anatomy: Anatomy, joint: Joint) -> Floats:
    """The values of a joint's coordinates (rad, m) in the template's rest pose.

    >>> from adapt.anatomy_file import load_anatomy
    >>> arm = load_anatomy("upper-limb-right")
    >>> np.rad2deg(rest_values(arm, arm.joint("elbow"))).round(1).tolist()
    [41.1]
    """
    return np.array([anatomy.coordinates[anatomy.coordinate_index(name)].rest for name in joint.coordinates])
