"""The anatomy's joints as OpenSim has them: offset frames on both bodies and functions of coordinates between.

A body's frame is the bone's ISB frame F_b. With J the joint's frame in rest space, OpenSim's joint places the child as

    F_parent^-1 H(q) F_child = P X(q) C^-1

where H is the joint's motion in rest space (adapt.model.joints), P and C are the offset frames, and X is what the
joint's own functions make of the coordinates: body-fixed turns about three axes, then a shift in P.

- free: body-fixed X-Y-Z angles and a translation, which ``track.angles`` reports: what OpenSim's FreeJoint does, but
  as a CustomJoint of six linear functions, because nimblephysics knows no FreeJoint.
- hinge: PinJoint about P's z axis.
- universal: CustomJoint whose functions are the coordinates. Its axes meet in one point; ours miss each other by
  hundredths of a millimetre in bodies of unusual proportions, and the point nearest to all is taken.
- ball: the same for the first two coordinates, to a phantom body without extent, and from there a PinJoint for the
  third. One CustomJoint would do for OpenSim; nimblephysics turns three times about axes at right angles only, from
  which those of an adapted hip are off by some hundredths of a degree.
- spline: CustomJoint with SimmSplines sampled from ours. The first turn is the coordinate itself, about the line for
  which that is most nearly so, because OpenSim treats a coordinate that turns nothing in proportion as ``Coupled`` and
  leaves it in radians where a file says degrees.

OpenSim's joints do not share coordinates: a joint that follows another's (a kneecap the knee's) gets a coordinate of
its own, ``<coordinate>_beta`` as in OpenSim's models, and a CoordinateCouplerConstraint holds it equal.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from adapt.anatomy import Anatomy, Floats, Joint
from adapt.model.body import Body, rest_theta
from adapt.model.frames import frame_from_landmarks
from adapt.model.joints import joint_motion
from adapt.model.variation import constant_points
from capture.rigid import exp_so3, inverse, transform
from track.angles import euler_angles, euler_names

_MARGIN = 0.3  # rad beyond a coordinate's range and knots that a spline's samples reach
_SPACING = np.deg2rad(2.0)  # of a spline's samples


@dataclass(frozen=True)
class OsimCoordinate:
    """One coordinate of the model; radians and metres."""

    name: str
    low: float
    high: float
    default: float


@dataclass(frozen=True, eq=False)
class TransformAxis:
    """A turn about or a shift along ``axis`` of P: zero without a coordinate, else it or its function."""

    axis: Floats
    coordinate: str | None = None
    x: Floats | None = field(default=None, repr=False)  # (N,) rad; None: the function is the coordinate itself
    y: Floats | None = field(default=None, repr=False)  # (N,) rad or m


@dataclass(frozen=True, eq=False)
class OsimJoint:
    """``kind`` is OpenSim's class; ``axes`` are a CustomJoint's three turns and three shifts, else nothing."""

    kind: str
    name: str
    parent: str | None
    child: str
    in_parent: Floats  # P (4, 4), on the parent's body frame
    in_child: Floats  # C (4, 4), on the child's
    coordinates: tuple[OsimCoordinate, ...]
    axes: tuple[TransformAxis, ...] = ()


def body_frames(body: Body) -> dict[str, Floats]:
    """F_b (4, 4) at rest of every bone: what the model's body frames are."""
    return {b.name: frame_from_landmarks(body.anatomy, b.frame, body.p).matrix() for b in body.anatomy.bones}


def coupled_coordinates(anatomy: Anatomy) -> dict[str, str]:
    """The model's coordinates that only follow another: dependent name to independent name."""
    seen: set[str] = set()
    coupled: dict[str, str] = {}
    for joint in anatomy.joints:
        coupled |= {f"{name}_beta": name for name in joint.coordinates if name in seen}
        seen |= set(joint.coordinates)
    return coupled


def joints_of_coordinates(anatomy: Anatomy) -> dict[str, str]:
    """Every coordinate of the model, and the joint it belongs to."""
    owner: dict[str, str] = {}
    for joint in anatomy.joints:
        names = joint.coordinates if joint.type != "free" else (*euler_names(joint), *joint.coordinates[3:])
        owner |= {f"{name}_beta" if name in owner else name: joint.name for name in names}
        if joint.type == "ball":
            owner[names[2]] = _third(joint)
    return owner


