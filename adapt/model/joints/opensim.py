"""A joint's form in OpenSim: offset frames on both bodies and functions of coordinates between.

A body's frame is the bone's ISB frame F_b. With H the joint's motion in rest space, OpenSim's joint places the child as

    F_parent^-1 H(q) F_child = P X(q) C^-1

where P and C are the offset frames, and X is what the joint's own functions make of the coordinates: body-fixed turns
about three axes, then a shift in P.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from adapt.anatomy import Anatomy, Floats, Joint
from adapt.model.derivatives import Points
from adapt.model.frames import line_through
from capture.rigid import inverse, transform

_NOTHING: Mapping[str, tuple[float, ...]] = {}
FOLLOWER = "_beta"  # ends the name of a coordinate that only follows another, as in OpenSim's models


@dataclass(frozen=True)
class OsimCoordinate:
    """One coordinate of the model; radians and metres. One that is locked stands still: none of ours is meant."""

    name: str
    low: float
    high: float
    default: float
    locked: bool = False


@dataclass(frozen=True, eq=False)
class TransformAxis:
    """A turn about or a shift along ``axis`` of P: zero without a coordinate, else it or its function."""

    axis: Floats
    coordinate: str | None = None
    x: Floats | None = field(default=None, repr=False)  # (N,) rad; None: the function is the coordinate itself
    y: Floats | None = field(default=None, repr=False)  # (N,) rad or m


@dataclass(frozen=True, eq=False)
class OsimJoint:
    """``kind`` is OpenSim's class; ``axes`` are a CustomJoint's three turns and three shifts, else nothing.

    ``own`` are numbers that a class has and others have not, by the names that OpenSim's files give them.
    """

    kind: str
    name: str
    parent: str | None
    child: str
    in_parent: Floats  # P (4, 4), on the parent's body frame
    in_child: Floats  # C (4, 4), on the child's
    coordinates: tuple[OsimCoordinate, ...]
    axes: tuple[TransformAxis, ...] = ()
    own: Mapping[str, tuple[float, ...]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Resting:
    """A body at rest, whose joints are to be written: landmarks p, pose theta (n,), F_b (4, 4) of every bone."""

    anatomy: Anatomy
    p: Points
    theta: Floats
    frames: Mapping[str, Floats]

    def coordinates(self, joint: Joint, *, follows: bool = False) -> tuple[OsimCoordinate, ...]:
        """The joint's coordinates, under names of followers where it shares them with a joint before."""
        index = [self.anatomy.coordinate_index(name) for name in joint.coordinates]
        own, suffix = [self.anatomy.coordinates[i] for i in index], FOLLOWER if follows else ""
        return tuple(
            OsimCoordinate(c.name + suffix, c.low, c.high, float(self.theta[i]))
            for c, i in zip(own, index, strict=True)
        )

    def lines(self, joint: Joint) -> list[tuple[Floats, Floats]]:
        """The joint's axes: a point (3,) and a direction (3,) of each."""
        return [line_through(self.anatomy, axis, self.p.value) for axis in joint.axes]

    def joint(
        self,
        kind: str,
        joint: Joint,
        placed: Floats,
        turned: Floats,
        coordinates: tuple[OsimCoordinate, ...],
        axes: tuple[TransformAxis, ...] = (),
        own: Mapping[str, tuple[float, ...]] = _NOTHING,
    ) -> OsimJoint:
        """The joint whose P and C (4, 4) in rest space are ``placed`` and ``turned``."""
        to_parent, to_child = inverse(self.frames[joint.parent or ""]), inverse(self.frames[joint.child])
        name, parent, child = joint.name, joint.parent, joint.child
        return OsimJoint(kind, name, parent, child, to_parent @ placed, to_child @ turned, coordinates, axes, own)


def along_z(axis: Floats) -> Floats:
    """A rotation (3, 3) whose z is ``axis`` (3,).

    >>> along_z(np.array([1.0, 0.0, 0.0]))[:, 2].round(6).tolist()
    [1.0, 0.0, 0.0]
    """
    return np.asarray(Rotation.align_vectors([axis], [[0.0, 0.0, 1.0]])[0].as_matrix())


def still_axes() -> tuple[TransformAxis, ...]:
    """Three turns or shifts by nothing."""
    return tuple(TransformAxis(axis) for axis in np.eye(3))


