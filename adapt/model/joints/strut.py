"""The strut: a bar between two bones, such as the collar bone between breastbone and shoulder blade.

It has no coordinates. Its first end is a landmark of its parent; it points at its second end, a landmark that another
bone carries. In the frame F at the first end, with f where the second one stands and side = 1 where at rest it lies
along F's z, -1 against it:

    X = Ry(g) Rx(b) with X e_z along side * f:    g = atan2(f_x, f_z),    b = atan2(-f_y, |(f_x, f_z)|)    (of side * f)
    T_child = T_parent F X X_rest^-1 F^-1

g and b are protraction and depression; there is no third turn, about the bar, which its ends do not tell: the ISB
leaves it out, too (Wu et al. 2005). The bar does not stretch with the distance of its ends: |f| - |f_rest| is the
residual by which fits hold the other bone to where the bar lets it be (``adapt.fit.priors``).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from adapt.anatomy import Anatomy, Floats, Joint
from adapt.model.compiled.rows import Row, towards
from adapt.model.derivatives import Line, Motion, Points, compose, invert, move
from adapt.model.joints.framed import Framed, turned_over
from adapt.model.joints.opensim import OsimCoordinate, OsimJoint, Resting, TransformAxis
from capture.rigid import exp_so3, inverse

HELD_M = 0.0002
"""How exactly the bar keeps its length: one standard deviation of the ends' distance. Skin in sight pulls hard: some
tens of independent patches, each known to 2 mm, would stretch a bar that is held to a millimetre."""

_X, _Y, _Z = np.eye(3)


class Strut(Framed):
    """A bar between the landmarks of its one axis: from the parent, where its frame has its origin, to ``other``.

    The frame's y must not run along the bar.
    """

    name = "strut"
    units = ()
    axes = 1
    reaches = True
    holds = True

    def knots_problem(self, joint: Joint) -> str | None:
        """Why it has no frame, or one that does not stand at the bar's first end; None if all is well."""
        problem = super().knots_problem(joint)
        if problem is None and joint.frames[0].origin != joint.axes[0][:1]:
            return "a strut's frame has its origin at the bar's first end"
        return problem

    def placed(self, anatomy: Anatomy, joint: Joint, q: Floats, p: Points, columns: Sequence[int]) -> Motion:
        """X as long as the other bone moves with the parent."""
        return self._towards(anatomy, joint, p, self._end(anatomy, joint, p))

    def carried(
        self, anatomy: Anatomy, joint: Joint, q: Floats, p: Points, columns: list[int], motions: Mapping[str, Motion]
    ) -> Motion:
        """T_parent F X X_rest^-1 F^-1, with X towards where the other bone has carried the second end."""
        frame = self.frame(anatomy, joint, p)
        base = compose(motions[str(joint.parent)], frame)
        there = self._towards(anatomy, joint, p, self._end_among(anatomy, joint, p, motions))
        return compose(compose(base, there), self._back(anatomy, joint, p, frame))

    def held(self, anatomy: Anatomy, joint: Joint, p: Points, motions: Mapping[str, Motion]) -> tuple[float, Floats]:
        """(|f| - |f_rest|) / ``HELD_M``."""
        (now, d_now), (rest, d_rest) = (
            (float(np.linalg.norm(f.value[0])), f.value[0] @ f.d[0] / np.linalg.norm(f.value[0]))
            for f in (self._end_among(anatomy, joint, p, motions), self._end(anatomy, joint, p))
        )
        return (now - rest) / HELD_M, (d_now - d_rest) / HELD_M

    def rows_inside(self, anatomy: Anatomy, joint: Joint, p: Points, after: Motion) -> list[Row]:
        """X, which needs the other bone's motion."""
        end = anatomy.landmark_index(joint.axes[0][1])
        return [towards(Line(p.value[end], _Z, p.d[end], np.zeros((3, p.n))), self._side(anatomy, joint, p), after)]

    def mirrored(self, joint: Joint) -> Joint:
        """The frame turned over, in which turns keep their signs; the bar runs to the other side."""
        return replace(joint, frames=tuple(turned_over(frame) for frame in joint.frames))

    def in_opensim(self, rest: Resting, joint: Joint, *, follows: bool) -> tuple[OsimJoint, ...]:
        """CustomJoint of the two turns, whose values a motion's files tell: OpenSim has no such joint."""
        placed, turned = self.offsets(rest, joint)
        angles = _angles(self._side(rest.anatomy, joint, rest.p) * self._end(rest.anatomy, joint, rest.p).value)[0]
        coordinates = tuple(
            OsimCoordinate(name, -np.pi, np.pi, float(angle)) for name, angle in zip(_names(joint), angles, strict=True)
        )
        turns = tuple(TransformAxis(axis, c.name) for axis, c in zip((_Y, _X), coordinates, strict=True))
        still = (TransformAxis(_Z), *(TransformAxis(axis) for axis in np.eye(3)))
        return (rest.joint("CustomJoint", joint, placed, turned, coordinates, (*turns, *still)),)

    def opensim_owners(self, joint: Joint) -> dict[str, str]:
        """Those of the two turns."""
        return dict.fromkeys(_names(joint), joint.name)

    def opensim_followers(
        self, anatomy: Anatomy, joint: Joint, p: Floats, transforms: Mapping[str, Floats]
    ) -> dict[str, Floats]:
        """g and b."""
        rest = Points(p, np.zeros((*p.shape, 0)))
        to_frame, end = inverse(self.frame(anatomy, joint, rest).matrix()), p[anatomy.landmark_index(joint.axes[0][1])]
        parent, other = transforms[str(joint.parent)], transforms[str(joint.other)]
        apart = other[:, :3, :3] @ end + other[:, :3, 3] - parent[:, :3, 3]
        inside = np.einsum("tji,tj->ti", parent[:, :3, :3], apart) @ to_frame[:3, :3].T + to_frame[:3, 3]
        angles = np.rad2deg(_angles(self._side(anatomy, joint, rest) * inside))
        return dict(zip(_names(joint), angles.T, strict=True))

    def _end(self, anatomy: Anatomy, joint: Joint, p: Points) -> Points:
        """f at rest (1, 3)."""
        return move(invert(self.frame(anatomy, joint, p)), p.at(np.array([anatomy.landmark_index(joint.axes[0][1])])))

    def _end_among(self, anatomy: Anatomy, joint: Joint, p: Points, motions: Mapping[str, Motion]) -> Points:
        """f (1, 3) where bones have moved."""
        base = compose(motions[str(joint.parent)], self.frame(anatomy, joint, p))
        end = p.at(np.array([anatomy.landmark_index(joint.axes[0][1])]))
        return move(compose(invert(base), motions[str(joint.other)]), end)

    def _side(self, anatomy: Anatomy, joint: Joint, p: Points) -> float:
        return float(np.sign(self._end(anatomy, joint, p).value[0, 2]))

    def _towards(self, anatomy: Anatomy, joint: Joint, p: Points, end: Points) -> Motion:
        """X, whose z points at f (1, 3), or against it."""
        side = self._side(anatomy, joint, p)
        (x, y, z), (dx, dy, dz) = side * end.value[0], side * end.d[0]
        flat = float(np.hypot(x, z))
        ((about_y, about_x),) = _angles(side * end.value)
        first = exp_so3(about_y * _Y)
        d_flat = (x * dx + z * dz) / flat
        d_about_y = (z * dx - x * dz) / flat**2
        d_about_x = (y * d_flat - flat * dy) / (flat**2 + y**2)
        d_rotation = np.outer(_Y, d_about_y) + np.outer(first @ _X, d_about_x)
        return Motion(first @ exp_so3(about_x * _X), np.zeros(3), d_rotation, np.zeros_like(d_rotation))


def _angles(ends: Floats) -> Floats:
    """g and b (T, 2) rad for which Ry(g) Rx(b) e_z points at (T, 3)."""
    x, y, z = ends.T
    return np.column_stack([np.arctan2(x, z), np.arctan2(-y, np.hypot(x, z))])


def _names(joint: Joint) -> tuple[str, str]:
    return f"{joint.name}_protraction", f"{joint.name}_depression"
