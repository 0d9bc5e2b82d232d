"""Skin at rest in the frames that it will turn with (adapt.model.deformers.between), with what it varies by there."""

from __future__ import annotations

import math

import numpy as np

from adapt.anatomy import Floats
from adapt.model.compiled.between import Between, frames_between
from adapt.model.compiled.layout import TURNING, BoundSkin, Varying
from adapt.model.compiled.links import Bones
from capture.compiled import compiled_sums, inlined


def put_into_frames(skin: BoundSkin, by: Varying) -> None:
    """Replaces the places ``local`` at rest of all that turns bit by bit by those in its blended frames."""
    count, m = int(skin.bones.max()) + 1, by.axis.shape[2]
    none = np.zeros((count, 3, m))
    resting = Bones(np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3)), none, none)
    _put(frames_between(resting, skin, by), skin, by)


@compiled_sums
def _put(g: Between, skin: BoundSkin, by: Varying) -> None:
    """R(t)^T (x - o(t)), and how it varies."""
    m = by.axis.shape[2]
    rotation, reach, moved, turned = np.zeros((3, 3)), np.zeros(3), np.zeros(3 * m), np.zeros(3 * m)
    for i in range(len(skin.first) - 1):
        for s in range(skin.first[i], skin.first[i + 1]):
            e, t = skin.deformer[s], skin.t[s]
            if skin.kind[e] != TURNING:
                continue
            spin, glide = g.d_rotation[e], g.d_origin[e]
            sine, versine = math.sin(g.angle[e] * t), 1.0 - math.cos(g.angle[e] * t)
            for j in range(3):
                reach[j] = skin.local[s, j] - g.origin[e, 0, j] - t * g.origin[e, 1, j]
                for k in range(3):
                    rotation[j, k] = g.rotation[e, 0, j, k] + sine * g.rotation[e, 1, j, k]
                    rotation[j, k] += versine * g.rotation[e, 2, j, k]
            _turn_back(rotation, reach, skin.local[s])
            if m > 0:
                swing, lag = versine / g.angle[e], t - sine / g.angle[e]
                for k in range(3 * m):
                    turned[k] = spin[0, k] + sine * spin[1, k] + versine * spin[2, k]
                    turned[k] += t * spin[3, k] + swing * spin[4, k] + lag * spin[5, k]
                for k in range(3 * m):
                    moved[k] = -glide[0, k] - t * glide[1, k]
                _vary(g, by, e, i, s, sine, versine, rotation, reach, moved, turned)


@inlined
def _turn_back(rotation: Floats, reach: Floats, out: Floats) -> None:
    """R^T x for (3, 3) and (3,)."""
    for j in range(3):
        out[j] = rotation[0, j] * reach[0] + rotation[1, j] * reach[1] + rotation[2, j] * reach[2]


@inlined
def _vary(
    g: Between,
    by: Varying,
    e: int,
    i: int,
    s: int,
    sine: float,
    versine: float,
    rotation: Floats,
    reach: Floats,
    moved: Floats,
    turned: Floats,
) -> None:
    """R^T (dx - do + reach x dR), and what comes with the share: ((dR/dt)^T reach - R^T do/dt) dt."""
    m, angle, out = by.axis.shape[2], g.angle[e], by.local[s]
    for j in range(3):
        p, q = (j + 1) % 3, (j + 2) % 3
        for k in range(m):
            moved[j * m + k] += by.rest[i, j, k] + reach[p] * turned[q * m + k] - reach[q] * turned[p * m + k]
    for j in range(3):
        by_t, a, b, c = 0.0, rotation[0, j], rotation[1, j], rotation[2, j]
        for k in range(3):
            slope = angle * ((1.0 - versine) * g.rotation[e, 1, k, j] + sine * g.rotation[e, 2, k, j])
            by_t += slope * reach[k] - rotation[k, j] * g.origin[e, 1, k]
        for k in range(m):
            out[j, k] = a * moved[k] + b * moved[m + k] + c * moved[2 * m + k] + by_t * by.t[s, k]
