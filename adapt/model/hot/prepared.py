"""A body laid out in arrays for the compiled loops: everything that does not depend on the pose."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from adapt.anatomy import Anatomy, Floats, Joint
from adapt.model.deformers import Bound
from adapt.model.deformers.bend import BoundBend
from adapt.model.deformers.forearm import BoundForearm
from adapt.model.frames import frame_from_landmarks
from adapt.model.hot.chain import FREE, SPLINE, TURN, Chain
from adapt.model.hot.skin import BEND, FOREARM, RIGID, BoundSkin
from adapt.model.joints.spline import spline_cubics
from adapt.model.variation import Motion, Points, constant_points, invert


class _Step(NamedTuple):
    """One row of a Chain."""

    kind: int
    before: int
    bone: int
    coordinates: tuple[int, ...]
    rest: float
    point: Floats
    direction: Floats
    knots: Floats
    pieces: Floats
    after: Motion


_STILL = Motion(np.eye(3), np.zeros(3), np.zeros((3, 0)), np.zeros((3, 0)))
_NO_KNOTS, _NO_PIECES = np.zeros(2), np.zeros((4, 1, 6))


def prepare_chain(anatomy: Anatomy, landmarks: Floats) -> Chain:
    """The joints of an anatomy whose landmarks (P, 3) stand where a body's shape has put them."""
    order = [bone.name for bone in anatomy.bones]
    steps = [step for joint in anatomy.joints for step in _steps(anatomy, joint, landmarks, order)]
    widest = max(len(step.knots) for step in steps)
    return Chain(
        kind=np.array([step.kind for step in steps]),
        before=np.array([step.before for step in steps]),
        bone=np.array([step.bone for step in steps]),
        coordinates=np.array([np.resize(step.coordinates, 6) for step in steps]),
        rest=np.array([step.rest for step in steps]),
        point=np.array([step.point for step in steps]),
        direction=np.array([step.direction for step in steps]),
        knots=np.array([np.pad(step.knots, (0, widest - len(step.knots)), mode="edge") for step in steps]),
        pieces=np.array([_padded(step.pieces, widest - 1) for step in steps]),
        after_rotation=np.array([step.after.rotation for step in steps]),
        after_translation=np.array([step.after.translation for step in steps]),
    )


def prepare_skin(anatomy: Anatomy, bound: Sequence[Bound]) -> BoundSkin:
    """Rest skin bound to each deformer, as it is when only the pose varies."""
    order = [bone.name for bone in anatomy.bones]
    count, vertices = len(bound), len(anatomy.skin_vertices)
    skin = BoundSkin(
        kind=np.zeros(count, dtype=np.int64),
        bones=np.array([[order.index(d.bones[0]), order.index(d.bones[-1])] for d in anatomy.deformers]),
        weights=np.ascontiguousarray(anatomy.deformer_weights),
        local=np.zeros((count, vertices, 3)),
        t=np.zeros((count, vertices)),
        width=np.ones((count, vertices)),
        frame_rotation=np.tile(np.eye(3), (count, 2, 1, 1)),
        frame_translation=np.zeros((count, 2, 3)),
        axis=np.zeros((count, 3)),
    )
    for d, one in enumerate(bound):
        if isinstance(one, Points):
            skin.kind[d], skin.local[d] = RIGID, one.value
        elif isinstance(one, BoundForearm):
            skin.kind[d], skin.local[d], skin.t[d] = FOREARM, one.local.value, one.t
            for end, frame in enumerate((one.proximal, one.distal)):
                skin.frame_rotation[d, end], skin.frame_translation[d, end] = frame.rotation, frame.translation
        elif isinstance(one, BoundBend):
            skin.kind[d], skin.local[d], skin.t[d], skin.width[d] = BEND, one.skin.value, one.t, one.width
            skin.frame_translation[d], skin.axis[d] = one.centre.value[0], one.axis.value[0]
    return skin


def _steps(anatomy: Anatomy, joint: Joint, landmarks: Floats, order: list[str]) -> Iterator[_Step]:
    index = tuple(anatomy.coordinate_index(name) for name in joint.coordinates)
    bone, before = order.index(joint.child), -1 if joint.parent is None else order.index(joint.parent)
    nowhere = np.zeros(3)
    p = constant_points(landmarks, 0)
    if joint.type == "free":
        after = invert(frame_from_landmarks(anatomy, anatomy.bone(joint.child).frame, p))
        yield _Step(FREE, before, bone, index, 0.0, nowhere, nowhere, _NO_KNOTS, _NO_PIECES, after)
    elif joint.type == "spline":
        knots, pieces, after = spline_cubics(anatomy, joint, p)
        yield _Step(SPLINE, before, bone, index, 0.0, nowhere, nowhere, knots, pieces, after)
    else:
        for coordinate, axis in zip(index, joint.axes, strict=True):
            first, second = (landmarks[anatomy.landmark_index(name)] for name in axis)
            direction = (second - first) / np.linalg.norm(second - first)
            rest = anatomy.coordinates[coordinate].rest
            yield _Step(TURN, before, bone, (coordinate,), rest, first, direction, _NO_KNOTS, _NO_PIECES, _STILL)
            before = bone


def _padded(pieces: Floats, count: int) -> Floats:
    """Cubics (4, K, 6), filled up with the last one."""
    return np.asarray(np.pad(pieces, ((0, 0), (0, count - pieces.shape[1]), (0, 0)), mode="edge"))
