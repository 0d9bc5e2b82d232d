"""Skin that rides on moved bones, vertex by vertex, with its derivatives if asked: the code that runs.

The equations stand where the types of deformers are, and a type's ``layout`` says which of the kinds here it is:
TURNING is the forearm's (adapt.model.deformers.forearm), BENDING the bend's (adapt.model.deformers.bend), CURVING the
curve's (adapt.model.compiled.curving).

A vertex varies with theta, and with the body's parameters in two ways: its bones do, for their joints are elsewhere,
and so does what it brings itself, its place at rest and in its deformer's frames. For the former all columns are alike,
the latter are the last m. Rows of derivatives are long, x, y and z one after the other: where many arrays meet in one
loop, the machine would check again and again whether they overlap, or give up and take number by number.
"""

from __future__ import annotations

import math

import numpy as np

from adapt.anatomy import Floats, Ints
from adapt.model.compiled.between import Between, frames_between
from adapt.model.compiled.chain import move_bones
from adapt.model.compiled.curving import add_curved
from adapt.model.compiled.layout import BENDING, CURVING, RIGID, TURNING, BoundSkin, Unsigned, Varying
from adapt.model.compiled.links import Bones, Chain
from adapt.model.compiled.room import Listed, Room, add_turned, fill_lists, lists_for, room_for
from capture.compiled import compiled_sums

_ONSET, _CREASE = 0.09, 0.3  # of adapt.model.deformers.bend
_AT_ONCE = 128  # vertices whose derivatives stay near the processor while one deformer after the other adds to them


def pose_rows(
    chain: Chain, skin: BoundSkin, by: Varying, theta: Floats, rows: Ints, *, varying: bool
) -> tuple[Floats, Floats]:
    """Posed vertices (M, 3) m of some rows of the skin and, if ``varying``, their derivatives (M, 3, n + m).

    Those by theta come first, then those by the body's parameters.
    """
    bones = move_bones(chain, theta)
    n = bones.d_rotation.shape[2]
    value, d = np.zeros((len(rows), 3)), np.zeros((len(rows) if varying else 0, 3, n))
    flat = d.reshape(len(d), 3 * n)
    room, listed = room_for(_AT_ONCE, by.axis.shape[2]), lists_for(_AT_ONCE, len(skin.kind))
    _pose(bones, _by_arms(bones), frames_between(bones, skin, by), skin, by, room, listed, rows, value, flat)
    return value, d


def _by_arms(bones: Bones) -> Floats:
    """What a point that rides on a bone varies by: (B, 4, 3 n), shares 1, then x, y, z of R times the point."""
    count, _, n = bones.d_rotation.shape
    by = np.zeros((count, 4, 3, n))
    by[:, 0] = bones.d_translation
    for j in range(3):
        k, i = (j + 1) % 3, (j + 2) % 3
        by[:, 1 + j, k], by[:, 1 + j, i] = bones.d_rotation[:, i], -bones.d_rotation[:, k]
    return by.reshape(count, 4, 3 * n)


@compiled_sums
def _pose(
    bones: Bones,
    by_arms: Floats,
    g: Between,
    skin: BoundSkin,
    by: Varying,
    room: Room,
    listed: Listed,
    rows: Ints,
    value: Floats,
    d: Floats,
) -> None:
    rides, varying, m = np.zeros((_AT_ONCE, 9)), len(d) > 0, by.axis.shape[2]
    for start in range(0, len(rows), _AT_ONCE):
        some, v, dv = rows[start : start + _AT_ONCE], value[start : start + _AT_ONCE], d[start : start + _AT_ONCE]
        rides[:] = 0.0
        fill_lists(skin.first, skin.deformer, some, listed)
        for e in range(len(skin.kind)):
            first, beyond = listed.first[e], listed.first[e + 1]
            if first == beyond:
                continue
            own, entries = listed.row[first:beyond], listed.entry[first:beyond]
            if skin.kind[e] != TURNING:
                _add_riding(bones, by_arms, skin, e, own, entries, rides, v, dv)
            if skin.kind[e] == RIGID:
                continue
            if skin.kind[e] == CURVING:
                add_curved(g, skin, by, e, some, own, entries, room, v, dv)
                continue
            count = _find_arms(g, skin, e, some, own, entries, room, v)
            if varying:
                _add_swung(g.d_rotation, g.d_origin, skin.runs[e], skin.flat[e], g.angle[e], e, count, room, dv)
            if varying and skin.kind[e] == BENDING:
                _add_evading(g.d_inward, g.d_mitre, skin.runs[e], e, count, room, dv)
            if varying and m > 0:
                _add_own(g, skin, by, e, count, room, dv)
        if varying and m > 0:
            add_turned(rides, by.rest, some, room.order, len(some), dv)


