"""The frames between a deformer's two bones (adapt.model.deformers.between), in one pose of one body."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from adapt.anatomy import Floats
from adapt.model.compiled.layout import BENDING, RIGID, BoundSkin, Varying
from adapt.model.compiled.links import Bones
from adapt.model.compiled.rotations import add_cross, add_product, inverse_left_jacobian, length, log, turn
from capture.compiled import compiled


class Between(NamedTuple):
    """What the frames between two bones are combined from, and how far a bend is bent: for each of D deformers.

    What a kind of deformer does not need has no meaning.
    """

    origin: Floats  # (D, 2, 3), shares 1, t
    rotation: Floats  # (D, 3, 3, 3), shares 1, sin(t angle), versine(t angle)
    d_origin: Floats  # (D, 2, 3 n)
    d_rotation: Floats  # (D, 6, 3 n), shares 1, sin, versine, t, versine / angle, t - sin / angle
    inward: Floats  # (D, 3)
    d_inward: Floats  # (D, 3, n)
    angle: Floats  # (D,): |rho|
    mitre: Floats  # (D,): m
    d_mitre: Floats  # (D, n)


def frames_between(bones: Bones, skin: BoundSkin, by: Varying) -> Between:
    """The frames between every deformer's two bones: all turn about the one axis rho (``blended_frames``)."""
    count, n = len(skin.kind), bones.d_rotation.shape[2]
    g = Between(
        origin=np.zeros((count, 2, 3)),
        rotation=np.zeros((count, 3, 3, 3)),
        d_origin=np.zeros((count, 2, 3, n)),
        d_rotation=np.zeros((count, 6, 3, n)),
        inward=np.zeros((count, 3)),
        d_inward=np.zeros((count, 3, n)),
        angle=np.ones(count),
        mitre=np.zeros(count),
        d_mitre=np.zeros((count, n)),
    )
    _fill(bones, skin, by, g)
    return g._replace(d_origin=g.d_origin.reshape(count, 2, 3 * n), d_rotation=g.d_rotation.reshape(count, 6, 3 * n))


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
        ends[2] = 0.0
        add_product(ends[1], np.ascontiguousarray(ends[0].T), ends[2])
        g.angle[deformer] = _fill_rotations(d_ends, ends, g.rotation[deformer], g.d_rotation[deformer], axis, matrix)
        if skin.kind[deformer] == BENDING:
            log(ends[2], rho)
            _fill_bend(bones, skin, by, deformer, rho, d_rho, g)


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
