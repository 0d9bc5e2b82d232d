"""Skin that rides on moved bones, vertex by vertex, with its derivatives if asked: the code that runs.

The equations stand where the types of deformers are, and a type's ``layout`` says which of the loops here runs them:
TURNING is the forearm's (adapt.model.deformers.forearm), BENDING the bend's (adapt.model.deformers.bend).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from adapt.anatomy import Floats, Ints
from adapt.model.compiled.chain import Bones, Chain, move_bones
from adapt.model.compiled.layout import BENDING, RIGID, TURNING
from adapt.model.compiled.rotations import add_cross, add_product, inverse_left_jacobian, length, log, turn
from capture.compiled import compiled
from capture.rigid import hat, log_so3

_ONSET, _CREASE = 0.09, 0.3  # of adapt.model.deformers.bend


class BoundSkin(NamedTuple):
    """V vertices at rest as each of D deformers wants them: see ``Layout``."""

    kind: Ints  # (D,)
    bones: Ints  # (D, 2)
    weights: Floats  # (V, D)
    local: Floats  # (D, V, 3): at rest; of a forearm, in the blended frames
    t: Floats  # (D, V)
    width: Floats  # (D, V) of a bend
    frame_rotation: Floats  # (D, 2, 3, 3): the two frames at rest; of a bend, the centre with no rotation
    frame_translation: Floats  # (D, 2, 3)
    axis: Floats  # (D, 3) of a bend


class Between(NamedTuple):
    """What the frames between two bones are combined from (deformers.between), and how far a bend is bent."""

    origin: Floats  # (2, 3), shares 1, t
    rotation: Floats  # (3, 3, 3), shares 1, sin(t angle), versine(t angle)
    d_origin: Floats  # (2, 3, n)
    d_rotation: Floats  # (6, 3, n), shares 1, sin, versine, t, versine / angle, t - sin / angle
    inward: Floats  # (3,)
    d_inward: Floats  # (3, n)
    angle_and_mitre: Floats  # (2,): |rho|, m
    d_mitre: Floats  # (n,)


def pose_rows(chain: Chain, skin: BoundSkin, theta: Floats, rows: Ints, *, varying: bool) -> tuple[Floats, Floats]:
    """Posed vertices (M, 3) m of some rows of the skin and, if ``varying``, their derivatives (M, 3, n) by theta."""
    bones = move_bones(chain, theta)
    value, d = np.zeros((len(rows), 3)), np.zeros((len(rows) if varying else 0, 3, len(theta)))
    for deformer, kind in enumerate(skin.kind):
        if kind != TURNING:
            add_rigid(bones, skin, deformer, rows, value, d)
        if kind != RIGID:
            add_between(between(bones, skin, deformer), skin, deformer, rows, value, d)
    return value, d


@compiled
def add_rigid(bones: Bones, skin: BoundSkin, deformer: int, rows: Ints, value: Floats, d: Floats) -> None:
    """Rows that ride on one bone: all of a rigid deformer's, and those before and beyond a bend."""
    for m in range(len(rows)):
        i = rows[m]
        w, t = skin.weights[i, deformer], skin.t[deformer, i]
        if w == 0.0 or 0.0 < t < 1.0:
            continue
        bone = skin.bones[deformer, int(t)]
        a, b, c = skin.local[deformer, i, 0], skin.local[deformer, i, 1], skin.local[deformer, i, 2]
        x = bones.rotation[bone, 0, 0] * a + bones.rotation[bone, 0, 1] * b + bones.rotation[bone, 0, 2] * c
        y = bones.rotation[bone, 1, 0] * a + bones.rotation[bone, 1, 1] * b + bones.rotation[bone, 1, 2] * c
        z = bones.rotation[bone, 2, 0] * a + bones.rotation[bone, 2, 1] * b + bones.rotation[bone, 2, 2] * c
        value[m, 0] += w * (x + bones.translation[bone, 0])
        value[m, 1] += w * (y + bones.translation[bone, 1])
        value[m, 2] += w * (z + bones.translation[bone, 2])
        if len(d) == 0:
            continue
        spin, glide = bones.d_rotation[bone], bones.d_translation[bone]
        for k in range(d.shape[2]):
            d[m, 0, k] += w * (glide[0, k] + spin[1, k] * z - spin[2, k] * y)
            d[m, 1, k] += w * (glide[1, k] + spin[2, k] * x - spin[0, k] * z)
            d[m, 2, k] += w * (glide[2, k] + spin[0, k] * y - spin[1, k] * x)