def osim_joints(body: Body) -> list[OsimJoint]:
    """All joints of a body, parents before their children."""
    frames, theta = body_frames(body), rest_theta(body)
    seen: set[str] = set()
    joints: list[OsimJoint] = []
    for joint in body.anatomy.joints:
        follows = bool(seen & set(joint.coordinates))
        joints += _osim_joint(body, joint, frames, theta, follows)
        seen |= set(joint.coordinates)
    return joints


def _osim_joint(
    body: Body, joint: Joint, frames: dict[str, Floats], theta: Floats, follows: bool
) -> tuple[OsimJoint, ...]:
    if joint.type == "free":
        return (_free(body.anatomy, joint, theta),)
    to_parent, to_child = inverse(frames[joint.parent or ""]), inverse(frames[joint.child])
    coordinates = _coordinates(body.anatomy, joint, theta, suffix="_beta" if follows else "")
    axes: tuple[TransformAxis, ...] = ()
    match joint.type:
        case "hinge":
            kind, (placed, turned) = "PinJoint", _pin(body, joint, coordinates[0].default)
        case "universal" | "ball":
            kind, (placed, turned, axes) = "CustomJoint", _turns(body, joint, coordinates)
        case "spline":
            kind, (placed, turned, axes) = "CustomJoint", _spline(body, joint, theta, coordinates[0], follows)
        case _:
            raise AssertionError(joint.type)
    whole = OsimJoint(
        kind, joint.name, joint.parent, joint.child, to_parent @ placed, to_child @ turned, coordinates, axes
    )
    return _parted(whole, joint) if joint.type == "ball" else (whole,)


def _third(joint: Joint) -> str:
    """The name of the joint of a ball joint's third coordinate."""
    return f"{joint.name}_third"


def _parted(whole: OsimJoint, joint: Joint) -> tuple[OsimJoint, OsimJoint]:
    """A joint of three turns as one of two, to a phantom, and one of the third; with Z the turn from z to its axis,

    P R(a1, q1) R(a2, q2) R(a3, q3) C^-1 = (P R(a1, q1) R(a2, q2)) (Z R(z, q3) (C Z)^-1).
    """
    first, second, third, *shifts = whole.axes
    still = TransformAxis(_unit(np.cross(first.axis, second.axis)))
    to_axis = transform(Rotation.align_vectors([third.axis], [[0.0, 0.0, 1.0]])[0].as_matrix(), np.zeros(3))
    phantom = f"{joint.name}_phantom"
    two = replace(
        whole,
        child=phantom,
        in_child=np.eye(4),
        coordinates=whole.coordinates[:2],
        axes=(first, second, still, *shifts),
    )
    last = OsimJoint(
        "PinJoint", _third(joint), phantom, whole.child, to_axis, whole.in_child @ to_axis, whole.coordinates[2:]
    )
    return two, last


def _coordinates(anatomy: Anatomy, joint: Joint, theta: Floats, *, suffix: str = "") -> tuple[OsimCoordinate, ...]:
    index = [anatomy.coordinate_index(name) for name in joint.coordinates]
    own = [anatomy.coordinates[i] for i in index]
    return tuple(
        OsimCoordinate(c.name + suffix, c.low, c.high, float(theta[i])) for c, i in zip(own, index, strict=True)
    )


def _free(anatomy: Anatomy, joint: Joint, theta: Floats) -> OsimJoint:
    """Body-fixed X-Y-Z angles instead of the rotation vector; every coordinate is its own function."""
    coordinates = _coordinates(anatomy, joint, theta)
    angles = euler_angles(theta[None, [anatomy.coordinate_index(name) for name in joint.coordinates[:3]]])[0]
    turns = (
        OsimCoordinate(name, c.low, c.high, float(angle))
        for name, c, angle in zip(euler_names(joint), coordinates, angles, strict=False)
    )
    own = (*turns, *coordinates[3:])
    axes = tuple(TransformAxis(axis, c.name) for axis, c in zip([*np.eye(3), *np.eye(3)], own, strict=True))
    return OsimJoint("CustomJoint", joint.name, None, joint.child, np.eye(4), np.eye(4), own, axes)


def _pin(body: Body, joint: Joint, rest: float) -> tuple[Floats, Floats]:
    """P and C in rest space: z along the axis, and C turned back so that zero is the coordinate's own."""
    (point, axis), *_ = _lines(body, joint)
    placed = transform(Rotation.align_vectors([axis], [[0.0, 0.0, 1.0]])[0].as_matrix(), point)
    return placed, placed @ transform(exp_so3(np.array([0.0, 0.0, rest])), np.zeros(3))


