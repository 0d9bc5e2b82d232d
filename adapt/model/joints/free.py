"""The free joint: a bone placed in the recording's frame."""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Anatomy, Floats, Joint
from adapt.model.compiled.rows import Row, place
from adapt.model.derivatives import Motion, Points, compose, invert
from adapt.model.frames import frame_from_landmarks
from adapt.model.joints.euler import euler_angles, euler_names
from adapt.model.joints.joint_type import JointType
from adapt.model.joints.opensim import OsimCoordinate, OsimJoint, Resting, TransformAxis
from adapt.model.known_rows import of_known_rows
from capture.rigid import exp_so3, left_jacobian_so3, log_so3


class Free(JointType):
    """Six coordinates: a rotation vector (rad) and the origin of the child's frame (m), in the recording."""

    name = "free"
    units = ("rad", "rad", "rad", "m", "m", "m")
    free = True
    rotation_vector = (0, 1, 2)
    turned_over = (0, 1, 5)  # S = diag(1, 1, -1): a rotation vector r becomes -S r, a translation t becomes S t

    def motion(self, anatomy: Anatomy, joint: Joint, q: Floats, p: Points, columns: list[int]) -> Motion:
        """The child's frame placed by a rotation vector and an origin: H = [exp(q_r), q_t] C_child(p)^-1."""
        d_rotation, d_translation = np.zeros((2, 3, p.n))
        d_rotation[:, columns[:3]] = left_jacobian_so3(q[:3])
        d_translation[:, columns[3:]] = np.eye(3)
        placed = Motion(exp_so3(q[:3]), q[3:], d_rotation, d_translation)
        return compose(placed, invert(frame_from_landmarks(anatomy, anatomy.bone(joint.child).frame, p)))

    def rows(self, anatomy: Anatomy, joint: Joint, p: Points) -> list[Row]:
        """[exp(q_r), q_t] before C_child^-1."""
        return [place(invert(frame_from_landmarks(anatomy, anatomy.bone(joint.child).frame, p)))]

    def rest(self, anatomy: Anatomy, joint: Joint, p: Points) -> Floats:
        """Where the landmarks put the child's frame."""
        frame = frame_from_landmarks(anatomy, anatomy.bone(joint.child).frame, p)
        return np.concatenate([log_so3(frame.rotation), frame.translation])

    def reported(self, joint: Joint, q: Floats) -> dict[str, Floats]:
        """Body-fixed X-Y-Z angles, as OpenSim's FreeJoint has them, without jumps of a turn; and the origin."""
        angles = of_known_rows(q[:, :3], euler_angles)
        columns = {name: _unwrapped(angles[:, k]) for k, name in enumerate(euler_names(joint))}
        return columns | dict(zip(joint.coordinates[3:], q.T[3:], strict=True))

    def in_opensim(self, rest: Resting, joint: Joint, *, follows: bool) -> tuple[OsimJoint, ...]:
        """Body-fixed X-Y-Z angles instead of the rotation vector, and the translation: what OpenSim's FreeJoint does.

        But as a CustomJoint of six linear functions, because nimblephysics knows no FreeJoint.
        """
        coordinates = rest.coordinates(joint)
        index = [rest.anatomy.coordinate_index(name) for name in joint.coordinates[:3]]
        angles = euler_angles(rest.theta[None, index])[0]
        turns = (
            OsimCoordinate(name, c.low, c.high, float(angle))
            for name, c, angle in zip(euler_names(joint), coordinates, angles, strict=False)
        )
        own = (*turns, *coordinates[3:])
        axes = tuple(TransformAxis(axis, c.name) for axis, c in zip([*np.eye(3), *np.eye(3)], own, strict=True))
        return (OsimJoint("CustomJoint", joint.name, None, joint.child, np.eye(4), np.eye(4), own, axes),)

    def opensim_owners(self, joint: Joint) -> dict[str, str]:
        """Those of the X-Y-Z angles and of the translation."""
        return dict.fromkeys((*euler_names(joint), *joint.coordinates[3:]), joint.name)


def _unwrapped(angle: Floats) -> Floats:
    """Degrees without jumps of a turn between frames; NaN frames are passed over."""
    degrees, known = np.rad2deg(angle), np.isfinite(angle)
    degrees[known] = np.unwrap(degrees[known], period=360.0)
    return degrees
