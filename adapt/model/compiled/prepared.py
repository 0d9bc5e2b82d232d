"""A body laid out in arrays for the compiled loops: everything that does not depend on the pose."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from adapt.anatomy import Anatomy, Floats, Ints
from adapt.model.compiled.chain import Chain
from adapt.model.compiled.layout import RIGID, TURNING, Layout
from adapt.model.compiled.rows import Row
from adapt.model.compiled.shaped_skin import Varying
from adapt.model.compiled.skin import BoundSkin
from adapt.model.deformers import DEFORMER_TYPES, bind
from adapt.model.deformers.deformer_type import Bound
from adapt.model.derivatives import Points
from adapt.model.joints import JOINT_TYPES

_WORTH_PICKING = 0.7  # of the vertices: to bind so many of them alone costs as much as to bind all


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
        coordinates=np.array([np.resize(step.coordinates, 6) for step in steps]),
        rest=np.array([row.rest for row in rows]),
        point=np.array([row.axis.point for row in rows]),
        direction=np.array([row.axis.direction for row in rows]),
        turn=np.array([row.turn for row in rows]),
        shift=np.array([row.shift for row in rows]),
        knots=np.array([np.pad(row.knots, (0, widest - len(row.knots)), mode="edge") for row in rows]),
        pieces=np.array([_padded(row.pieces, widest - 1) for row in rows]),
        after_rotation=np.array([row.after.rotation for row in rows]),
        after_translation=np.array([row.after.translation for row in rows]),
        d_point=_columns([row.axis.d_point for row in rows], p.n),
        d_direction=_columns([row.axis.d_direction for row in rows], p.n),
        d_pieces=d_pieces,
        d_after_rotation=_columns([row.after.d_rotation for row in rows], p.n),
        d_after_translation=_columns([row.after.d_translation for row in rows], p.n),
    )


def _room_for(anatomy: Anatomy, weights: Floats) -> BoundSkin:
    """Room for vertices whose deformers have ``weights`` (V, D), all of them rigid so far."""
    order = [bone.name for bone in anatomy.bones]
    count, vertices = weights.shape[1], len(weights)
    return BoundSkin(
        kind=np.zeros(count, dtype=np.int64),
        bones=np.array([[order.index(d.bones[0]), order.index(d.bones[-1])] for d in anatomy.deformers]),
        weights=np.ascontiguousarray(weights),
        local=np.zeros((count, vertices, 3)),
        t=np.zeros((count, vertices)),
        width=np.ones((count, vertices)),
        frame_rotation=np.tile(np.eye(3), (count, 2, 1, 1)),
        frame_translation=np.zeros((count, 2, 3)),
        axis=np.zeros((count, 3)),
    )


def prepare_skin(anatomy: Anatomy, bound: Sequence[Bound]) -> BoundSkin:
    """Rest skin bound to each deformer, as it is when only the pose varies."""
    skin = _room_for(anatomy, anatomy.deformer_weights)
    for d, (deformer, one) in enumerate(zip(anatomy.deformers, bound, strict=True)):
        _lay_out(skin, d, slice(None), DEFORMER_TYPES[deformer.type].layout(one))
    return skin


def prepare_varying_skin(anatomy: Anatomy, p: Points, rest: Points, weights: Floats) -> tuple[BoundSkin, Varying]:
    """Rest vertices (V, 3) whose deformers have ``weights`` (V, D), and how they vary, with whatever landmarks do."""
    skin, count, m = _room_for(anatomy, weights), len(anatomy.deformers), p.n
    by = Varying(
        rest=np.ascontiguousarray(rest.d),
        local=np.zeros((count, len(weights), 3, m)),
        t=np.zeros((count, len(weights), m)),
        width=np.zeros((count, len(weights), m)),
        frame_rotation=np.zeros((count, 2, 3, m)),
        frame_translation=np.zeros((count, 2, 3, m)),
        axis=np.zeros((count, 3, m)),
    )
    for d, deformer in enumerate(anatomy.deformers):
        touched = np.flatnonzero(weights[:, d])
        rows = touched if len(touched) < _WORTH_PICKING * len(weights) else slice(None)
        laid = DEFORMER_TYPES[deformer.type].layout(bind(anatomy, deformer, p, rest.at(rows)))
        _lay_out(skin, d, rows, laid)
        if laid.kind == TURNING:
            by.local[d, rows] = laid.d_local
        if laid.kind != RIGID:
            by.t[d, rows], by.width[d, rows], by.axis[d] = laid.d_t, laid.d_width, laid.d_axis
        for end, frame in enumerate(laid.ends):
            by.frame_rotation[d, end], by.frame_translation[d, end] = frame.d_rotation, frame.d_translation
    return skin, by


def _lay_out(skin: BoundSkin, d: int, rows: Ints | slice, laid: Layout) -> None:
    """Puts what one deformer made of some rows among the arrays."""
    skin.kind[d], skin.axis[d] = laid.kind, laid.axis
    skin.local[d, rows], skin.t[d, rows], skin.width[d, rows] = laid.local, laid.t, laid.width
    for end, frame in enumerate(laid.ends):
        skin.frame_rotation[d, end], skin.frame_translation[d, end] = frame.rotation, frame.translation


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


def _columns(parts: Sequence[Floats], m: int) -> Floats:
    """Derivatives (S, 3, m) of parts, of which some have no columns."""
    return np.array([part if part.shape[1] else np.zeros((3, m)) for part in parts])


def _padded(pieces: Floats, count: int) -> Floats:
    """Cubics (4, K, 6), filled up with the last one."""
    return np.asarray(np.pad(pieces, ((0, 0), (0, count - pieces.shape[1]), (0, 0)), mode="edge"))
