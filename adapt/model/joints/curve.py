"""The curve: a stretch of the spine that bends at a constant curvature and twists.

Its coordinates are a bend to the side, one forward or back, and a twist, body-fixed about x, z and y as in OpenSim's
ConstantCurvatureJoint: R = Rx(q_1) Rz(q_2) Ry(q_3). From its base the curve runs along y at first, its tangent turns
evenly in one plane by the angle a to u = R e_y, and its length l never changes. With the bend as a vector across y,
v = a (u_x, u_z) / |(u_x, u_z)|, a share s of the way is

    t(s) = l s (c v_x, sin(x) / x, c v_z),    c = (1 - cos(x)) / x^2,    x = s a
    R(s) = exp(s r) Ry(s b),    r = a e_y x v / |v| = (v_z, 0, -v_x),    R = exp(r) Ry(b)

and R(1) = R. a = atan2(|(u_x, u_z)|, u_y) holds for bends up to half a turn, at which the plane is not told any more.

The frame F at the base is made from landmarks so that the curve at rest ends where they say: a line from the base to
the top stands for the chord, which lies half-way between the tangents of both ends, and l makes it as long as that.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from adapt.anatomy import Anatomy, Floats, Joint
from adapt.model.arc import Arc, ratios
from adapt.model.compiled.rows import ARC, Row, reach, turn_about
from adapt.model.derivatives import Motion, Points, compose, invert
from adapt.model.frames import landmark_mean
from adapt.model.joints.framed import Framed
from adapt.model.joints.joint_type import rest_values
from adapt.model.joints.opensim import OsimJoint, Resting
from capture.rigid import exp_so3, left_jacobian_so3

_SMALL = 1e-3  # below this angle (rad) a series replaces the closed form
_X, _Y, _Z = np.eye(3)


class Curve(Framed):
    """Two bends and a twist (rad) about x, z and y of a frame whose y runs from the base's landmarks to the top's.

    The mirror image bends and twists to the other side.
    """

    name = "curve"
    turned_over = (0, 2)
    arched = True

    def knots_problem(self, joint: Joint) -> str | None:
        """Why it has no frame, or one that does not start at the curve's base; None if all is well."""
        problem = super().knots_problem(joint)
        if problem is None and joint.frames[0].origin != joint.frames[0].y_from:
            return "the y axis of a curve's frame runs from its origin, the base, to the top"
        return problem

    def frame(self, anatomy: Anatomy, joint: Joint, p: Points) -> Motion:
        """F: the landmarks' frame, whose y is the chord at rest, turned back by half of the bend at rest."""
        chord = super().frame(anatomy, joint, p)
        half = exp_so3(0.5 * _turn(_bend(rest_values(anatomy, joint))[0]))
        return Motion(chord.rotation @ half.T, chord.translation, chord.d_rotation, chord.d_translation)

    def placed(self, anatomy: Anatomy, joint: Joint, q: Floats, p: Points, columns: Sequence[int]) -> Motion:
        """[R(1), t(1)]."""
        return self.placed_at(anatomy, joint, q, p, columns, 1.0)

    def along(self, anatomy: Anatomy, joint: Joint, q: Floats, p: Points, columns: list[int], share: float) -> Motion:
        """H of what rides on a share of the curve: a vertebra. The base (0) stays, the top (1) goes with the child.

        ``q`` (3,) rad, and ``columns`` are those of its derivatives.
        """
        frame = self.frame(anatomy, joint, p)
        at_rest = self.placed_at(anatomy, joint, rest_values(anatomy, joint), p, (), share)
        there = compose(frame, self.placed_at(anatomy, joint, q, p, columns, share))
        return compose(there, invert(compose(frame, at_rest)))

    def arc(self, anatomy: Anatomy, joint: Joint, p: Points) -> Arc:
        """The curve at rest."""
        frame = self.frame(anatomy, joint, p)
        at_rest = self.placed_at(anatomy, joint, rest_values(anatomy, joint), p, (), 1.0)
        return Arc(frame, compose(frame, at_rest), *_length(anatomy, joint, p))

    def rows_inside(self, anatomy: Anatomy, joint: Joint, p: Points, after: Motion) -> list[Row]:
        """A shift along the arc, then the three turns."""
        length, d_length = _length(anatomy, joint, p)
        along = reach(ARC, np.full(3, length), np.tile(d_length, (3, 1)))
        return [along, turn_about(0, 0), turn_about(2, 1), turn_about(1, 2, after=after)]

    def in_opensim(self, rest: Resting, joint: Joint, *, follows: bool) -> tuple[OsimJoint, ...]:
        """ConstantCurvatureJoint, which jumps where the bend's sine is below 0.001 or above 0.999 (docs/opensim.md)."""
        coordinates = rest.coordinates(joint, follows=follows)
        length, _ = _length(rest.anatomy, joint, rest.p)
        own = {"neutral_angle_x_z_y": (0.0, 0.0, 0.0), "length": (length,)}
        return (rest.joint("ConstantCurvatureJoint", joint, *self.offsets(rest, joint), coordinates, own=own),)

    def placed_at(
        self, anatomy: Anatomy, joint: Joint, q: Floats, p: Points, columns: Sequence[int], share: float
    ) -> Motion:
        """[R(s), t(s)] in F: where the curve is, which turns with it. As for ``placed``."""
        length, d_length = _length(anatomy, joint, p)
        way, turned, by_way, by_turned = _at_share(q, share)
        d_rotation, d_translation = np.zeros((3, p.n)), np.outer(way, d_length)
        if len(columns):
            d_rotation[:, columns] = by_turned
            d_translation[:, columns] += length * by_way
        return Motion(turned, length * way, d_rotation, d_translation)


