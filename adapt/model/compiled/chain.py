"""The chain of joints (adapt.model.kinematics) for one body: from theta to every bone's motion and its derivatives.

Columns of derivatives are theta's n first, then the m of whatever the landmarks vary with: none in tracking, the shape
in adapting.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adapt.anatomy import Floats
from adapt.model.compiled.links import Bones, Chain
from adapt.model.compiled.pointing import point_at, swing_along
from adapt.model.compiled.reach import arc, pole
from adapt.model.compiled.rotations import add_cross, add_product, exp, left_jacobian, turn
from adapt.model.compiled.rows import ARC, GLIDE, HOLD, PLACE, SCREW, SWING, TOWARDS
from capture.compiled import compiled


class _Step(NamedTuple):
    """One elementary motion H, with the derivatives of its rotation and translation: its own six, then the m."""

    rotation: Floats  # (3, 3)
    translation: Floats  # (3,)
    d_rotation: Floats  # (3, 6 + m)
    d_translation: Floats  # (3, 6 + m)


def move_bones(chain: Chain, theta: Floats) -> Bones:
    """T_b of every bone."""
    count, m = int(chain.bone.max()) + 2, chain.d_point.shape[2]
    n = len(theta) + m
    bones = Bones(np.zeros((count, 3, 3)), np.zeros((count, 3)), np.zeros((count, 3, n)), np.zeros((count, 3, n)))
    bones.rotation[-1] = np.eye(3)
    room = _Step(np.zeros((3, 3)), np.zeros(3), np.zeros((3, 6 + m)), np.zeros((3, 6 + m)))
    outer = _Step(np.zeros((3, 3)), np.zeros(3), np.zeros((3, n)), np.zeros((3, n)))
    _move(chain, theta, bones, room, outer, np.zeros(3), np.zeros((3, 3)), np.zeros((3, m)))
    return bones


@compiled
def _move(
    chain: Chain, theta: Floats, bones: Bones, h: _Step, outer: _Step, q: Floats, g: Floats, varied: Floats
) -> None:
    m = varied.shape[1]
    swung = np.zeros((3, len(theta) + m))  # how what points at another bone turns with everything
    for s in range(len(chain.kind)):
        for i in range(3):
            for c in range(6 + m):
                h.d_rotation[i, c], h.d_translation[i, c] = 0.0, 0.0
            h.translation[i] = 0.0
        if chain.kind[s] == TOWARDS:
            own = point_at(chain, s, bones, g, swung)
        else:
            own = _own(chain, theta, s, h, q, g, varied)
        turn(g, chain.after_translation[s], q)
        add_cross(q, h.d_rotation, -1.0, h.d_translation)
        add_product(g, chain.d_after_rotation[s], h.d_rotation[:, 6:])
        add_product(g, chain.d_after_translation[s], h.d_translation[:, 6:])
        for i in range(3):
            h.translation[i] += q[i]
            for j in range(3):
                h.rotation[i, j] = 0.0
        add_product(g, chain.after_rotation[s], h.rotation)
        _put_after(bones, chain.before[s], chain.bone[s], h, outer, q)
        for c in range(own):
            column = chain.coordinates[s, c]
            for i in range(3):
                for j in range(3):
                    bones.d_rotation[chain.bone[s], i, column] += outer.rotation[i, j] * h.d_rotation[j, c]
                    bones.d_translation[chain.bone[s], i, column] += outer.rotation[i, j] * h.d_translation[j, c]
        add_product(outer.rotation, h.d_rotation[:, 6:], bones.d_rotation[chain.bone[s]][:, len(theta) :])
        add_product(outer.rotation, h.d_translation[:, 6:], bones.d_translation[chain.bone[s]][:, len(theta) :])
        if chain.kind[s] == TOWARDS:
            swing_along(outer.rotation, chain.after_translation[s], g, swung, bones, chain.bone[s])


@compiled
def _own(chain: Chain, theta: Floats, s: int, h: _Step, q: Floats, g: Floats, varied: Floats) -> int:
    """G of one row: shift and derivatives go to ``h``, the rotation to ``g``; returns how many coordinates it has."""
    kind, m = chain.kind[s], varied.shape[1]
    if kind == SCREW:
        step = theta[chain.coordinates[s, 0]] - chain.rest[s]
        _screw(chain.direction[s], chain.point[s], chain.turn[s], chain.shift[s], step, h, q, g)
        if m > 0:
            _vary_screw(chain, s, step, h, q, g, varied)
        return 1
    if kind == GLIDE:
        at = theta[chain.coordinates[s, 0]]
        _glide(chain.knots[s], chain.pieces[s], at, h, q, g)
        if m > 0:
            _vary_glide(chain.knots[s], chain.d_pieces[s], at, h, q, varied)
        return 1
    for i in range(3):
        q[i] = theta[chain.coordinates[s, i]]
    if kind in (PLACE, SWING):
        exp(q, g)
        left_jacobian(q, h.d_rotation)  # fills the first three columns
        if kind == SWING:
            return 3
        for i in range(3):
            h.translation[i] = theta[chain.coordinates[s, 3 + i]]
            h.d_translation[i, 3 + i] = 1.0
        return 6
    for i in range(3):
        for j in range(3):
            g[i, j] = 1.0 if i == j else 0.0
    if kind == HOLD:
        return 0
    _reach(chain, s, h, q)
    return 3


@compiled
def _reach(chain: Chain, s: int, h: _Step, q: Floats) -> None:
    """A shift by size * w(q); q becomes w."""
    if chain.kind[s] == ARC:
        arc(q, h.d_translation)
    else:
        pole(q, h.d_translation)
    for i in range(3):
        h.translation[i] = chain.size[s, i] * q[i]
        for c in range(3):
            h.d_translation[i, c] *= chain.size[s, i]
        for k in range(chain.d_size.shape[2]):
            h.d_translation[i, 6 + k] = q[i] * chain.d_size[s, i, k]


@compiled
def _screw(
    direction: Floats, point: Floats, turned: float, shifted: float, step: float, h: _Step, q: Floats, g: Floats
) -> None:
    """A turn about the line through ``point`` and a shift along it: x' = R (x - point) + point + s; R goes to ``g``."""
    for i in range(3):
        q[i] = turned * step * direction[i]
    exp(q, g)
    turn(g, point, q)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        h.translation[i] = point[i] - q[i] + shifted * step * direction[i]
        h.d_rotation[i, 0] = turned * direction[i]
        h.d_translation[i, 0] = turned * (q[j] * direction[k] - q[k] * direction[j]) + shifted * direction[i]


