"""The bend deformer: skin about a joint that bends far (a hip, a knee, an ankle) and must not collapse.

Two planes at rest bound the bend: before ``start`` skin rides on the first bone, beyond ``end`` on the second. With
a and b the distances past the first plane and before the second, neither less than 0,

    t = a / (a + b)

is constant on planes that fan out from the line where the two planes meet, so a bend may be short over a kneecap and
long in the hollow of the knee. Each such slice turns about the joint's centre c by its share of the whole turn:

    x' = o(t) + exp(t rho) R_1 (q + (k - 1) q_across),   q = x - c,   rho = log(R_2 R_1^T)
    o(t) = (1 - t) T_1 c + t T_2 c

Distances from the centre stay what they were (linear blending would shorten them by the cosine of half the angle),
but on the inner side of the bend, across the limb's axis u:

    k = 1 + 4 t (1 - t) f,   f = (m s^2 / (s^2 + 0.09) - 0.3 s^4) / (1 + s^4),   m = h (1 + h),   h = |rho|^2 / 8
    s = max(0, (R_1^T rho x u) . q / (a + b))

s is how much the slices close up there: 0 on the outer side, 1 where they touch. Until then tissue evades outwards,
as far as a mitred corner reaches (m is about 1 / cos(|rho| / 2) - 1); beyond, where slices would pass through each
other, a crease draws inwards instead. The two numbers are chosen by hand.

Planes, slices and q do not depend on the pose: they are worked out once for a body. Fitting runs the same equations as
compiled loops: BENDING in ``adapt.model.compiled.skin``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adapt.anatomy import Anatomy, Deformer, Floats, Ints
from adapt.model.blended_frames import blended_frames
from adapt.model.compiled.layout import BENDING, Layout
from adapt.model.deformers.deformer_type import DeformerType
from adapt.model.deformers.slices import slices, y_axis
from adapt.model.derivatives import Motion, Points, compose, mere_points, move, still_points
from adapt.model.frames import frame_from_landmarks
from capture.rigid import hat, left_jacobian_so3, log_so3

_ONSET, _CREASE = 0.09, 0.3


@dataclass(frozen=True)
class BoundBend:
    """Skin at rest and in which slice of the bend it lies.

    ``skin`` are the points (N, 3); ``t`` (N,) are their shares and ``width`` (N,) is a + b in m, with derivatives
    (N, n), or (1, 1) where they do not vary; ``centre`` and ``axis`` (1, 3) are c and u.
    """

    skin: Points
    t: Floats
    width: Floats
    dt: Floats
    d_width: Floats
    centre: Points
    axis: Points

    def at(self, index: Ints | slice) -> BoundBend:
        """Some of the points."""
        dt, d_width = (d if len(d) == 1 else d[index] for d in (self.dt, self.d_width))
        parts = (self.skin.at(index), self.t[index], self.width[index], dt, d_width)
        return BoundBend(*parts, self.centre, self.axis)


class Bend(DeformerType):
    """Skin about the joint of two bones; ``frames`` are the planes where the bend starts and ends, and the centre.

    Their y axes point from the first bone to the second: normals of the planes, and the limb's axis.
    """

    name = "bend"
    bones = 2
    frames = 3
    swells = True

    def bind(self, anatomy: Anatomy, deformer: Deformer, p: Points, skin: Points) -> BoundBend:
        """Skin points at rest in the slices of a bend, with derivatives; ``frames`` are start, end and centre.

        Their y axes point from the first bone to the second: normals of the planes, and the limb's axis.
        """
        start, end, centre = (frame_from_landmarks(anatomy, frame, p) for frame in deformer.frames)
        middle = Points(centre.translation[None], centre.d_translation[None])
        along = Points(*(each[None] for each in y_axis(centre)))
        t, width, dt, d_width = slices(start, end, skin)
        if skin.still and not p.d.any():  # then nothing varies at rest
            none = np.zeros((1, 1))
            return BoundBend(skin, t, width, none, none, still_points(middle.value), still_points(along.value))
        return BoundBend(skin, t, width, dt, d_width, middle, along)

    def carry(self, bound: BoundBend, motions: tuple[Motion, ...]) -> Points:
        """The bound points where the bend carries them, with derivatives."""
        n = motions[0].n
        value, d = np.zeros_like(bound.skin.value), np.zeros((*bound.skin.value.shape, n))
        before, beyond = np.flatnonzero(bound.t == 0.0), np.flatnonzero(bound.t == 1.0)
        bending = np.flatnonzero((bound.t > 0.0) & (bound.t < 1.0))
        for rows, moved in (
            (before, move(motions[0], bound.skin.at(before))),
            (beyond, move(motions[1], bound.skin.at(beyond))),
            (bending, _turned(bound.at(bending), motions)),
        ):
            value[rows], d[rows] = moved.value, moved.d
        return Points(value, d)

    def bone_shares(self, bound: BoundBend) -> tuple[Floats, ...]:
        """1 - t and t."""
        return 1.0 - bound.t, bound.t

    def layout(self, anatomy: Anatomy, deformer: Deformer, p: Points, skin: Points) -> Layout:
        """The points' slices, and the joint's centre with no rotation, on either bone."""
        start, end, centre = (frame_from_landmarks(anatomy, frame, p) for frame in deformer.frames)
        (axis, d_axis), still = y_axis(centre), np.zeros_like(centre.d_translation)
        t, width, dt, d_width = slices(start, end, skin)
        ends = (Motion(np.eye(3), centre.translation, still, centre.d_translation),) * 2
        return Layout(BENDING, t, width, ends, axis, d_t=dt, d_width=d_width, d_axis=d_axis)

    def turning_frames(
        self, anatomy: Anatomy, deformer: Deformer, p: Points, bound: BoundBend
    ) -> tuple[Motion, Motion]:
        """The frame at the joint's centre, on either bone."""
        centre = frame_from_landmarks(anatomy, deformer.frames[2], p)
        return centre, centre

    def swelling(self, bound: BoundBend, motions: tuple[Motion, Motion]) -> Floats:
        """k - 1 (N,) of the bound points: by how much of its distance from the limb's axis tissue evades outwards."""
        u = bound.axis.value[0]
        arm, bare = _squeezed(bound, _turn_at_rest(*motions)).value, bound.skin.value - bound.centre.value
        across = bare - np.outer(bare @ u, u)
        return np.asarray(np.einsum("ij,ij->i", arm - bare, across) / np.maximum((across**2).sum(axis=1), 1e-12))

    def reach(self, bound: BoundBend) -> Floats:
        """The distance (N,) m of each bound point from the limb's axis through the joint's centre."""
        return np.asarray(np.linalg.norm(np.cross(bound.skin.value - bound.centre.value, bound.axis.value[0]), axis=1))


