"""Where three coordinates shift a child to, in one of each axis' size; the equations are those of the joints' files."""

from __future__ import annotations

import math

from adapt.anatomy import Floats
from capture.compiled import compiled

_SMALL = 1e-2  # below this angle (rad) series replace the closed forms, whose terms cancel


@compiled
def arc(q: Floats, d: Floats) -> None:
    """The end w of an arc of length 1 that starts along y, in place of its turns q (3,) about x, z and y.

    With u = R e_y, a the angle from e_y to u, h = tan(a / 2) / a and f = sin(a) / a: w = (h u_x, f, h u_z), where
    d(h, f) = -(h', f') / sin(a) du_y. The derivatives go to the first columns of ``d`` (3, 3 and more).
    """
    sx, cx, sz, cz = math.sin(q[0]), math.cos(q[0]), math.sin(q[1]), math.cos(q[1])
    x, y, z = -sz, cx * cz, sx * cz
    sine = math.hypot(x, z)
    a = math.atan2(sine, y)
    if a < _SMALL:
        h, dh = 0.5 + a**2 / 24.0 + a**4 / 240.0, 1.0 / 12.0 + 11.0 * a**2 / 360.0
        f, df = 1.0 - a**2 / 6.0 + a**4 / 120.0, -1.0 / 3.0 - a**2 / 45.0
    else:
        half = math.tan(0.5 * a)
        h, dh = half / a, (0.5 * a * (1.0 + half * half) - half) / (a * a * sine)
        f, df = sine / a, (a * y - sine) / (a * a * sine)
    by_x, by_z = -sx * cz, -cx * sz  # of u_y
    d[0, 0], d[0, 1] = -dh * x * by_x, -h * cz - dh * x * by_z
    d[1, 0], d[1, 1] = -df * by_x, -df * by_z
    d[2, 0], d[2, 1] = h * cx * cz - dh * z * by_x, -h * sx * sz - dh * z * by_z
    d[0, 2], d[1, 2], d[2, 2] = 0.0, 0.0, 0.0
    q[0], q[1], q[2] = h * x, f, h * z


@compiled
def pole(q: Floats, d: Floats) -> None:
    """w = Ry(q_1) Rx(-q_2) e_z in place of q (3,); the derivatives go to the first columns of ``d`` (3, 3 and more)."""
    s1, c1, s2, c2 = math.sin(q[0]), math.cos(q[0]), math.sin(q[1]), math.cos(q[1])
    d[0, 0], d[1, 0], d[2, 0] = c1 * c2, 0.0, -s1 * c2
    d[0, 1], d[1, 1], d[2, 1] = -s1 * s2, c2, -c1 * s2
    d[0, 2], d[1, 2], d[2, 2] = 0.0, 0.0, 0.0
    q[0], q[1], q[2] = s1 * c2, s2, c1 * c2
