"""What joints share whose child is placed by three turns in one frame of landmarks.

With F(p) that frame at rest and X(q) where the coordinates put the child in it, H = F X(q) X(q_rest)^-1 F^-1: so
nothing moves at rest, whatever shape the body has.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar, Literal

from adapt.anatomy import Anatomy, Floats, Frame, Joint
from adapt.model.compiled.rows import Row, hold
from adapt.model.derivatives import Motion, Points, compose, constant_points, invert
from adapt.model.frames import frame_from_landmarks
from adapt.model.joints.joint_type import JointType, rest_values
from adapt.model.joints.opensim import Resting


class Framed(JointType):
    """A joint whose one frame is fixed in the parent; of three turns, if it says no more."""

    units: ClassVar[tuple[Literal["rad", "m"], ...]] = ("rad", "rad", "rad")

    def knots_problem(self, joint: Joint) -> str | None:
        """Why it has not one frame and no knots; None if all is well."""
        if joint.knots or len(joint.frames) != 1:
            return f"a joint of type {self.name} has one frame and no knots"
        return None

    def frame(self, anatomy: Anatomy, joint: Joint, p: Points) -> Motion:
        """F."""
        return frame_from_landmarks(anatomy, joint.frames[0], p)

    @abstractmethod
    def placed(self, anatomy: Anatomy, joint: Joint, q: Floats, p: Points, columns: Sequence[int]) -> Motion:
        """X at q (3,) rad, varying with the landmarks, and with q in those columns if there are any."""

    @abstractmethod
    def rows_inside(self, anatomy: Anatomy, joint: Joint, p: Points, after: Motion) -> list[Row]:
        """X(q) and then ``after``, for the compiled chain."""

    def motion(self, anatomy: Anatomy, joint: Joint, q: Floats, p: Points, columns: list[int]) -> Motion:
        """H = F X(q) X(q_rest)^-1 F^-1."""
        frame = self.frame(anatomy, joint, p)
        there = compose(frame, self.placed(anatomy, joint, q, p, columns))
        return compose(there, self._back(anatomy, joint, p, frame))

    def rows(self, anatomy: Anatomy, joint: Joint, p: Points) -> list[Row]:
        """F, X(q), and what lies after it."""
        frame = self.frame(anatomy, joint, p)
        return [hold(frame), *self.rows_inside(anatomy, joint, p, self._back(anatomy, joint, p, frame))]

    def offsets(self, rest: Resting, joint: Joint) -> tuple[Floats, Floats]:
        """P = F and C = F X(q_rest) (4, 4) in rest space, for OpenSim."""
        p = constant_points(rest.p.value, 1)
        frame = self.frame(rest.anatomy, joint, p)
        return frame.matrix(), invert(self._back(rest.anatomy, joint, p, frame)).matrix()

    def _back(self, anatomy: Anatomy, joint: Joint, p: Points, frame: Motion) -> Motion:
        """X(q_rest)^-1 F^-1."""
        at_rest = self.placed(anatomy, joint, rest_values(anatomy, joint), p, ())
        return invert(compose(frame, at_rest))


def turned_over(frame: Frame) -> Frame:
    """The mirror image of a frame F of mirrored landmarks in which turns keep their signs: -S F, as of axes.

    >>> turned_over(Frame(("GH",), ("AI",), ("AA",), ("TS",), ("AA",)))
    Frame(origin=('GH',), y_from=('AA',), y_to=('AI',), z_from=('AA',), z_to=('TS',))
    """
    return Frame(frame.origin, frame.y_to, frame.y_from, frame.z_to, frame.z_from)