def _length(anatomy: Anatomy, joint: Joint, p: Points) -> tuple[float, Floats]:
    """l (m) of a curve whose chord at rest leads from base to top, and its derivative (n,)."""
    (frame,) = joint.frames
    (base, d_base), (top, d_top) = (landmark_mean(anatomy, p, names) for names in (frame.y_from, frame.y_to))
    chord = float(np.linalg.norm(top - base))
    half = 0.5 * float(np.linalg.norm(_bend(rest_values(anatomy, joint))[0]))
    longer = 1.0 / float(np.sinc(half / np.pi))
    return longer * chord, longer * ((top - base) @ (d_top - d_base)) / chord


def _at_share(q: Floats, share: float) -> tuple[Floats, Floats, Floats, Floats]:
    """t(s) of length 1 (3,) and R(s) (3, 3), with their derivatives (3, 3) by q, that of R(s) as an angular one."""
    v, dv = _bend(q)
    x = share * float(np.linalg.norm(v))
    sinc, versed, d_sinc, d_versed = ratios(np.array(x))
    dx = share**2 * (v @ dv)  # x dx
    way = share * np.array([share * versed * v[0], sinc, share * versed * v[1]])
    across = share * (versed * dv + np.outer(v, d_versed * dx))
    by_way = share * np.array([across[0], d_sinc * dx, across[1]])

    first, second = exp_so3(q[0] * _X), exp_so3(q[1] * _Z)
    turn, by_q = _turn(v), np.column_stack([_X, first @ _Z, first @ second @ _Y])
    untwisted = exp_so3(turn).T @ first @ second
    twist = q[2] + float(np.arctan2(untwisted[0, 2], untwisted[0, 0]))
    d_turn = np.array([dv[1], np.zeros(3), -dv[0]])
    d_twist = (first @ second @ _Y) @ (by_q - left_jacobian_so3(turn) @ d_turn)
    part = exp_so3(share * turn)
    by_turned = left_jacobian_so3(share * turn) @ (share * d_turn) + np.outer(part @ _Y, share * d_twist)
    return way, part @ exp_so3(share * twist * _Y), by_way, by_turned


def _bend(q: Floats) -> tuple[Floats, Floats]:
    """v (2,) in rad and its derivative (2, 3): v = k u_xz and dv = k du_xz + u_xz dk / du_y du_y, k = a / sin(a)."""
    sx, cx, sz, cz = np.sin(q[0]), np.cos(q[0]), np.sin(q[1]), np.cos(q[1])
    across, d_across = np.array([-sz, sx * cz]), np.array([[0.0, -cz, 0.0], [cx * cz, -sx * sz, 0.0]])
    y, dy = cx * cz, np.array([-sx * cz, -cx * sz, 0.0])
    sine = float(np.linalg.norm(across))
    a = float(np.arctan2(sine, y))
    if a < _SMALL:
        k, dk = 1.0 + a**2 / 6.0, -(1.0 / 3.0 + 2.0 * a**2 / 15.0)
    else:
        k, dk = a / sine, -(sine - a * y) / sine**3
    return k * across, k * d_across + np.outer(across, dk * dy)


def _turn(v: Floats) -> Floats:
    """r: the rotation vector that leads from e_y to u by the shortest way."""
    return np.array([v[1], 0.0, -v[0]])