@compiled
def add_between(g: Between, skin: BoundSkin, deformer: int, rows: Ints, value: Floats, d: Floats) -> None:
    """Rows that ride on the frames between two bones."""
    origin, angle, n = g.origin, g.angle_and_mitre[0], d.shape[2]
    # Long rows, one after the other: for short ones the machine checks again and again whether arrays overlap.
    spin, glide = g.d_rotation.reshape(6, 3 * n), g.d_origin.reshape(2, 3 * n)
    turned, moved = np.zeros(3 * n), np.zeros(3 * n)
    bend = skin.kind[deformer] == BENDING
    blended, arm, across = np.zeros((3, 3)), np.zeros(3), np.zeros(3)
    by_reach, by_mitre = 0.0, 0.0
    for m in range(len(rows)):
        i = rows[m]
        w, t = skin.weights[i, deformer], skin.t[deformer, i]
        if w == 0.0 or (bend and not 0.0 < t < 1.0):
            continue
        s, v = math.sin(angle * t), 1.0 - math.cos(angle * t)
        for j in range(3):
            arm[j] = skin.local[deformer, i, j] - (skin.frame_translation[deformer, 0, j] if bend else 0.0)
            for k in range(3):
                blended[j, k] = g.rotation[0, j, k] + s * g.rotation[1, j, k] + v * g.rotation[2, j, k]
        if bend:
            by_reach, by_mitre, _ = squeeze(g, skin.axis[deformer], t, skin.width[deformer, i], arm, across)
        x = blended[0, 0] * arm[0] + blended[0, 1] * arm[1] + blended[0, 2] * arm[2]
        y = blended[1, 0] * arm[0] + blended[1, 1] * arm[1] + blended[1, 2] * arm[2]
        z = blended[2, 0] * arm[0] + blended[2, 1] * arm[1] + blended[2, 2] * arm[2]
        value[m, 0] += w * (origin[0, 0] + t * origin[1, 0] + x)
        value[m, 1] += w * (origin[0, 1] + t * origin[1, 1] + y)
        value[m, 2] += w * (origin[0, 2] + t * origin[1, 2] + z)
        if len(d) == 0:
            continue
        swing, lag = v / angle, t - s / angle
        for k in range(3 * n):
            turned[k] = spin[0, k] + s * spin[1, k] + v * spin[2, k]
            turned[k] += t * spin[3, k] + swing * spin[4, k] + lag * spin[5, k]
            moved[k] = glide[0, k] + t * glide[1, k]
        for k in range(n):
            p, q, r = turned[k], turned[n + k], turned[2 * n + k]
            d[m, 0, k] += w * (moved[k] + q * z - r * y)
            d[m, 1, k] += w * (moved[n + k] + r * x - p * z)
            d[m, 2, k] += w * (moved[2 * n + k] + p * y - q * x)
        if by_mitre > 0.0:
            turn(blended, across, arm)  # where the evasion leads to
            for k in range(d.shape[2]):
                reach = 0.0
                for j in range(3):
                    q_j = skin.local[deformer, i, j] - skin.frame_translation[deformer, 0, j]
                    reach += q_j * g.d_inward[j, k]
                gain = w * (by_reach * reach + by_mitre * g.d_mitre[k])
                for j in range(3):
                    d[m, j, k] += gain * arm[j]


@compiled
def squeeze(g: Between, u: Floats, t: float, width: float, arm: Floats, across: Floats) -> tuple[float, float, float]:
    """Turns an ``arm`` q of a bend into q + (k - 1) q_across, and says q_across.

    Returns the derivatives of k by q . inward and by the mitre, and k - 1: all 0 where slices do not close up.
    """
    s = (arm[0] * g.inward[0] + arm[1] * g.inward[1] + arm[2] * g.inward[2]) / width
    if s <= 0.0:
        return 0.0, 0.0, 0.0
    along, mitre = arm[0] * u[0] + arm[1] * u[1] + arm[2] * u[2], g.angle_and_mitre[1]
    hump, square = 4.0 * t * (1.0 - t), s * s
    onset, over = square / (square + _ONSET), 1.0 + square * square
    f = (mitre * onset - _CREASE * square * square) / over
    d_onset = 2.0 * s * _ONSET / (square + _ONSET) ** 2
    by_s = (mitre * d_onset - 4.0 * _CREASE * s * square - 4.0 * f * s * square) / over
    for k in range(3):
        across[k] = arm[k] - along * u[k]
        arm[k] += hump * f * across[k]
    return hump * by_s / width, hump * onset / over, hump * f


