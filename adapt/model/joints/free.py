"""The free joint: a bone placed in the recording's frame."""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Anatomy, Floats, Joint
from adapt.model.frames import frame_from_landmarks
from adapt.model.joints.joint_type import JointType
from adapt.model.variation import Motion, Points, compose, invert
from capture.rigid import exp_so3, left_jacobian_so3


class Free(JointType):
    """Six coordinates: a rotation vector (rad) and the origin of the child's frame (m), in the recording."""

    name = "free"
    units = ("rad", "rad", "rad", "m", "m", "m")
    free = True
    turned_over = (0, 1, 5)  # S = diag(1, 1, -1): a rotation vector r becomes -S r, a translation t becomes S t

    def motion(self, anatomy: Anatomy, joint: Joint, q: Floats, p: Points, columns: list[int]) -> Motion:
        """The child's frame placed by a rotation vector and an origin: H = [exp(q_r), q_t] C_child(p)^-1."""
        d_rotation, d_translation = np.zeros((2, 3, p.n))
        d_rotation[:, columns[:3]] = left_jacobian_so3(q[:3])
        d_translation[:, columns[3:]] = np.eye(3)
        placed = Motion(exp_so3(q[:3]), q[3:], d_rotation, d_translation)
        return compose(placed, invert(frame_from_landmarks(anatomy, anatomy.bone(joint.child).frame, p)))