@compiled
def _vary_screw(chain: Chain, s: int, step: float, h: _Step, q: Floats, g: Floats, varied: Floats) -> None:
    """What a screw varies by when its line does; ``g`` is its rotation R.

    By the direction u: J_l(angle u) angle du, and a shift along du. By the point f: df - R df + R f x the turn's.
    """
    by_line, d_point = h.d_rotation[:, 6:], chain.d_point[s]
    jacobian = np.zeros((3, 3))
    for i in range(3):
        q[i] = chain.turn[s] * step * chain.direction[s, i]
    left_jacobian(q, jacobian)
    for i in range(3):
        for k in range(varied.shape[1]):
            varied[i, k] = chain.turn[s] * step * chain.d_direction[s, i, k]
            h.d_translation[i, 6 + k] += d_point[i, k] + chain.shift[s] * step * chain.d_direction[s, i, k]
            h.d_translation[i, 6 + k] -= g[i, 0] * d_point[0, k] + g[i, 1] * d_point[1, k] + g[i, 2] * d_point[2, k]
    add_product(jacobian, varied, by_line)
    turn(g, chain.point[s], q)
    add_cross(q, by_line, 1.0, h.d_translation[:, 6:])


@compiled
def _vary_glide(knots: Floats, d_pieces: Floats, at: float, h: _Step, r: Floats, varied: Floats) -> None:
    """What a glide varies by when its cubics do; ``r`` is its rotation vector."""
    nearest = min(max(at, knots[0]), knots[-1])
    piece = _piece_at(knots, d_pieces.shape[1], nearest)
    x = nearest - knots[piece]
    jacobian = np.zeros((3, 3))
    left_jacobian(r, jacobian)
    for j in range(6):
        for k in range(varied.shape[1]):
            a, b, c = d_pieces[0, piece, j, k], d_pieces[1, piece, j, k], d_pieces[2, piece, j, k]
            slope = (3.0 * a * x + 2.0 * b) * x + c
            value = ((a * x + b) * x + c) * x + d_pieces[3, piece, j, k] + (at - nearest) * slope
            if j < 3:
                varied[j, k] = value
            else:
                h.d_translation[j - 3, 6 + k] = value
    add_product(jacobian, varied, h.d_rotation[:, 6:])