def sampled(
    motions: Floats, q: Floats, centre: Floats, coordinate: str, *, follows: bool
) -> tuple[Floats, Floats, tuple[TransformAxis, ...]]:
    """P and C in rest space, and six functions through H (N, 4, 4) where a coordinate is ``q`` (N,); at rest H is I.

    ``centre`` (3,) is where the frames stand. The first turn is the coordinate itself, about the line for which that is
    most nearly so, because OpenSim treats a coordinate that turns nothing in proportion as ``Coupled`` and leaves it in
    radians where a file says degrees; a follower is left there anyway.
    """
    p_turn, c_turn = _main_axis(motions[:, :3, :3])
    if not follows:
        p_turn, c_turn = _axis_turned_in_proportion(motions[:, :3, :3], q, p_turn, c_turn)
    angles = np.unwrap(_seen_from(p_turn, motions[:, :3, :3], c_turn).as_euler("XYZ"), axis=0)
    if not follows:  # with the coordinate itself as first turn: what it lacks is put into P
        offset = float((angles[:, 0] - q).mean())
        p_turn = p_turn * Rotation.from_rotvec([offset, 0.0, 0.0])
        angles[:, 0] = q
    placed, turned = (transform(turn.as_matrix(), centre) for turn in (p_turn, c_turn))
    shifts = (motions[:, :3, :3] @ centre + motions[:, :3, 3] - centre) @ placed[:3, :3]
    functions = [TransformAxis(axis, coordinate, q, y) for axis, y in zip(np.eye(3), angles.T, strict=True)]
    if not follows:
        functions[0] = TransformAxis(np.eye(3)[0], coordinate)
    functions += [TransformAxis(axis, coordinate, q, y) for axis, y in zip(np.eye(3), shifts.T, strict=True)]
    return placed, turned, tuple(functions)


def nearest_point(lines: list[tuple[Floats, Floats]]) -> Floats:
    """The point (3,) with the least sum of squared distances to lines that are not all parallel.

    >>> x, y, above = np.eye(3)[0], np.eye(3)[1], np.array([0.0, 0.0, 0.2])
    >>> nearest_point([(np.zeros(3), x), (above, y)]).tolist()  # half-way between two lines that miss each other
    [0.0, 0.0, 0.1]
    """
    across = [np.eye(3) - np.outer(axis, axis) for _, axis in lines]
    along = [square @ point for square, (point, _) in zip(across, lines, strict=True)]
    return np.asarray(np.linalg.solve(np.sum(across, axis=0), np.sum(along, axis=0)))


def unit_vector(vector: Floats) -> Floats:
    """A vector (3,) at the length of one.

    >>> unit_vector(np.array([0.0, 3.0, 4.0])).tolist()
    [0.0, 0.6, 0.8]
    """
    return np.asarray(vector / np.linalg.norm(vector))


def _main_axis(turns: Floats) -> tuple[Rotation, Rotation]:
    """Axes of P and C whose x is the axis of the whole turn from the first to the last of ``turns`` (N, 3, 3)."""
    whole = Rotation.from_matrix(turns[-1] @ turns[0].T).as_rotvec()
    p_turn = Rotation.align_vectors([whole], [[1.0, 0.0, 0.0]])[0]
    return p_turn, Rotation.from_matrix(turns[0]).inv() * p_turn


def _axis_turned_in_proportion(
    turns: Floats, q: Floats, p_turn: Rotation, c_turn: Rotation
) -> tuple[Rotation, Rotation]:
    """Axes of P and C near the given ones for which the first X-Y-Z angle of turns (N, 3, 3) is most nearly ``q`` (N,).

    min over P, C of |f1(q) - q - mean|^2, where f are the angles of P^T R(q) C; the better of two starts, which differ
    by a quarter turn about x: which axis is turned about second.
    """

    def off_proportion(x: Floats) -> Floats:
        angles = _seen_from(Rotation.from_rotvec(x[:3]), turns, Rotation.from_rotvec(x[3:])).as_euler("XYZ")
        off = np.unwrap(angles[:, 0]) - q
        return np.asarray(off - off.mean())

    quarters = [Rotation.from_rotvec([turn, 0.0, 0.0]) for turn in (0.0, np.pi / 2.0)]
    starts = [np.concatenate([(p_turn * q).as_rotvec(), (c_turn * q).as_rotvec()]) for q in quarters]
    # The residuals are of 1e-4 rad: the usual tolerances would stop too early.
    fits = [least_squares(off_proportion, start, ftol=1e-10, xtol=1e-10, gtol=1e-14) for start in starts]
    best = min(fits, key=lambda fit: float(fit.cost)).x
    return Rotation.from_rotvec(best[:3]), Rotation.from_rotvec(best[3:])


def _seen_from(p_turn: Rotation, turns: Floats, c_turn: Rotation) -> Rotation:
    return p_turn.inv() * Rotation.from_matrix(turns) * c_turn