@compiled_sums
def _add_riding(
    bones: Bones,
    by_arms: Floats,
    skin: BoundSkin,
    e: int,
    rows: Ints,
    entries: Ints,
    rides: Floats,
    value: Floats,
    d: Floats,
) -> None:
    """Entries that ride on one bone: all of a rigid deformer's, and those before and beyond a bend."""
    flat = skin.flat[e]
    for at in range(len(rows)):
        m, i = rows[at], entries[at]
        w, t = skin.weight[i], skin.t[i]
        if 0.0 < t < 1.0:
            continue
        bone = skin.bones[e, int(t)]
        a, b, c = skin.local[i, 0], skin.local[i, 1], skin.local[i, 2]
        x = w * (bones.rotation[bone, 0, 0] * a + bones.rotation[bone, 0, 1] * b + bones.rotation[bone, 0, 2] * c)
        y = w * (bones.rotation[bone, 1, 0] * a + bones.rotation[bone, 1, 1] * b + bones.rotation[bone, 1, 2] * c)
        z = w * (bones.rotation[bone, 2, 0] * a + bones.rotation[bone, 2, 1] * b + bones.rotation[bone, 2, 2] * c)
        value[m, 0] += x + w * bones.translation[bone, 0]
        value[m, 1] += y + w * bones.translation[bone, 1]
        value[m, 2] += z + w * bones.translation[bone, 2]
        if len(d) == 0:
            continue
        for r in range(len(flat)):
            for k in range(flat[r, 0], flat[r, 1]):
                turned = x * by_arms[bone, 1, k] + y * by_arms[bone, 2, k] + z * by_arms[bone, 3, k]
                d[m, k] += w * by_arms[bone, 0, k] + turned
        for j in range(3):
            for k in range(3):
                rides[m, 3 * j + k] += w * bones.rotation[bone, j, k]


@compiled_sums
def _find_arms(
    g: Between, skin: BoundSkin, e: int, vertices: Ints, rows: Ints, entries: Ints, room: Room, value: Floats
) -> int:
    """Lists the rows that ride on the frames between two bones, where they are in them, and adds where that is."""
    bend, at, r = skin.kind[e] == BENDING, 0, room.rotation
    for index in range(len(rows)):
        m, i = rows[index], entries[index]
        w, t = skin.weight[i], skin.t[i]
        if bend and not 0.0 < t < 1.0:
            continue
        sine, versine = math.sin(g.angle[e] * t), 1.0 - math.cos(g.angle[e] * t)
        room.row[at], room.vertex[at], room.entry[at] = m, vertices[m], i
        room.share[at, 0], room.share[at, 1], room.share[at, 2], room.share[at, 3] = w, t, sine, versine
        for j in range(3):
            room.bare[at, j] = skin.local[i, j] - (skin.frame_translation[e, 0, j] if bend else 0.0)
            room.arm[at, j] = room.bare[at, j]
        if bend:
            _squeeze(g, skin, e, i, at, room)
        a, b, c = room.arm[at, 0], room.arm[at, 1], room.arm[at, 2]
        for j in range(3):
            for k in range(3):
                turned = g.rotation[e, 0, j, k] + sine * g.rotation[e, 1, j, k] + versine * g.rotation[e, 2, j, k]
                r[at, 3 * j + k] = w * turned
            room.reach[at, j] = r[at, 3 * j] * a + r[at, 3 * j + 1] * b + r[at, 3 * j + 2] * c
            value[m, j] += room.reach[at, j] + w * (g.origin[e, 0, j] + t * g.origin[e, 1, j])
        at += 1
    return at


