"""What a type of joint states about itself: nothing else in the package tests a type's name."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, Literal

import numpy as np

from adapt.anatomy import Anatomy, Floats, Joint
from adapt.model.variation import Motion, Points


class JointType(ABC):
    """One type of joint. A new one is a file with a subclass, and its line in ``JOINT_TYPES``."""

    name: ClassVar[str]
    units: ClassVar[tuple[Literal["rad", "m"], ...]]  # of its coordinates
    axes: ClassVar[int] = 0  # how many
    free: ClassVar[bool] = False  # whether the coordinates place the child in the recording: it has no parent

    @abstractmethod
    def motion(self, anatomy: Anatomy, joint: Joint, q: Floats, p: Points, columns: list[int]) -> Motion:
        """H in rest space at the coordinates ``q`` (rad, m), whose derivatives are those ``columns``; I at rest."""


def rest_values(anatomy: Anatomy, joint: Joint) -> Floats:
    """The values of a joint's coordinates (rad, m) in the template's rest pose."""
    return np.array([anatomy.coordinates[anatomy.coordinate_index(name)].rest for name in joint.coordinates])