def _turned(bound: BoundBend, motions: tuple[Motion, ...]) -> Points:
    """Points (N, 3) turned about the joint's centre, each by its own share of the turn."""
    at_centre = Motion(np.eye(3), bound.centre.value[0], np.zeros_like(bound.centre.d[0]), bound.centre.d[0])
    first, second = (compose(motion, at_centre) for motion in motions)
    frame = blended_frames(first, second, bound.t, bound.dt)
    arm = _squeezed(bound, _turn_at_rest(*motions))
    posed = np.einsum("nij,nj->ni", frame.rotation, arm.value)
    if not motions[0].n:
        return mere_points(frame.origin + posed)
    d = frame.d_origin + np.matmul(frame.rotation, arm.d) + np.matmul(hat(-posed), frame.d_rotation)
    return Points(frame.origin + posed, d)


def _turn_at_rest(first: Motion, second: Motion) -> Points:
    """R_1^T rho (1, 3): the rotation vector from bone 1 to bone 2 as bone 1 sees it at rest."""
    back, between = first.rotation.T, second.rotation @ first.rotation.T
    rho = log_so3(between)
    d_rho = np.linalg.solve(left_jacobian_so3(rho), second.d_rotation - between @ first.d_rotation)
    return Points((back @ rho)[None], (back @ (d_rho + hat(rho) @ first.d_rotation))[None])


def _squeezed(bound: BoundBend, turn: Points) -> Points:
    """q + (k - 1) q_across for the arms q (N, 3)."""
    q, dq = bound.skin.value - bound.centre.value, bound.skin.d - bound.centre.d
    u, du = bound.axis.value[0], bound.axis.d[0]
    inward = np.cross(turn.value[0], u)
    d_inward = hat(-u) @ turn.d[0] + hat(turn.value[0]) @ du
    s = q @ inward / bound.width
    ds = (np.matmul(inward, dq) + q @ d_inward - s[:, None] * bound.d_width) / bound.width[:, None]
    f, df = _evasion(np.maximum(s, 0.0), ds * (s > 0.0)[:, None], *_mitre(turn))
    hump, d_hump = 4.0 * bound.t * (1.0 - bound.t), (4.0 - 8.0 * bound.t)[:, None] * bound.dt
    gain, d_gain = hump * f, f[:, None] * d_hump + hump[:, None] * df

    length = q @ u
    d_length = np.matmul(u, dq) + q @ du
    across = q - length[:, None] * u
    d_across = dq - u[:, None] * d_length[:, None, :] - length[:, None, None] * du
    d = dq + across[:, :, None] * d_gain[:, None, :] + gain[:, None, None] * d_across
    return Points(q + gain[:, None] * across, d)


def _mitre(turn: Points) -> tuple[float, Floats]:
    """m and its derivative (n,)."""
    h = float(turn.value[0] @ turn.value[0]) / 8.0
    return h * (1.0 + h), (1.0 + 2.0 * h) * (turn.value[0] @ turn.d[0]) / 4.0


def _evasion(s: Floats, ds: Floats, mitre: float, d_mitre: Floats) -> tuple[Floats, Floats]:
    """f (N,) and its derivative (N, n)."""
    onset, over = s**2 / (s**2 + _ONSET), 1.0 + s**4
    d_onset = 2.0 * s * _ONSET / (s**2 + _ONSET) ** 2
    f = (mitre * onset - _CREASE * s**4) / over
    by_s = (mitre * d_onset - 4.0 * _CREASE * s**3 - 4.0 * f * s**3) / over
    return f, by_s[:, None] * ds + (onset / over)[:, None] * d_mitre
