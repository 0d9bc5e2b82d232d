"""The source skeleton: bodies, hinges and bone meshes of PyPI ``myo-sim`` (Apache-2.0).

Every body has its own frame; at the zero of all joints the frames of an arm or a leg are parallel, with OpenSim's
axes (X forward, Y up, Z right). Lengths in metres.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from contextlib import chdir
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adapt.template_builder.meshes import Mesh, joined, parts_of
from capture.errors import AnatomyError
from capture.rigid import exp_so3

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

PACKAGE = "myo-sim"
MODEL = "myofullbody"

BONE_GEOMETRY = (
    "those bones' surfaces before that",
    "the bone geometry of OpenSim (the OpenSim Development Team, opensim.stanford.edu), which the models share that "
    f"the package was converted from, as the NOTICE of PyPI `musclemimic-models` 1.0.6 tells of `{PACKAGE}`",
    "CC BY 3.0",
)
"""A row of a record's sources: what, from where, under which licence."""


@dataclass(frozen=True)
class SourceHinge:
    """A turn about ``axis`` (3,), through the origin of the body that owns it; range in rad."""

    name: str
    axis: Floats
    low: float
    high: float


@dataclass(frozen=True)
class Follow:
    """How a body follows one angle by a table instead of its hinges.

    ``in_parent`` gives the body's place in its parent (4, 4) for the angle (rad) named ``angle``; ``anchor`` (m, in
    the body's frame) is the point that is to stay where the parent has it when parent and body are scaled apart.
    ``alignment`` turns the body about its anchor besides: how its bone grew, not how it moves.
    """

    angle: str
    in_parent: Callable[[float], Floats]
    anchor: tuple[float, float, float]
    alignment: tuple[SourceHinge, ...] = ()


@dataclass(frozen=True)
class StatedJoint:
    """Where a body's origin sits in its parent (m), and its hinges in order, when a plan states them itself."""

    position: tuple[float, float, float]
    hinges: tuple[SourceHinge, ...]


@dataclass(frozen=True)
class SourceBody:
    """One body: where it sits in its parent at zero, its hinges in order, and its bone in the body's frame."""

    name: str
    parent: str
    position: Floats  # (3,) m, in the parent's frame
    rotation: Floats  # (3, 3), to the parent's frame, with all hinges at zero
    hinges: tuple[SourceHinge, ...]
    vertices: Floats = field(repr=False)  # (N, 3) m
    faces: Ints = field(repr=False)  # (M, 3), outward
    follow: Follow | None = None

    def in_parent(self, angles: dict[str, float]) -> tuple[Floats, Floats]:
        """Rotation (3, 3) to the parent and place (3,) m in it, for angles by name (rad; missing ones are 0)."""
        if self.follow is None:
            return self.rotation @ _turned(self.hinges, angles), self.position
        placed, anchor = self.follow.in_parent(angles.get(self.follow.angle, 0.0)), self.anchor()
        turn = _turned(self.follow.alignment, angles)
        return placed[:3, :3] @ turn, placed[:3, :3] @ (anchor - turn @ anchor) + placed[:3, 3]

    def anchor(self) -> Floats:
        """The point (3,) m of the body that its parent holds, whatever the scales."""
        return np.zeros(3) if self.follow is None else np.array(self.follow.anchor)


@dataclass(frozen=True)
class Piece:
    """Some connected parts of a body as a body of its own: those whose middles lie in [low, high) (m) along ``axis``.

    ``origin`` (m, in the whole's frame) becomes the origin, about which ``hinges`` turn the piece.
    """

    name: str
    whole: str
    axis: int
    low: float
    high: float
    origin: tuple[float, float, float]
    hinges: tuple[SourceHinge, ...]


@dataclass(frozen=True)
class SourceSkeleton:
    """The bodies that were asked for, parents before children, and the release they were read from."""

    release: str
    bodies: dict[str, SourceBody]


def _turned(hinges: tuple[SourceHinge, ...], angles: dict[str, float]) -> Floats:
    rotation = np.eye(3)
    for hinge in hinges:
        rotation = rotation @ exp_so3(hinge.axis * angles.get(hinge.name, 0.0))
    return rotation


