"""A body laid out in arrays for the compiled loops: everything that does not depend on the pose."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.model.deformers import DEFORMER_TYPES, Bound
from adapt.model.hot.chain import Chain
from adapt.model.hot.rows import Row
from adapt.model.hot.skin import BoundSkin
from adapt.model.joints import JOINT_TYPES
from adapt.model.variation import Points, constant_points


def prepare_chain(anatomy: Anatomy, landmarks: Floats) -> Chain:
    """The joints of an anatomy whose landmarks (P, 3) stand where a body's shape has put them."""
    steps = list(_steps(anatomy, constant_points(landmarks, 0)))
    rows = [step.row for step in steps]
    widest = max(len(row.knots) for row in rows)
    return Chain(
        kind=np.array([row.kind for row in rows]),
        before=np.array([step.before for step in steps]),
        bone=np.array([step.bone for step in steps]),
        coordinates=np.array([np.resize(step.coordinates, 6) for step in steps]),
        rest=np.array([row.rest for row in rows]),
        point=np.array([row.point for row in rows]),
        direction=np.array([row.direction for row in rows]),
        turn=np.array([row.turn for row in rows]),
        shift=np.array([row.shift for row in rows]),
        knots=np.array([np.pad(row.knots, (0, widest - len(row.knots)), mode="edge") for row in rows]),
        pieces=np.array([_padded(row.pieces, widest - 1) for row in rows]),
        after_rotation=np.array([row.after.rotation for row in rows]),
        after_translation=np.array([row.after.translation for row in rows]),
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
    for d, (deformer, one) in enumerate(zip(anatomy.deformers, bound, strict=True)):
        laid = DEFORMER_TYPES[deformer.type].layout(one)
        skin.kind[d], skin.local[d], skin.t[d], skin.width[d] = laid.kind, laid.local, laid.t, laid.width
        skin.axis[d] = laid.axis
        for end, frame in enumerate(laid.ends):
            skin.frame_rotation[d, end], skin.frame_translation[d, end] = frame.rotation, frame.translation
    return skin


class _Step(NamedTuple):
    """One row, and between which bones it stands."""

    before: int
    bone: int
    coordinates: tuple[int, ...]  # where q stands in theta
    row: Row


def _steps(anatomy: Anatomy, p: Points) -> Iterator[_Step]:
    order = [bone.name for bone in anatomy.bones]
    for joint in anatomy.joints:
        index = [anatomy.coordinate_index(name) for name in joint.coordinates]
        bone, before = order.index(joint.child), -1 if joint.parent is None else order.index(joint.parent)
        for row in JOINT_TYPES[joint.type].rows(anatomy, joint, p):
            yield _Step(before, bone, tuple(index[k] for k in row.coordinates), row)
            before = bone


def _padded(pieces: Floats, count: int) -> Floats:
    """Cubics (4, K, 6), filled up with the last one."""
    return np.asarray(np.pad(pieces, ((0, 0), (0, count - pieces.shape[1]), (0, 0)), mode="edge"))
