"""Skin that rides on moved bones, with its derivatives by the body's shape as well: what adapting spends its time on.

``adapt.model.compiled.skin`` poses the skin for fixed rest vertices and frames; run with bones and frames that have
columns for the shape, too, it gives what these bring. What is left is what each vertex brings itself, because the shape
moves it at rest: it lies elsewhere in its deformer's frames, and in another slice. Only that is added here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from adapt.anatomy import Floats, Ints
from adapt.model.compiled.chain import Bones, Chain, move_bones
from adapt.model.compiled.layout import BENDING, RIGID, TURNING
from adapt.model.compiled.rotations import add_cross
from adapt.model.compiled.skin import Between, BoundSkin, add_between, add_rigid, between, squeeze
from capture.compiled import compiled_sums
from capture.rigid import hat, log_so3

_AT_ONCE = 32  # vertices whose derivatives stay near the processor while one deformer after the other adds to them


class Varying(NamedTuple):
    """How V vertices at rest, as each of D deformers wants them, vary with m parameters of the body (``BoundSkin``).

    Where a vertex has no weight, and where a kind of deformer has no such thing, numbers have no meaning.
    """

    rest: Floats  # (V, 3, m)
    local: Floats  # (D, V, 3, m) of what lies in blended frames
    t: Floats  # (D, V, m)
    width: Floats  # (D, V, m) of a bend
    frame_rotation: Floats  # (D, 2, 3, m)
    frame_translation: Floats  # (D, 2, 3, m)
    axis: Floats  # (D, 3, m) of a bend


def pose_varying_rows(chain: Chain, skin: BoundSkin, by: Varying, theta: Floats, rows: Ints) -> tuple[Floats, Floats]:
    """Posed vertices (M, 3) m of some rows, and their derivatives (M, 3, n + m) by theta and the body's parameters."""
    bones = move_bones(chain, theta)
    value, d = np.zeros((len(rows), 3)), np.zeros((len(rows), 3, bones.d_rotation.shape[2]))
    alone = standing(skin)
    frames = [_between(bones, skin, deformer, by, alone) for deformer in range(len(skin.kind))]
    _pose(bones, Between(*map(np.array, zip(*frames, strict=True))), skin, by, rows, value, d)
    return value, d


def standing(skin: BoundSkin) -> BoundSkin:
    """The same skin where a deformer's two frames are its two bones."""
    return skin._replace(
        bones=np.tile([0, 1], (len(skin.kind), 1)),
        frame_rotation=np.tile(np.eye(3), (len(skin.kind), 2, 1, 1)),
        frame_translation=np.zeros_like(skin.frame_translation),
    )


def _between(bones: Bones, skin: BoundSkin, deformer: int, by: Varying, alone: BoundSkin) -> Between:
    """The frames between a deformer's two bones, with what the body brings; without meaning for a rigid one."""
    g = between(_ends(bones, skin, deformer, by), alone, deformer)
    if skin.kind[deformer] == BENDING:
        first, second = (bones.rotation[bone] for bone in skin.bones[deformer])
        d_axis = by.axis[deformer]
        g.d_inward[:, -d_axis.shape[1] :] += hat(first.T @ log_so3(second @ first.T)) @ d_axis
    return g


def _ends(bones: Bones, skin: BoundSkin, deformer: int, by: Varying) -> Bones:
    """A deformer's two frames where its bones carry them, as if they were two bones; the frames themselves vary, too.

    They are the last m columns of the bones that vary with the body.
    """
    n = bones.d_rotation.shape[2]
    ends = Bones(np.zeros((2, 3, 3)), np.zeros((2, 3)), np.zeros((2, 3, n)), np.zeros((2, 3, n)))
    own = slice(n - by.axis.shape[2], n)
    for end, bone in enumerate(skin.bones[deformer]):
        rotation = bones.rotation[bone]
        ends.rotation[end] = rotation @ skin.frame_rotation[deformer, end]
        carried = rotation @ skin.frame_translation[deformer, end]
        ends.translation[end] = bones.translation[bone] + carried
        ends.d_rotation[end], ends.d_translation[end] = bones.d_rotation[bone], bones.d_translation[bone]
        add_cross(carried, bones.d_rotation[bone], -1.0, ends.d_translation[end])
        ends.d_rotation[end][:, own] += rotation @ by.frame_rotation[deformer, end]
        ends.d_translation[end][:, own] += rotation @ by.frame_translation[deformer, end]
    return ends


@compiled_sums
def _pose(bones: Bones, frames: Between, skin: BoundSkin, by: Varying, rows: Ints, value: Floats, d: Floats) -> None:
    for start in range(0, len(rows), _AT_ONCE):
        end = min(start + _AT_ONCE, len(rows))
        some, v, dv = rows[start:end], value[start:end], d[start:end]
        for deformer in range(len(skin.kind)):
            kind = skin.kind[deformer]
            if kind != TURNING:
                add_rigid(bones, skin, deformer, some, v, dv)
                _add_own_of_rigid(bones, skin, deformer, by, some, dv)
            if kind != RIGID:
                g = Between(
                    frames.origin[deformer],
                    frames.rotation[deformer],
                    frames.d_origin[deformer],
                    frames.d_rotation[deformer],
                    frames.inward[deformer],
                    frames.d_inward[deformer],
                    frames.angle_and_mitre[deformer],
                    frames.d_mitre[deformer],
                )
                add_between(g, skin, deformer, some, v, dv)
                _add_own_of_between(g, skin, deformer, by, some, dv)