def between(bones: Bones, skin: BoundSkin, deformer: int) -> Between:
    """The frames between a deformer's two bones: all turn about the one axis rho (``blended_frames``)."""
    n = bones.d_rotation.shape[2]
    g = Between(
        np.zeros((2, 3)),
        np.zeros((3, 3, 3)),
        np.zeros((2, 3, n)),
        np.zeros((6, 3, n)),
        np.zeros(3),
        np.zeros((3, n)),
        np.zeros(2),
        np.zeros(n),
    )
    first, second = skin.bones[deformer]
    _fill_origins(bones, first, second, skin.frame_translation[deformer], g, np.zeros(3))
    ends = np.zeros((3, 3, 3))  # the two frames' rotations, and the turn between them
    add_product(bones.rotation[first], skin.frame_rotation[deformer, 0], ends[0])
    add_product(bones.rotation[second], skin.frame_rotation[deformer, 1], ends[1])
    add_product(ends[1], np.ascontiguousarray(ends[0].T), ends[2])
    _fill_rotations(bones.d_rotation[first], bones.d_rotation[second], ends, g, np.zeros(3), np.zeros((3, 3)))
    if skin.kind[deformer] == BENDING:
        _fill_bend(bones.rotation[first], bones.d_rotation[first], skin.axis[deformer], ends[2], g)
    return g


@compiled
def _fill_origins(bones: Bones, first: int, second: int, at_rest: Floats, g: Between, carried: Floats) -> None:
    """Origin of the first frame, and the way from it to the second's, with derivatives."""
    for end in range(2):
        bone = first if end == 0 else second
        turn(bones.rotation[bone], at_rest[end], carried)
        add_cross(carried, bones.d_rotation[bone], -1.0, g.d_origin[end])
        for i in range(3):
            g.origin[end, i] = bones.translation[bone, i] + carried[i]
            for c in range(g.d_origin.shape[2]):
                g.d_origin[end, i, c] += bones.d_translation[bone, i, c]
    for i in range(3):
        g.origin[1, i] -= g.origin[0, i]
        for c in range(g.d_origin.shape[2]):
            g.d_origin[1, i, c] -= g.d_origin[0, i, c]


@compiled
def _fill_rotations(first: Floats, second: Floats, ends: Floats, g: Between, axis: Floats, inverse: Floats) -> None:
    """Powers of K times the first rotation, and times what it and rho vary by; ``first`` and ``second`` are d_R."""
    n = first.shape[1]
    log(ends[2], axis)
    angle = length(axis)
    inverse_left_jacobian(axis, inverse)
    g.angle_and_mitre[0] = angle if angle > 0.0 else 1.0  # without a twist K is 0, and any angle will do
    add_product(ends[2], first, g.d_rotation[4])
    for i in range(3):
        axis[i] /= g.angle_and_mitre[0]
        for c in range(n):
            g.d_rotation[5, i, c] = second[i, c] - g.d_rotation[4, i, c]
            g.d_rotation[0, i, c] = first[i, c]
        for j in range(3):
            g.rotation[0, i, j] = ends[0, i, j]
    add_product(inverse, g.d_rotation[5], g.d_rotation[3])  # d_rho
    for i in range(3):
        for c in range(n):
            g.d_rotation[4, i, c], g.d_rotation[5, i, c] = 0.0, 0.0
    for power in range(1, 3):
        add_cross(axis, g.rotation[power - 1], 1.0, g.rotation[power])
        add_cross(axis, g.d_rotation[power - 1], 1.0, g.d_rotation[power])
        add_cross(axis, g.d_rotation[2 + power], 1.0, g.d_rotation[3 + power])


def _fill_bend(rotation: Floats, d_rotation: Floats, u: Floats, turned: Floats, g: Between) -> None:
    """How far a bend is bent, as its first bone sees it at rest: inward = R_1^T rho x u, and the mitre."""
    rho = log_so3(turned)
    at_rest = rotation.T @ rho
    d_at_rest = rotation.T @ (g.d_rotation[3] + hat(rho) @ d_rotation)
    h = float(at_rest @ at_rest) / 8.0
    g.angle_and_mitre[1], g.d_mitre[:] = h * (1.0 + h), (1.0 + 2.0 * h) * (at_rest @ d_at_rest) / 4.0
    g.inward[:] = hat(at_rest) @ u
    g.d_inward[:] = hat(-u) @ d_at_rest