@compiled_sums
def _squeeze(g: Between, skin: BoundSkin, e: int, i: int, at: int, room: Room) -> None:
    """Turns an arm q of a bend into q + (k - 1) q_across, and says q_across.

    And how k varies with q . inward and with the mitre, and k - 1: all 0 where slices do not close up.
    """
    arm, t, width = room.arm, room.share[at, 1], skin.width[i]
    for k in range(3):
        room.squeeze[at, k], room.across[at, k] = 0.0, 0.0
    s = (arm[at, 0] * g.inward[e, 0] + arm[at, 1] * g.inward[e, 1] + arm[at, 2] * g.inward[e, 2]) / width
    if s <= 0.0:
        return
    along = arm[at, 0] * skin.axis[e, 0] + arm[at, 1] * skin.axis[e, 1] + arm[at, 2] * skin.axis[e, 2]
    mitre, hump, square = g.mitre[e], 4.0 * t * (1.0 - t), s * s
    onset, over = square / (square + _ONSET), 1.0 + square * square
    f = (mitre * onset - _CREASE * square * square) / over
    d_onset = 2.0 * s * _ONSET / (square + _ONSET) ** 2
    by_s = (mitre * d_onset - 4.0 * _CREASE * s * square - 4.0 * f * s * square) / over
    for k in range(3):
        room.across[at, k] = arm[at, k] - along * skin.axis[e, k]
        arm[at, k] += hump * f * room.across[at, k]
    room.squeeze[at, 0], room.squeeze[at, 1], room.squeeze[at, 2] = hump * by_s / width, hump * onset / over, hump * f


@compiled_sums
def _add_swung(
    spin: Floats, glide: Floats, runs: Unsigned, flat: Unsigned, angle: float, e: int, count: int, room: Room, d: Floats
) -> None:
    """What vertices vary by with the frames, for the same shares t and the same arms."""
    n = d.shape[1] // 3
    turned = np.zeros(3 * n)
    for at in range(count):
        w, t, sine, versine = room.share[at, 0], room.share[at, 1], room.share[at, 2], room.share[at, 3]
        swing, lag, to = versine / angle, t - sine / angle, room.row[at]
        for r in range(len(flat)):
            for k in range(flat[r, 0], flat[r, 1]):
                turned[k] = spin[e, 0, k] + sine * spin[e, 1, k] + versine * spin[e, 2, k]
                turned[k] += t * spin[e, 3, k] + swing * spin[e, 4, k] + lag * spin[e, 5, k]
            for k in range(flat[r, 0], flat[r, 1]):
                d[to, k] += w * (glide[e, 0, k] + t * glide[e, 1, k])
        for j in range(3):
            p, q = (j + 1) % 3, (j + 2) % 3
            a, b = room.reach[at, q], room.reach[at, p]
            jn, pn, qn = np.uint64(j * n), np.uint64(p * n), np.uint64(q * n)
            for r in range(len(runs)):
                for k in range(runs[r, 0], runs[r, 1]):
                    d[to, jn + k] += a * turned[pn + k] - b * turned[qn + k]


