"""A motion that two bones decide: what hangs on one points at a landmark of another (adapt.model.joints.strut)."""

from __future__ import annotations

import math

import numpy as np

from adapt.anatomy import Floats
from adapt.model.compiled.links import Bones, Chain
from adapt.model.compiled.rotations import add_cross, add_product, turn
from capture.compiled import compiled


@compiled
def point_at(chain: Chain, s: int, bones: Bones, g: Floats, swung: Floats) -> int:
    """G = [Ry Rx, 0] in ``g``, of what points at a landmark of another bone, and its whole derivative (3, n + m)."""
    before, other, n = chain.before[s], chain.other[s], swung.shape[1] - chain.d_point.shape[2]
    at, apart = np.zeros(3), np.zeros(3)
    turn(bones.rotation[other], chain.point[s], at)
    for i in range(3):
        apart[i] = at[i] + bones.translation[other, i] - bones.translation[before, i]
    d_apart = bones.d_translation[other] - bones.d_translation[before]
    add_cross(at, bones.d_rotation[other], -1.0, d_apart)
    add_cross(apart, bones.d_rotation[before], 1.0, d_apart)
    add_product(bones.rotation[other], chain.d_point[s], d_apart[:, n:])
    back, inside, d_inside = bones.rotation[before].T, np.zeros(3), np.zeros(d_apart.shape)
    turn(back, apart, inside)
    add_product(back, d_apart, d_inside)
    x, y, z = chain.turn[s] * inside[0], chain.turn[s] * inside[1], chain.turn[s] * inside[2]
    flat, whole = math.hypot(x, z), math.sqrt(x * x + y * y + z * z)
    sy, cy, sx, cx = x / flat, z / flat, -y / whole, flat / whole
    g[0, 0], g[0, 1], g[0, 2] = cy, sy * sx, sy * cx
    g[1, 0], g[1, 1], g[1, 2] = 0.0, cx, -sx
    g[2, 0], g[2, 1], g[2, 2] = -sy, cy * sx, cy * cx
    for k in range(swung.shape[1]):
        dx, dy, dz = (chain.turn[s] * d_inside[0, k], chain.turn[s] * d_inside[1, k], chain.turn[s] * d_inside[2, k])
        about_y, about_x = (cy * dx - sy * dz) / flat, -(cx * dy + sx * (sy * dx + cy * dz)) / whole
        swung[0, k], swung[1, k], swung[2, k] = cy * about_x, about_y, -sy * about_x
    return 0


@compiled
def swing_along(outer: Floats, after: Floats, g: Floats, swung: Floats, bones: Bones, bone: int) -> None:
    """Adds what a bone that points moves by as G turns; what lies ``after`` G swings along."""
    carried, moved = np.zeros(3), np.zeros(swung.shape)
    turn(g, after, carried)
    add_cross(carried, swung, -1.0, moved)
    add_product(outer, swung, bones.d_rotation[bone])
    add_product(outer, moved, bones.d_translation[bone])
