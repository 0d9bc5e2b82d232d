"""Skin that rides on shares of an arc between two bones, with its derivatives if asked (adapt.model.deformers.curve).

With R(s) of the arc apart from its twist and q = Ry(s b) times the place in the arc's frames, a point stands at

    x = R q + o(s),      o(s) = o + f (l e) + h (l rho x e)

and varies by d_R x R q, by db as s R (e_y x q), by |rho| d|rho| as f' (l e) + h' (l rho x e), where f' and h' are
derivatives by |rho|, divided by it, and by its own share as rho x R q + b R (e_y x q) + l R e_y.
"""

from __future__ import annotations

import math

import numpy as np

from adapt.anatomy import Floats, Ints
from adapt.model.compiled.between import Between
from adapt.model.compiled.layout import BoundSkin, Unsigned, Varying
from adapt.model.compiled.room import Room, add_turned
from capture.compiled import compiled_sums, inlined

_SMALL = 1e-3  # below this angle (rad) series replace the closed forms


@compiled_sums
def add_curved(
    g: Between,
    skin: BoundSkin,
    by: Varying,
    e: int,
    vertices: Ints,
    rows: Ints,
    entries: Ints,
    room: Room,
    value: Floats,
    d: Floats,
) -> None:
    """Adds what one deformer makes of entries that lie between the ends of its arc; ``rows`` are of the vertices."""
    at, varying, m = 0, len(d) > 0, by.axis.shape[2]
    turned, shares, led, bent = np.zeros(3 * (d.shape[1] // 3)), np.zeros(4), np.zeros(3), np.zeros(3)
    for index in range(len(entries)):
        k, i = rows[index], entries[index]
        w, s = skin.weight[i], skin.t[i]
        if not 0.0 < s < 1.0:
            continue
        room.row[at], room.vertex[at], room.entry[at] = k, vertices[k], i
        _place(g, skin, e, i, at, w, s, room, shares)
        for j in range(3):
            way = g.origin[e, 0, j] + shares[0] * g.origin[e, 1, j] + shares[1] * g.origin[e, 2, j]
            value[k, j] += room.reach[at, j] + w * way
        if varying:
            x, z, r = room.arm[at, 0], room.arm[at, 2], room.rotation[at]
            for j in range(3):
                led[j] = r[3 * j] * z - r[3 * j + 2] * x
                bent[j] = w * (shares[2] * g.origin[e, 1, j] + shares[3] * g.origin[e, 2, j])
            _add_swung(g, skin.runs[e], skin.flat[e], e, at, w, s, room, shares, led, bent, turned, d[k])
            if m > 0:
                _add_shared(g, skin, by, e, i, at, w, room, led, d[k])
        at += 1
    if varying and m > 0:
        for k in range(at):
            _twist(g.twist[e] * room.share[k, 1], room.rotation[k])
        add_turned(room.rotation, by.local, room.entry, room.row, at, d)


@inlined
def _place(
    g: Between, skin: BoundSkin, e: int, i: int, at: int, w: float, s: float, room: Room, shares: Floats
) -> None:
    """q, R times the weight, and R q times the weight; and f, h, f', h'."""
    x = g.bend[e] * s
    sine, half = math.sin(x), math.sin(0.5 * x)
    versine = 2.0 * half * half
    room.share[at, 0], room.share[at, 1], room.share[at, 2], room.share[at, 3] = w, s, sine, versine
    if x < _SMALL:
        shares[0], shares[1] = s * (1.0 - x * x / 6.0), s * s * (0.5 - x * x / 24.0)
        shares[2], shares[3] = s**3 * (x * x / 30.0 - 1.0 / 3.0), s**4 * (x * x / 180.0 - 1.0 / 12.0)
    else:
        shares[0], shares[1] = s * sine / x, s * s * versine / (x * x)
        shares[2] = s**3 * (x * (1.0 - versine) - sine) / x**3
        shares[3] = s**4 * (x * sine - 2.0 * versine) / x**4
    about, cosine = math.sin(g.twist[e] * s), math.cos(g.twist[e] * s)
    a, b, c = skin.local[i, 0], skin.local[i, 1], skin.local[i, 2]
    room.arm[at, 0], room.arm[at, 1], room.arm[at, 2] = cosine * a + about * c, b, cosine * c - about * a
    for j in range(3):
        for k in range(3):
            entry = g.rotation[e, 0, j, k] + sine * g.rotation[e, 1, j, k] + versine * g.rotation[e, 2, j, k]
            room.rotation[at, 3 * j + k] = w * entry
    r = room.rotation[at]
    for j in range(3):
        turned = r[3 * j] * room.arm[at, 0] + r[3 * j + 1] * room.arm[at, 1] + r[3 * j + 2] * room.arm[at, 2]
        room.reach[at, j] = turned


@inlined
def _add_swung(
    g: Between,
    runs: Unsigned,
    flat: Unsigned,
    e: int,
    at: int,
    w: float,
    s: float,
    room: Room,
    shares: Floats,
    led: Floats,
    bent: Floats,
    turned: Floats,
    d: Floats,
) -> None:
    """What a point varies by with the frames, for the same share and the same place in them."""
    n, spin, glide = len(turned) // 3, g.d_rotation[e], g.d_origin[e]
    sine, versine = room.share[at, 2], room.share[at, 3]
    swing, lag = versine / g.angle[e], s - sine / g.angle[e]
    for r in range(len(flat)):
        for k in range(flat[r, 0], flat[r, 1]):
            turned[k] = spin[0, k] + sine * spin[1, k] + versine * spin[2, k]
            turned[k] += s * spin[3, k] + swing * spin[4, k] + lag * spin[5, k]
        for k in range(flat[r, 0], flat[r, 1]):
            d[k] += w * (glide[0, k] + shares[0] * glide[1, k] + shares[1] * glide[2, k])
    for j in range(3):
        p, q = (j + 1) % 3, (j + 2) % 3
        a, b, by_twist, by_bend = room.reach[at, q], room.reach[at, p], s * led[j], bent[j]
        jn, pn, qn = np.uint64(j * n), np.uint64(p * n), np.uint64(q * n)
        for r in range(len(runs)):
            for k in range(runs[r, 0], runs[r, 1]):
                d[jn + k] += a * turned[pn + k] - b * turned[qn + k]
                d[jn + k] += by_twist * g.d_twist[e, k] + by_bend * g.d_bend[e, k]


@inlined
def _add_shared(
    g: Between, skin: BoundSkin, by: Varying, e: int, i: int, at: int, w: float, room: Room, led: Floats, d: Floats
) -> None:
    """What a point varies by with its own share."""
    n, m = len(d) // 3, by.t.shape[1]
    sine, cosine, r = room.share[at, 2], 1.0 - room.share[at, 3], room.rotation[at]
    for j in range(3):
        by_share = g.twist[e] * led[j] + skin.length[e] * r[3 * j + 1]
        for k in range(3):
            slope = cosine * g.rotation[e, 1, j, k] + sine * g.rotation[e, 2, j, k]
            by_share += w * g.bend[e] * slope * room.arm[at, k]
        for k in range(m):
            d[j * n + n - m + k] += by_share * by.t[i, k]


@inlined
def _twist(angle: float, r: Floats) -> None:
    """Turns R (9,) into R Ry(angle)."""
    sine, cosine = math.sin(angle), math.cos(angle)
    for j in range(3):
        x, z = r[3 * j], r[3 * j + 2]
        r[3 * j], r[3 * j + 2] = cosine * x - sine * z, cosine * z + sine * x