@compiled_sums
def _add_own_of_rigid(bones: Bones, skin: BoundSkin, deformer: int, by: Varying, rows: Ints, d: Floats) -> None:
    """R dx of rows that ride on one bone."""
    r = np.zeros((3, 3))
    for m in range(len(rows)):
        i = rows[m]
        w, t = skin.weights[i, deformer], skin.t[deformer, i]
        if w == 0.0 or 0.0 < t < 1.0:
            continue
        bone = skin.bones[deformer, int(t)]
        for j in range(3):
            for k in range(3):
                r[j, k] = w * bones.rotation[bone, j, k]
        _add_turned(r, by.rest[i], d[m])


@compiled_sums
def _add_turned(r: Floats, x: Floats, out: Floats) -> None:
    """Adds r @ x for r (3, 3) and x (3, m) to the last m columns of ``out``."""
    first = out.shape[1] - x.shape[1]
    for j in range(3):
        a, b, c = r[j, 0], r[j, 1], r[j, 2]
        for k in range(x.shape[1]):
            out[j, first + k] += a * x[0, k] + b * x[1, k] + c * x[2, k]


@compiled_sums
def _add_own_of_between(g: Between, skin: BoundSkin, deformer: int, by: Varying, rows: Ints, d: Floats) -> None:
    """R(t) d_arm + (R(t) arm + o(t))' dt of rows that ride on the frames between two bones."""
    bend, angle, turned = skin.kind[deformer] == BENDING, g.angle_and_mitre[0], g.rotation
    blended, bare, arm, across = np.zeros((3, 3)), np.zeros(3), np.zeros(3), np.zeros(3)
    local, dt = by.local[deformer], by.t[deformer]
    d_arm, by_t, first = np.zeros((3, dt.shape[1])), np.zeros(3), d.shape[2] - dt.shape[1]
    for m in range(len(rows)):
        i = rows[m]
        w, t = skin.weights[i, deformer], skin.t[deformer, i]
        if w == 0.0 or (bend and not 0.0 < t < 1.0):
            continue
        sine, cosine = math.sin(angle * t), math.cos(angle * t)
        for j in range(3):
            bare[j] = skin.local[deformer, i, j] - (skin.frame_translation[deformer, 0, j] if bend else 0.0)
            arm[j] = bare[j]
        if bend:
            by_reach, _, gain = squeeze(g, skin.axis[deformer], t, skin.width[deformer, i], arm, across)
            _fill_arm(g, skin, deformer, by, i, bare, across, by_reach, gain, d_arm)
        for j in range(3):
            by_t[j] = w * g.origin[1, j]
            for k in range(3):
                blended[j, k] = w * (turned[0, j, k] + sine * turned[1, j, k] + (1.0 - cosine) * turned[2, j, k])
                by_t[j] += w * angle * (cosine * turned[1, j, k] + sine * turned[2, j, k]) * arm[k]
        _add_turned(blended, d_arm if bend else local[i], d[m])
        for j in range(3):
            for k in range(dt.shape[1]):
                d[m, j, first + k] += by_t[j] * dt[i, k]


@compiled_sums
def _fill_arm(
    g: Between,
    skin: BoundSkin,
    deformer: int,
    by: Varying,
    i: int,
    q: Floats,
    across: Floats,
    by_reach: float,
    gain: float,
    d_arm: Floats,
) -> None:
    """How a bend's squeezed arm q + (k - 1) q_across varies with the body, for the same turn of the joint."""
    u, du, t, width = skin.axis[deformer], by.axis[deformer], skin.t[deformer, i], skin.width[deformer, i]
    s = (q[0] * g.inward[0] + q[1] * g.inward[1] + q[2] * g.inward[2]) / width
    along = q[0] * u[0] + q[1] * u[1] + q[2] * u[2]
    by_t = gain * (1.0 - 2.0 * t) / (t * (1.0 - t))  # of k, for the same s
    rest, centre = by.rest[i], by.frame_translation[deformer, 0]
    dt, d_width = by.t[deformer, i], by.width[deformer, i]
    for k in range(d_arm.shape[1]):
        x, y, z = rest[0, k] - centre[0, k], rest[1, k] - centre[1, k], rest[2, k] - centre[2, k]
        reach = x * g.inward[0] + y * g.inward[1] + z * g.inward[2]
        d_gain = by_reach * (reach - s * d_width[k]) + by_t * dt[k]
        d_along = x * u[0] + y * u[1] + z * u[2] + q[0] * du[0, k] + q[1] * du[1, k] + q[2] * du[2, k]
        d_arm[0, k] = x + across[0] * d_gain + gain * (x - u[0] * d_along - along * du[0, k])
        d_arm[1, k] = y + across[1] * d_gain + gain * (y - u[1] * d_along - along * du[1, k])
        d_arm[2, k] = z + across[2] * d_gain + gain * (z - u[2] * d_along - along * du[2, k])