@compiled_sums
def _add_evading(d_inward: Floats, d_mitre: Floats, runs: Unsigned, e: int, count: int, room: Room, d: Floats) -> None:
    """What a bend's tissue evades by when the joint bends further."""
    n, rotation = d.shape[1] // 3, room.rotation
    gain = np.zeros(n)
    for at in range(count):
        by_reach, by_mitre, to = room.squeeze[at, 0], room.squeeze[at, 1], room.row[at]
        if by_mitre == 0.0:
            continue
        a, b, c = by_reach * room.bare[at, 0], by_reach * room.bare[at, 1], by_reach * room.bare[at, 2]
        x, y, z = room.across[at, 0], room.across[at, 1], room.across[at, 2]
        for r in range(len(runs)):
            for k in range(runs[r, 0], runs[r, 1]):
                reach = a * d_inward[e, 0, k] + b * d_inward[e, 1, k] + c * d_inward[e, 2, k]
                gain[k] = reach + by_mitre * d_mitre[e, k]
            for j in range(3):  # where the evasion leads to
                led = rotation[at, 3 * j] * x + rotation[at, 3 * j + 1] * y + rotation[at, 3 * j + 2] * z
                jn = np.uint64(j * n)
                for k in range(runs[r, 0], runs[r, 1]):
                    d[to, jn + k] += led * gain[k]


@compiled_sums
def _add_own(g: Between, skin: BoundSkin, by: Varying, e: int, count: int, room: Room, d: Floats) -> None:
    """What the vertices bring themselves: R(t) d_arm + (R(t) arm + o(t))' dt."""
    if skin.kind[e] == BENDING:
        _fill_arms(g.inward, skin, by, e, count, room)
        add_turned(room.rotation, room.d_arm, room.order, room.row, count, d)
    else:
        add_turned(room.rotation, by.local, room.entry, room.row, count, d)
    n, m, angle = d.shape[1] // 3, by.t.shape[1], g.angle[e]
    for at in range(count):
        w, sine, cosine = room.share[at, 0], room.share[at, 2], 1.0 - room.share[at, 3]
        i, to = room.entry[at], room.row[at]
        for j in range(3):
            by_t = w * g.origin[e, 1, j]
            for k in range(3):
                slope = cosine * g.rotation[e, 1, j, k] + sine * g.rotation[e, 2, j, k]
                by_t += w * angle * slope * room.arm[at, k]
            for k in range(m):
                d[to, j * n + n - m + k] += by_t * by.t[i, k]


@compiled_sums
def _fill_arms(inward: Floats, skin: BoundSkin, by: Varying, e: int, count: int, room: Room) -> None:
    """How a bend's squeezed arms q + (k - 1) q_across vary with the body, for the same turn of the joint."""
    u, du, centre, d_arm, m = skin.axis, by.axis, by.frame_translation, room.d_arm, by.axis.shape[2]
    change, d_along = np.zeros(m), np.zeros(m)
    for at in range(count):
        i, s = room.vertex[at], room.entry[at]
        t, by_reach, gain = room.share[at, 1], room.squeeze[at, 0], room.squeeze[at, 2]
        for j in range(3):
            for k in range(m):
                d_arm[at, j, k] = by.rest[i, j, k] - centre[e, 0, j, k]
        if room.squeeze[at, 1] == 0.0:
            continue
        a, b, c = room.bare[at, 0], room.bare[at, 1], room.bare[at, 2]
        closes = (a * inward[e, 0] + b * inward[e, 1] + c * inward[e, 2]) / skin.width[s]
        along = a * u[e, 0] + b * u[e, 1] + c * u[e, 2]
        by_t = gain * (1.0 - 2.0 * t) / (t * (1.0 - t))  # of k, for the same s
        for k in range(m):
            x, y, z = d_arm[at, 0, k], d_arm[at, 1, k], d_arm[at, 2, k]
            reach = x * inward[e, 0] + y * inward[e, 1] + z * inward[e, 2]
            change[k] = by_reach * (reach - closes * by.width[s, k]) + by_t * by.t[s, k]
            d_along[k] = x * u[e, 0] + y * u[e, 1] + z * u[e, 2]
            d_along[k] += a * du[e, 0, k] + b * du[e, 1, k] + c * du[e, 2, k]
        for j in range(3):
            way, axis = room.across[at, j], u[e, j]
            for k in range(m):
                evading = d_arm[at, j, k] - axis * d_along[k] - along * du[e, j, k]
                d_arm[at, j, k] += way * change[k] + gain * evading