def in_pieces(skeleton: SourceSkeleton, pieces: tuple[Piece, ...]) -> SourceSkeleton:
    """The skeleton with some bodies replaced by their pieces, which stand as the whole does with its hinges at zero."""
    bodies = {name: body for name, body in skeleton.bodies.items() if name not in {piece.whole for piece in pieces}}
    for piece in pieces:
        whole, origin = skeleton.bodies[piece.whole], np.array(piece.origin)
        parts = [
            part
            for part in parts_of(Mesh(whole.vertices, whole.faces))
            if piece.low <= part.vertices.mean(axis=0)[piece.axis] < piece.high
        ]
        mesh = joined(parts)
        position = whole.position + whole.rotation @ origin
        bodies[piece.name] = SourceBody(
            piece.name, whole.parent, position, whole.rotation, piece.hinges, mesh.vertices - origin, mesh.faces
        )
    return replace(skeleton, bodies=bodies)


def load_skeleton(
    names: tuple[str, ...], *, without: tuple[str, ...] = (), follows: dict[str, Follow] | None = None
) -> SourceSkeleton:
    """Read bodies by name, ``without`` some of their meshes; some follow tables.

    Raises:
        AnatomyError: the package or a body is missing.
    """
    try:
        import mujoco
        import myo_sim
    except ImportError as error:
        raise AnatomyError("the bone source is not installed", remedy="pip install 'bonetrack[build]'") from error
    with warnings.catch_warnings(), TemporaryDirectory() as scratch, chdir(scratch):
        warnings.simplefilter("ignore")  # the package warns about its own composition, and MuJoCo logs where it runs
        model, _ = myo_sim.load(MODEL)
    bodies = {}
    for name in names:
        index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
        if index < 0:
            raise AnatomyError(f"no body {name!r}", where=f"{PACKAGE} {MODEL}", remedy="use the tested release")
        bodies[name] = replace(_body(model, index, name, without), follow=(follows or {}).get(name))
    return SourceSkeleton(release=version(PACKAGE), bodies=bodies)


def restated(skeleton: SourceSkeleton, joints: Mapping[str, StatedJoint]) -> SourceSkeleton:
    """The skeleton with the joints of some bodies, by name, where a plan states them; their bones keep their frames."""
    bodies = {
        name: replace(body, position=np.array(joints[name].position), hinges=joints[name].hinges)
        if name in joints
        else body
        for name, body in skeleton.bodies.items()
    }
    return replace(skeleton, bodies=bodies)


def shifted(skeleton: SourceSkeleton, shifts: dict[str, tuple[float, float, float]]) -> SourceSkeleton:
    """The skeleton with some bodies moved (m) in their parents' frames."""
    moved = {
        name: replace(body, position=body.position + np.array(shifts.get(name, (0.0, 0.0, 0.0))))
        for name, body in skeleton.bodies.items()
    }
    return replace(skeleton, bodies=moved)


def _body(model: Any, index: int, name: str, without: tuple[str, ...]) -> SourceBody:
    import mujoco

    m = model
    parent = mujoco.mj_id2name(m, mujoco.mjtObj.mjOBJ_BODY, int(m.body_parentid[index]))
    joints = np.flatnonzero(m.jnt_bodyid == index)
    hinges = tuple(
        SourceHinge(
            mujoco.mj_id2name(m, mujoco.mjtObj.mjOBJ_JOINT, int(j)),
            np.array(m.jnt_axis[j]),
            float(m.jnt_range[j, 0]),
            float(m.jnt_range[j, 1]),
        )
        for j in joints
    )
    vertices, faces = _bone_mesh(m, index, without)
    position, quaternion = m.body_pos[index], m.body_quat[index]
    return SourceBody(name, parent, np.array(position), _matrix(quaternion), hinges, vertices, faces)


def _bone_mesh(model: Any, body: int, without: tuple[str, ...]) -> tuple[Floats, Ints]:
    """The mesh geometry of a body, without some meshes by name, as one mesh in the body's frame."""
    import mujoco

    m = model
    vertices, faces, count = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], 0
    for geom in np.flatnonzero(m.geom_bodyid == body):
        mesh = int(m.geom_dataid[geom])
        if mesh < 0 or mujoco.mj_id2name(m, mujoco.mjtObj.mjOBJ_MESH, mesh) in without:
            continue
        first, length = m.mesh_vertadr[mesh], m.mesh_vertnum[mesh]
        points = np.asarray(m.mesh_vert[first : first + length], dtype=np.float64)
        placed = points @ _matrix(m.geom_quat[geom]).T + m.geom_pos[geom]
        start, number = m.mesh_faceadr[mesh], m.mesh_facenum[mesh]
        vertices.append(placed)
        faces.append(np.asarray(m.mesh_face[start : start + number], dtype=np.int64) + count)
        count += len(placed)
    return np.concatenate(vertices), np.concatenate(faces)


def _matrix(quaternion: Floats) -> Floats:
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_quat([x, y, z, w]).as_matrix())
