"""The spline joint (paper, section 3.6): a child that glides along landmarks of its parent, such as a knee.

Where the coordinate q equals knot i, a frame of the child coincides with a frame C_i(p) = [R_i, o_i] of the parent's
landmarks: its origin o_i is the control point on the joint's surface, one of its axes the normal there. Between:

    o(q) = sum_i o_i b_i(q)                      the paper's t(q): the centre of rotation cancels, as sum b_i = 1
    r(q) = sum_i r_i b_i(q),  r_i = log(R_i R_0^T)     the paper's angle between the normals n_i and n_0, in space
    G(q) = [exp(r(q)), o(q)],   H = G(q) G(q_rest)^-1

b_i are the cubic splines (not-a-knot) that are 1 at knot i and 0 at the others; beyond the knots they go on in
straight lines. A similarity of all landmarks scales the shifts and leaves the angles; a mirror image of the landmarks
gives the mirrored motion.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline

from adapt.anatomy import Anatomy, Floats, Ints, Joint
from adapt.model.compiled.rows import Row, glide
from adapt.model.derivatives import Motion, Points, compose, constant_points, invert
from adapt.model.frames import frame_from_landmarks
from adapt.model.joints.joint_type import JointType
from adapt.model.joints.opensim import OsimJoint, Resting, sampled
from capture.errors import AnatomyError
from capture.rigid import exp_so3, hat, left_jacobian_so3, log_so3

_WIDEST = np.deg2rad(170.0)  # a turn from the first frame must stay clear of half a turn, where r_i jumps

_MARGIN = 0.3  # rad beyond a coordinate's range and knots that samples for OpenSim reach
_SPACING = np.deg2rad(2.0)  # of these samples


@dataclass(frozen=True, eq=False)
class _Prepared:
    """What does not change with pose and body: which landmarks (U,), and how K frames are made of them."""

    landmarks: Ints
    means: Floats = field(repr=False)  # (5, K, U): origin, y_from, y_to, z_from, z_to as means of landmarks
    basis: CubicSpline = field(repr=False)  # q to b (K,)
    rest: float  # rad


@dataclass(frozen=True, eq=False)
class _Controls:
    """Control values r_i (rad) and o_i (m) at K knots with their derivatives by n parameters."""

    r: Floats  # (K, 3)
    dr: Floats  # (K, 3n)
    o: Floats  # (K, 3)
    do: Floats  # (K, 3n)


class Spline(JointType):
    """One coordinate (rad): where it equals knot i, a frame of the child coincides with frame i of the parent."""

    name = "spline"
    units = ("rad",)

    def knots_problem(self, joint: Joint) -> str | None:
        """Why the knots (rad) have no frames, or are too few or out of order; None if all is well."""
        if len(joint.knots) != len(joint.frames) or not joint.knots:
            return "a spline joint has one frame a knot"
        if len(joint.knots) < 2 or not (np.diff(joint.knots) > 0.0).all():
            return "a spline joint needs two knots or more that increase"
        return None

    def motion(self, anatomy: Anatomy, joint: Joint, q: Floats, p: Points, columns: list[int]) -> Motion:
        """H at the coordinate's value.

        Raises:
            AnatomyError: frames that are none, or turned by half a turn against the first.
        """
        prepared = _prepare(anatomy, joint)
        value, d = p.value[prepared.landmarks], p.d[prepared.landmarks]
        if d.any():
            controls, to_rest = _controls_and_rest(prepared, value, d)
        else:  # pose after pose of one body
            controls, to_rest = _of_still_landmarks(anatomy, joint, value.tobytes(), p.n)
        return compose(_along(prepared.basis, controls, float(q[0]), columns[0]), to_rest)

    def rows(self, anatomy: Anatomy, joint: Joint, p: Points) -> list[Row]:
        """G(q) as cubics of r and o, before G(q_rest)^-1."""
        prepared = _prepare(anatomy, joint)
        controls, to_rest = _controls_and_rest(prepared, p.value[prepared.landmarks], p.d[prepared.landmarks])
        cubics = prepared.basis.c @ np.concatenate([controls.r, controls.o], axis=1)
        varying = prepared.basis.c @ np.concatenate([controls.dr, controls.do], axis=1)
        return [glide(prepared.basis.x, cubics, varying.reshape(*cubics.shape, p.n), to_rest)]

    def in_opensim(self, rest: Resting, joint: Joint, *, follows: bool) -> tuple[OsimJoint, ...]:
        """CustomJoint with SimmSplines sampled from ours; shifts are zero at rest."""
        (coordinate,) = coordinates = rest.coordinates(joint, follows=follows)
        low, high = min(coordinate.low, joint.knots[0]) - _MARGIN, max(coordinate.high, joint.knots[-1]) + _MARGIN
        q = np.linspace(low, high, round((high - low) / _SPACING) + 1)
        p = constant_points(rest.p.value, 1)
        motions = np.array([self.motion(rest.anatomy, joint, at, p, [0]).matrix() for at in q[:, None]])
        centre = frame_from_landmarks(rest.anatomy, joint.frames[0], p).translation
        placed, turned, axes = sampled(motions, q, centre, coordinate.name, follows=follows)
        return (rest.joint("CustomJoint", joint, placed, turned, coordinates, axes),)


def _along(basis: CubicSpline, controls: _Controls, q: float, column: int | None) -> Motion:
    """G(q), varying with the landmarks and, if given a column, with q."""
    b, slope = basis_at(basis, q)
    r, dr, do = b @ controls.r, (b @ controls.dr).reshape(3, -1), (b @ controls.do).reshape(3, -1)
    if column is not None:
        dr[:, column] += slope @ controls.r
        do[:, column] += slope @ controls.o
    return Motion(exp_so3(r), b @ controls.o, left_jacobian_so3(r) @ dr, do)


def basis_at(basis: CubicSpline, q: float) -> tuple[Floats, Floats]:
    """b(q) and its slope (K,), in straight lines beyond the outermost knots.

    >>> parabola = CubicSpline([0.0, 1.0, 2.0], [0.0, 1.0, 4.0])
    >>> [round(float(value), 6) for value in basis_at(parabola, 3.0)]  # the parabola itself would be at 9 by then
    [8.0, 4.0]
    """
    nearest = float(np.clip(q, basis.x[0], basis.x[-1]))
    slope = basis(nearest, 1)
    return basis(nearest) + (q - nearest) * slope, slope


def _controls(prepared: _Prepared, landmarks: Floats, d: Floats) -> _Controls:
    """Control values from the landmarks (U, 3) that the joint uses, which vary as ``d`` (U, 3, n) says."""
    o, y_from, y_to, z_from, z_to = prepared.means @ landmarks
    do, dy_from, dy_to, dz_from, dz_to = np.tensordot(prepared.means, d, axes=1)
    rotation, d_rotation = _rotations(y_to - y_from, dy_to - dy_from, z_to - z_from, dz_to - dz_from)
    turn = rotation @ rotation[0].T
    r = log_so3(turn)
    dr = np.linalg.solve(left_jacobian_so3(r), d_rotation - turn @ d_rotation[0])
    return _Controls(r, dr.reshape(len(r), -1), o, do.reshape(len(r), -1))


def _controls_and_rest(prepared: _Prepared, landmarks: Floats, d: Floats) -> tuple[_Controls, Motion]:
    """What does not change with the pose: the control values, and G(q_rest)^-1."""
    controls = _controls(prepared, landmarks, d)
    return controls, invert(_along(prepared.basis, controls, prepared.rest, None))


def _rotations(u: Floats, du: Floats, w: Floats, dw: Floats) -> tuple[Floats, Floats]:
    """What ``frame_from_landmarks`` does with one u and w, for K at once: R (K, 3, 3), and its derivative (K, 3, n)."""
    y, dy = _units(u, du)
    along = np.sum(w * y, axis=1, keepdims=True)
    across = w - along * y
    length = np.linalg.norm(across, axis=1, keepdims=True)
    z = across / length
    x = np.cross(y, z)
    about_y = (x[:, None, :] @ (dw - along[:, :, None] * dy)) / length[:, :, None]
    return np.stack([x, y, z], axis=-1), hat(y) @ dy + y[:, :, None] * about_y


def _units(u: Floats, du: Floats) -> tuple[Floats, Floats]:
    """u / |u| (K, 3) and its derivative (K, 3, n)."""
    length = np.linalg.norm(u, axis=1, keepdims=True)
    direction = u / length
    return direction, (du - direction[:, :, None] * (direction[:, None, :] @ du)) / length[:, :, None]


@lru_cache(maxsize=8)
def _of_still_landmarks(anatomy: Anatomy, joint: Joint, landmarks: bytes, n: int) -> tuple[_Controls, Motion]:
    """The same for landmarks (U, 3), given as their bytes, that vary with none of n parameters."""
    points = np.frombuffer(landmarks).reshape(-1, 3)
    return _controls_and_rest(_prepare(anatomy, joint), points, np.zeros((*points.shape, n)))


@lru_cache(maxsize=8)
def _prepare(anatomy: Anatomy, joint: Joint) -> _Prepared:
    roles = [
        [getattr(frame, role) for frame in joint.frames] for role in ("origin", "y_from", "y_to", "z_from", "z_to")
    ]
    used = list(dict.fromkeys(name for role in roles for names in role for name in names))
    means = np.array([[[names.count(u) / len(names) for u in used] for names in role] for role in roles])
    landmarks = np.array([anatomy.landmark_index(name) for name in used])
    rest = anatomy.coordinates[anatomy.coordinate_index(joint.coordinates[0])].rest
    prepared = _Prepared(landmarks, means, CubicSpline(joint.knots, np.eye(len(joint.knots))), rest)
    _check_frames(prepared, anatomy.landmarks[landmarks], joint)
    return prepared


def _check_frames(prepared: _Prepared, landmarks: Floats, joint: Joint) -> None:
    _, y_from, y_to, z_from, z_to = prepared.means @ landmarks
    if (np.linalg.norm(np.cross(y_to - y_from, z_to - z_from), axis=1) == 0.0).any():
        raise AnatomyError(
            "a frame's landmarks lie on a line", where=f"joint {joint.name}", remedy="mend the anatomy's data"
        )
    turns = _controls(prepared, landmarks, np.zeros((*landmarks.shape, 0))).r
    if (np.linalg.norm(turns, axis=1) > _WIDEST).any():
        raise AnatomyError(
            "its frames turn by half a turn", where=f"joint {joint.name}", remedy="order them from one end"
        )
