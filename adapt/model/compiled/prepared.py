"""A body laid out in arrays for the compiled loops: everything that does not depend on the pose."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.model.compiled.at_rest import put_into_frames
from adapt.model.compiled.layout import BoundSkin, Varying
from adapt.model.compiled.links import Chain
from adapt.model.compiled.rows import Row
from adapt.model.compiled.runs import varying_runs
from adapt.model.deformers import DEFORMER_TYPES
from adapt.model.derivatives import Points
from adapt.model.joints import JOINT_TYPES


def prepare_chain(anatomy: Anatomy, p: Points) -> Chain:
    """The joints of an anatomy whose landmarks (P, 3) stand where a body's shape has put them, and vary as they say."""
    steps = list(_steps(anatomy, p))
    rows = [step.row for step in steps]
    widest = max(len(row.knots) for row in rows)
    d_pieces = np.zeros((len(rows), 4, widest - 1, 6, p.n))
    for one, row in zip(d_pieces, rows, strict=True):
        one[:, : row.d_pieces.shape[1], :, : row.d_pieces.shape[3]] = row.d_pieces
    return Chain(
        kind=np.array([row.kind for row in rows]),
        before=np.array([step.before for step in steps]),
        bone=np.array([step.bone for step in steps]),
        other=np.array([step.other for step in steps]),
        coordinates=np.array([np.resize(step.coordinates or (0,), 6) for step in steps]),
        rest=np.array([row.rest for row in rows]),
        point=np.array([row.axis.point for row in rows]),
        direction=np.array([row.axis.direction for row in rows]),
        turn=np.array([row.turn for row in rows]),
        shift=np.array([row.shift for row in rows]),
        knots=np.array([np.pad(row.knots, (0, widest - len(row.knots)), mode="edge") for row in rows]),
        pieces=np.array([_padded(row.pieces, widest - 1) for row in rows]),
        size=np.array([row.size for row in rows]),
        after_rotation=np.array([row.after.rotation for row in rows]),
        after_translation=np.array([row.after.translation for row in rows]),
        d_point=_columns([row.axis.d_point for row in rows], p.n),
        d_direction=_columns([row.axis.d_direction for row in rows], p.n),
        d_pieces=d_pieces,
        d_size=_columns([row.d_size for row in rows], p.n),
        d_after_rotation=_columns([row.after.d_rotation for row in rows], p.n),
        d_after_translation=_columns([row.after.d_translation for row in rows], p.n),
    )


def prepare_skin(anatomy: Anatomy, p: Points, rest: Points, weights: Floats) -> tuple[BoundSkin, Varying]:
    """Rest vertices (V, 3) whose deformers have ``weights`` (V, D), and how they vary, with whatever landmarks do.

    Where nothing varies, landmarks and vertices have no columns.
    """
    skin, by = _room_for(anatomy, p, rest, weights)
    vertex = np.repeat(np.arange(len(weights)), np.diff(skin.first))
    for d, deformer in enumerate(anatomy.deformers):
        entries = np.flatnonzero(skin.deformer == d)
        rows = vertex[entries] if len(entries) < len(weights) else slice(None)
        laid = DEFORMER_TYPES[deformer.type].layout(anatomy, deformer, p, rest.at(rows))
        skin.kind[d], skin.axis[d], by.axis[d] = laid.kind, laid.axis, laid.d_axis
        skin.t[entries], skin.width[entries] = laid.t, laid.width
        by.t[entries], by.width[entries] = laid.d_t, laid.d_width
        skin.length[d], by.length[d] = laid.length, laid.d_length
        if laid.local is not None:
            skin.local[entries], by.local[entries] = laid.local, laid.d_local
        for end, frame in enumerate(laid.ends):
            skin.frame_rotation[d, end], skin.frame_translation[d, end] = frame.rotation, frame.translation
            by.frame_rotation[d, end], by.frame_translation[d, end] = frame.d_rotation, frame.d_translation
    put_into_frames(skin, by)
    return skin, by


def _room_for(anatomy: Anatomy, p: Points, rest: Points, weights: Floats) -> tuple[BoundSkin, Varying]:
    """Room for vertices, all of them rigid so far."""
    order = [bone.name for bone in anatomy.bones]
    vertex, deformer = np.nonzero(weights)
    count, entries, m = weights.shape[1], len(vertex), rest.n
    bones = np.array([[order.index(d.bones[0]), order.index(d.bones[-1])] for d in anatomy.deformers])
    runs, flat = varying_runs(anatomy, p, bones)
    skin = BoundSkin(
        kind=np.zeros(count, dtype=np.int64),
        bones=bones,
        frame_rotation=np.tile(np.eye(3), (count, 2, 1, 1)),
        frame_translation=np.zeros((count, 2, 3)),
        axis=np.zeros((count, 3)),
        length=np.zeros(count),
        runs=runs,
        flat=flat,
        first=np.r_[0, np.cumsum(np.bincount(vertex, minlength=len(weights)))],
        deformer=deformer.astype(np.int64),
        weight=weights[vertex, deformer],
        local=rest.value[vertex],
        t=np.zeros(entries),
        width=np.ones(entries),
    )
    by = Varying(
        rest=np.ascontiguousarray(rest.d),
        local=np.zeros((entries, 3, m)),
        t=np.zeros((entries, m)),
        width=np.zeros((entries, m)),
        frame_rotation=np.zeros((count, 2, 3, m)),
        frame_translation=np.zeros((count, 2, 3, m)),
        axis=np.zeros((count, 3, m)),
        length=np.zeros((count, m)),
    )
    return skin, by


class _Step(NamedTuple):
    """One row, and between which bones it stands."""

    before: int
    bone: int
    other: int
    coordinates: tuple[int, ...]  # where q stands in theta
    row: Row


def _steps(anatomy: Anatomy, p: Points) -> Iterator[_Step]:
    order = [bone.name for bone in anatomy.bones]
    for joint in anatomy.joints:
        index = [anatomy.coordinate_index(name) for name in joint.coordinates]
        bone, before = order.index(joint.child), -1 if joint.parent is None else order.index(joint.parent)
        other = -1 if joint.other is None else order.index(joint.other)
        for row in JOINT_TYPES[joint.type].rows(anatomy, joint, p):
            yield _Step(before, bone, other, tuple(index[k] for k in row.coordinates), row)
            before = bone


def _columns(parts: Sequence[Floats], m: int) -> Floats:
    """Derivatives (S, 3, m) of parts, of which some have no columns."""
    return np.array([part if part.shape[1] else np.zeros((3, m)) for part in parts])


def _padded(pieces: Floats, count: int) -> Floats:
    """Cubics (4, K, 6), filled up with the last one."""
    return np.asarray(np.pad(pieces, ((0, 0), (0, count - pieces.shape[1]), (0, 0)), mode="edge"))
