"""The ellipsoid: a shoulder blade that glides on the thorax.

Its coordinates are abduction, elevation and upward rotation, as in OpenSim's ScapulothoracicJoint without winging:

    R = Ry(q_1) Rx(-q_2) Rz(q_3),    t = side * radii * (R e_z), axis by axis

in a frame whose origin is the ellipsoid's centre. The blade turns as on a sphere: its z is the radius' direction before
the radii stretch it, not the normal of the ellipsoid (neither OpenSim's nor nimblephysics' joint does otherwise).

The radii are the distances of three pairs of landmarks. The third pair says the side, too: it runs from the centre to
where the blade lies, along the frame's z or against it. So a left blade has the coordinates of the right one: its
frame is -S F (``framed.turned_over``), in which turns keep their signs, and the blade lies against its z.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from adapt.anatomy import Anatomy, Floats, Joint
from adapt.model.compiled.rows import POLE, Row, reach, turn_about
from adapt.model.derivatives import Motion, Points
from adapt.model.joints.framed import Framed, turned_over
from adapt.model.joints.opensim import OsimCoordinate, OsimJoint, Resting
from capture.rigid import exp_so3

_X, _Y, _Z = np.eye(3)


class Ellipsoid(Framed):
    """Three turns (rad) of a child on an ellipsoid; ``axes`` are pairs of landmarks as far apart as its radii.

    The third pair runs to the side where the child is.
    """

    name = "ellipsoid"
    axes = 3

    def placed(self, anatomy: Anatomy, joint: Joint, q: Floats, p: Points, columns: Sequence[int]) -> Motion:
        """[R, side * radii * (R e_z)]."""
        sizes, d_sizes = self._sizes(anatomy, joint, p)
        first, second, third = exp_so3(q[0] * _Y), exp_so3(-q[1] * _X), exp_so3(q[2] * _Z)
        pole = first @ second @ _Z
        d_rotation, d_translation = np.zeros((3, p.n)), pole[:, None] * d_sizes
        if len(columns):
            by_q = np.column_stack([_Y, -first @ _X, pole])
            d_rotation[:, columns] = by_q
            d_translation[:, columns] += sizes[:, None] * np.cross(by_q, pole, axisa=0).T
        return Motion(first @ second @ third, sizes * pole, d_rotation, d_translation)

    def rows_inside(self, anatomy: Anatomy, joint: Joint, p: Points, after: Motion) -> list[Row]:
        """A shift from the centre to the surface, then the three turns."""
        to_surface = reach(POLE, *self._sizes(anatomy, joint, p))
        return [to_surface, turn_about(1, 0), turn_about(0, 1, turn=-1.0), turn_about(2, 2, after=after)]

    def mirrored(self, joint: Joint) -> Joint:
        """The frame turned over, in which turns keep their signs; the pairs of landmarks run to the other side."""
        return replace(joint, frames=tuple(turned_over(frame) for frame in joint.frames))

    def in_opensim(self, rest: Resting, joint: Joint, *, follows: bool) -> tuple[OsimJoint, ...]:
        """ScapulothoracicJoint, whose winging is locked at zero; radii are negative where the blade lies against z."""
        winging = OsimCoordinate(f"{joint.name}_winging", -1.0, 1.0, 0.0, locked=True)
        sizes, _ = self._sizes(rest.anatomy, joint, rest.p)
        own = {
            "thoracic_ellipsoid_radii_x_y_z": tuple(map(float, sizes)),
            "scapula_winging_axis_origin": (0.0, 0.0),
            "scapula_winging_axis_direction": (0.0,),
        }
        coordinates = (*rest.coordinates(joint, follows=follows), winging)
        return (rest.joint("ScapulothoracicJoint", joint, *self.offsets(rest, joint), coordinates, own=own),)

    def _sizes(self, anatomy: Anatomy, joint: Joint, p: Points) -> tuple[Floats, Floats]:
        """side * radii (3,) m and its derivative (3, n)."""
        first, second = np.array([[anatomy.landmark_index(name) for name in pair] for pair in joint.axes]).T
        apart, d_apart = p.value[second] - p.value[first], p.d[second] - p.d[first]
        radii = np.linalg.norm(apart, axis=1)
        side = np.sign(apart[2] @ self.frame(anatomy, joint, p).rotation[:, 2])
        return side * radii, side * np.einsum("ij,ijn->in", apart, d_apart) / radii[:, None]