def _turns(
    body: Body, joint: Joint, coordinates: tuple[OsimCoordinate, ...]
) -> tuple[Floats, Floats, tuple[TransformAxis, ...]]:
    """P and C in rest space, and the axes, where every coordinate is zero.

    R(a1, q1 - r1) R(a2, q2 - r2) ... = R(a1, q1) R(B1 a2, q2) ... B with B1 = R(a1, -r1) and so on.
    """
    lines = _lines(body, joint)
    placed = transform(np.eye(3), _nearest_point(lines))
    back, axes = np.eye(3), []
    for (_, axis), coordinate in zip(lines, coordinates, strict=True):
        axes.append(TransformAxis(back @ axis, coordinate.name))
        back = back @ exp_so3(-coordinate.default * axis)
    if len(axes) == 2:
        axes.append(TransformAxis(_unit(np.cross(axes[0].axis, axes[1].axis))))
    turned = placed @ transform(back.T, np.zeros(3))
    return placed, turned, (*axes, *(TransformAxis(axis) for axis in np.eye(3)))


def _spline(
    body: Body, joint: Joint, theta: Floats, coordinate: OsimCoordinate, follows: bool
) -> tuple[Floats, Floats, tuple[TransformAxis, ...]]:
    """P and C in rest space, and six functions sampled from our spline; shifts are zero at rest."""
    low, high = min(coordinate.low, joint.knots[0]) - _MARGIN, max(coordinate.high, joint.knots[-1]) + _MARGIN
    q = np.linspace(low, high, round((high - low) / _SPACING) + 1)
    motions = _sampled_motions(body, joint, theta, q)
    p_turn, c_turn = _main_axis(motions[:, :3, :3])
    if not follows:
        p_turn, c_turn = _axis_turned_in_proportion(motions[:, :3, :3], q, p_turn, c_turn)
    angles = np.unwrap(_seen_from(p_turn, motions[:, :3, :3], c_turn).as_euler("XYZ"), axis=0)
    if not follows:  # with the coordinate itself as first turn: what it lacks is put into P
        offset = float((angles[:, 0] - q).mean())
        p_turn = p_turn * Rotation.from_rotvec([offset, 0.0, 0.0])
        angles[:, 0] = q
    centre = frame_from_landmarks(body.anatomy, joint.frames[0], body.p).translation
    placed, turned = (transform(turn.as_matrix(), centre) for turn in (p_turn, c_turn))
    shifts = (motions[:, :3, :3] @ centre + motions[:, :3, 3] - centre) @ placed[:3, :3]
    functions = [TransformAxis(axis, coordinate.name, q, y) for axis, y in zip(np.eye(3), angles.T, strict=True)]
    if not follows:
        functions[0] = TransformAxis(np.eye(3)[0], coordinate.name)
    functions += [TransformAxis(axis, coordinate.name, q, y) for axis, y in zip(np.eye(3), shifts.T, strict=True)]
    return placed, turned, tuple(functions)


def _sampled_motions(body: Body, joint: Joint, theta: Floats, q: Floats) -> Floats:
    """H (N, 4, 4) in rest space where the joint's coordinate is ``q`` (N,)."""
    index = body.anatomy.coordinate_index(joint.coordinates[0])
    p = constant_points(body.p.value, len(theta))
    poses = np.tile(theta, (len(q), 1))
    poses[:, index] = q
    return np.array([joint_motion(body.anatomy, joint, pose, p, 0).matrix() for pose in poses])


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


def _lines(body: Body, joint: Joint) -> list[tuple[Floats, Floats]]:
    """The joint's axes at rest: a point (3,) and a direction (3,) of each."""
    points = body.p.value
    ends = [[points[body.anatomy.landmark_index(name)] for name in axis] for axis in joint.axes]
    return [(first, _unit(second - first)) for first, second in ends]


def _nearest_point(lines: list[tuple[Floats, Floats]]) -> Floats:
    """The point (3,) with the least sum of squared distances to lines that are not all parallel."""
    across = [np.eye(3) - np.outer(axis, axis) for _, axis in lines]
    along = [square @ point for square, (point, _) in zip(across, lines, strict=True)]
    return np.asarray(np.linalg.solve(np.sum(across, axis=0), np.sum(along, axis=0)))


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.linalg.norm(vector))
