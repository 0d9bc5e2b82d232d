"""The frames between a deformer's two bones (adapt.model.blended_frames, adapt.model.arc), in one pose of one body."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from adapt.anatomy import Floats
from adapt.model.compiled.layout import BENDING, CURVING, RIGID, BoundSkin, Varying
from adapt.model.compiled.links import Bones
from adapt.model.compiled.rotations import (
    add_cross,
    add_product,
    exp,
    inverse_left_jacobian,
    length,
    log,
    shortest_way,
    turn,
)
from capture.compiled import compiled


class Between(NamedTuple):
    """What the frames between two bones are combined from, and how far a bend is bent: for each of D deformers.

    What a kind of deformer does not need has no meaning.
    """

    origin: Floats  # (D, 3, 3), shares 1, t; along an arc 1, f, h
    rotation: Floats  # (D, 3, 3, 3), shares 1, sin(t angle), versine(t angle)
    d_origin: Floats  # (D, 3, 3 n)
    d_rotation: Floats  # (D, 6, 3 n), shares 1, sin, versine, t, versine / angle, t - sin / angle
    inward: Floats  # (D, 3)
    d_inward: Floats  # (D, 3, n)
    angle: Floats  # (D,): |rho|
    mitre: Floats  # (D,): m
    d_mitre: Floats  # (D, n)
    bend: Floats  # (D,) of an arc: |rho|, and 0 where it is straight
    d_bend: Floats  # (D, n): |rho| times its derivative
    twist: Floats  # (D,) of an arc: b
    d_twist: Floats  # (D, n)


def frames_between(bones: Bones, skin: BoundSkin, by: Varying) -> Between:
    """The frames between every deformer's two bones: all turn about the one axis rho (``blended_frames``)."""
    count, n = len(skin.kind), bones.d_rotation.shape[2]
    g = Between(
        origin=np.zeros((count, 3, 3)),
        rotation=np.zeros((count, 3, 3, 3)),
        d_origin=np.zeros((count, 3, 3, n)),
        d_rotation=np.zeros((count, 6, 3, n)),
        inward=np.zeros((count, 3)),
        d_inward=np.zeros((count, 3, n)),
        angle=np.ones(count),
        mitre=np.zeros(count),
        d_mitre=np.zeros((count, n)),
        bend=np.zeros(count),
        d_bend=np.zeros((count, n)),
        twist=np.zeros(count),
        d_twist=np.zeros((count, n)),
    )
    _fill(bones, skin, by, g)
    return g._replace(d_origin=g.d_origin.reshape(count, 3, 3 * n), d_rotation=g.d_rotation.reshape(count, 6, 3 * n))


@compiled
def _fill(bones: Bones, skin: BoundSkin, by: Varying, g: Between) -> None:
    n = g.d_mitre.shape[1]
    ends, d_ends = np.zeros((3, 3, 3)), np.zeros((2, 3, n))  # the two frames' rotations, and the turn between them
    axis, rho, matrix, d_rho = np.zeros(3), np.zeros(3), np.zeros((3, 3)), np.zeros((3, n))
    for deformer in range(len(skin.kind)):
        if skin.kind[deformer] == RIGID:
            continue
        _fill_origins(bones, skin, by, deformer, g.origin[deformer], g.d_origin[deformer], axis)
        for end in range(2):
            rotation = bones.rotation[skin.bones[deformer, end]]
            ends[end], d_ends[end] = 0.0, bones.d_rotation[skin.bones[deformer, end]]
            add_product(rotation, skin.frame_rotation[deformer, end], ends[end])
            add_product(rotation, by.frame_rotation[deformer, end], d_ends[end][:, n - by.axis.shape[2] :])
        if skin.kind[deformer] == CURVING:
            _straighten(deformer, ends, d_ends, g, rho, matrix)
        ends[2] = 0.0
        add_product(ends[1], np.ascontiguousarray(ends[0].T), ends[2])
        g.angle[deformer] = _fill_rotations(d_ends, ends, g.rotation[deformer], g.d_rotation[deformer], axis, matrix)
        if skin.kind[deformer] == BENDING:
            log(ends[2], rho)
            _fill_bend(bones, skin, by, deformer, rho, d_rho, g)
        if skin.kind[deformer] == CURVING:
            log(ends[2], rho)
            _fill_arc(skin, by, deformer, rho, g)


@compiled
def _fill_origins(
    bones: Bones, skin: BoundSkin, by: Varying, deformer: int, origin: Floats, d_origin: Floats, carried: Floats
) -> None:
    """Origin of the first frame, and the way from it to the second's, with derivatives; the body's come last."""
    n = d_origin.shape[2]
    for end in range(2):
        bone = skin.bones[deformer, end]
        turn(bones.rotation[bone], skin.frame_translation[deformer, end], carried)
        add_cross(carried, bones.d_rotation[bone], -1.0, d_origin[end])
        own = d_origin[end][:, n - by.axis.shape[2] :]
        add_product(bones.rotation[bone], by.frame_translation[deformer, end], own)
        for i in range(3):
            origin[end, i] = bones.translation[bone, i] + carried[i]
            for c in range(n):
                d_origin[end, i, c] += bones.d_translation[bone, i, c]
    for i in range(3):
        origin[1, i] -= origin[0, i]
        for c in range(n):
            d_origin[1, i, c] -= d_origin[0, i, c]