@compiled
def _piece_at(knots: Floats, count: int, at: float) -> int:
    """Which of ``count`` cubics holds where."""
    piece = 0
    while piece < count - 1 and at > knots[piece + 1]:
        piece += 1
    return piece


@compiled
def _glide(knots: Floats, pieces: Floats, at: float, h: _Step, q: Floats, g: Floats) -> None:
    """G of a glide at a coordinate's value, in straight lines beyond the outermost knots; R goes to ``g``."""
    nearest = min(max(at, knots[0]), knots[-1])
    piece = _piece_at(knots, pieces.shape[1], nearest)
    x = nearest - knots[piece]
    for j in range(6):
        a, b, c, d = pieces[0, piece, j], pieces[1, piece, j], pieces[2, piece, j], pieces[3, piece, j]
        slope = (3.0 * a * x + 2.0 * b) * x + c
        value = ((a * x + b) * x + c) * x + d + (at - nearest) * slope
        if j < 3:
            q[j], h.translation[j] = value, slope  # the slope waits there for the Jacobian
        else:
            h.d_translation[j - 3, 0] = slope
    left_jacobian(q, g)
    for i in range(3):
        h.d_rotation[i, 0] = g[i, 0] * h.translation[0] + g[i, 1] * h.translation[1] + g[i, 2] * h.translation[2]
    exp(q, g)
    for j in range(3, 6):
        a, b, c, d = pieces[0, piece, j], pieces[1, piece, j], pieces[2, piece, j], pieces[3, piece, j]
        h.translation[j - 3] = ((a * x + b) * x + c) * x + d + (at - nearest) * h.d_translation[j - 3, 0]


@compiled
def _put_after(bones: Bones, before: int, bone: int, h: _Step, outer: _Step, carried: Floats) -> None:
    """T_bone = T_before H, with the derivatives that T_before brings; it is copied: it may be the same bone's."""
    n = bones.d_rotation.shape[2]
    for i in range(3):
        outer.translation[i] = bones.translation[before, i]
        for j in range(3):
            outer.rotation[i, j] = bones.rotation[before, i, j]
            bones.rotation[bone, i, j] = 0.0
        for c in range(n):
            outer.d_rotation[i, c] = bones.d_rotation[before, i, c]
            outer.d_translation[i, c] = bones.d_translation[before, i, c]
    turn(outer.rotation, h.translation, carried)
    add_product(outer.rotation, h.rotation, bones.rotation[bone])
    for i in range(3):
        bones.translation[bone, i] = outer.translation[i] + carried[i]
        for c in range(n):
            bones.d_rotation[bone, i, c] = outer.d_rotation[i, c]
            bones.d_translation[bone, i, c] = outer.d_translation[i, c]
    add_cross(carried, outer.d_rotation, -1.0, bones.d_translation[bone])