@compiled
def _fill_rotations(
    d_ends: Floats, ends: Floats, rotation: Floats, d_rotation: Floats, axis: Floats, inverse: Floats
) -> float:
    """Powers of K times the first rotation, and times what it and rho vary by; returns the angle."""
    n = d_ends.shape[2]
    log(ends[2], axis)
    angle = length(axis)
    inverse_left_jacobian(axis, inverse)
    angle = angle if angle > 0.0 else 1.0  # without a twist K is 0, and any angle will do
    add_product(ends[2], d_ends[0], d_rotation[4])
    for i in range(3):
        axis[i] /= angle
        for c in range(n):
            d_rotation[5, i, c] = d_ends[1, i, c] - d_rotation[4, i, c]
            d_rotation[0, i, c] = d_ends[0, i, c]
        for j in range(3):
            rotation[0, i, j] = ends[0, i, j]
    add_product(inverse, d_rotation[5], d_rotation[3])  # d_rho
    for i in range(3):
        for c in range(n):
            d_rotation[4, i, c], d_rotation[5, i, c] = 0.0, 0.0
    for power in range(1, 3):
        add_cross(axis, rotation[power - 1], 1.0, rotation[power])
        add_cross(axis, d_rotation[power - 1], 1.0, d_rotation[power])
        add_cross(axis, d_rotation[2 + power], 1.0, d_rotation[3 + power])
    return angle


@compiled
def _fill_bend(bones: Bones, skin: BoundSkin, by: Varying, deformer: int, rho: Floats, d: Floats, g: Between) -> None:
    """How far a bend is bent, as its first bone sees it at rest: inward = R_1^T rho x u, and the mitre.

    ``d`` (3, n) is room for R_1^T (d_rho + rho x d_R_1).
    """
    first, u, n = skin.bones[deformer, 0], skin.axis[deformer], d.shape[1]
    back, at_rest, varied = np.ascontiguousarray(bones.rotation[first].T), np.zeros(3), np.zeros((3, n))
    turn(back, rho, at_rest)
    varied[:] = g.d_rotation[deformer, 3]
    add_cross(rho, bones.d_rotation[first], 1.0, varied)
    d[:] = 0.0
    add_product(back, varied, d)
    h = (at_rest[0] ** 2 + at_rest[1] ** 2 + at_rest[2] ** 2) / 8.0
    g.mitre[deformer] = h * (1.0 + h)
    for k in range(n):
        along = at_rest[0] * d[0, k] + at_rest[1] * d[1, k] + at_rest[2] * d[2, k]
        g.d_mitre[deformer, k] = (1.0 + 2.0 * h) * along / 4.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        g.inward[deformer, i] = at_rest[j] * u[k] - at_rest[k] * u[j]
    add_cross(u, d, -1.0, g.d_inward[deformer])
    add_cross(at_rest, by.axis[deformer], 1.0, g.d_inward[deformer][:, n - by.axis.shape[2] :])


@compiled
def _straighten(deformer: int, ends: Floats, d_ends: Floats, g: Between, rho: Floats, matrix: Floats) -> None:
    """Takes from an arc's second frame what it is twisted by about its own y: that is b."""
    n = d_ends.shape[2]
    e, u, untwisted = ends[0, :, 1].copy(), ends[1, :, 1].copy(), np.zeros((3, 3))
    shortest_way(e, u, rho)
    exp(rho, matrix)
    add_product(matrix, ends[0], untwisted)
    sine, cosine, along = 0.0, 0.0, 1.0
    for i in range(3):
        sine += untwisted[i, 0] * ends[1, i, 2]
        cosine += untwisted[i, 0] * ends[1, i, 0]
        along += e[i] * u[i]
    g.twist[deformer] = math.atan2(sine, cosine)
    for k in range(n):
        for i in range(3):
            g.d_twist[deformer, k] += (e[i] + u[i]) * (d_ends[1, i, k] - d_ends[0, i, k]) / along
        for i in range(3):
            d_ends[1, i, k] -= u[i] * g.d_twist[deformer, k]
    size = math.hypot(sine, cosine)
    sine, cosine = sine / size, cosine / size
    for i in range(3):
        x, z = ends[1, i, 0], ends[1, i, 2]
        ends[1, i, 0], ends[1, i, 2] = cosine * x + sine * z, cosine * z - sine * x


@compiled
def _fill_arc(skin: BoundSkin, by: Varying, deformer: int, rho: Floats, g: Between) -> None:
    """The ways l e and l rho x e that an arc's origins are combined from, and how they and |rho|^2 / 2 vary."""
    origin, d_origin, d_rho = g.origin[deformer], g.d_origin[deformer], g.d_rotation[deformer, 3]
    size, n, m = skin.length[deformer], d_rho.shape[1], by.length.shape[1]
    e, w = g.rotation[deformer, 0, :, 1].copy(), np.zeros(3)
    g.bend[deformer] = length(rho)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        w[i] = rho[j] * e[k] - rho[k] * e[j]
        origin[1, i] = size * e[i]
        for c in range(n):
            d_origin[1, i, c], d_origin[2, i, c] = 0.0, 0.0
            g.d_bend[deformer, c] += rho[i] * d_rho[i, c]
    add_cross(e, g.d_rotation[deformer, 0], -size, d_origin[1])
    add_cross(e, d_rho, -size, d_origin[2])
    add_cross(rho, d_origin[1], 1.0, d_origin[2])
    for i in range(3):
        origin[2, i] = size * w[i]
        for c in range(m):
            d_origin[1, i, n - m + c] += e[i] * by.length[deformer, c]
            d_origin[2, i, n - m + c] += w[i] * by.length[deformer, c]
