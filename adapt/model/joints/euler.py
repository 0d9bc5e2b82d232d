"""Angles that people read a rotation as: body-fixed X-Y-Z as OpenSim plays them, and ISB's Y-X-Y of an arm. In radians.

Inside, such a joint's coordinates are a rotation vector, which no pose locks; angles are made of it where they are
reported or written down.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from adapt.anatomy import Floats, Joint

_TURN = 2.0 * np.pi


def euler_names(joint: Joint) -> tuple[str, str, str]:
    """Names of the X-Y-Z angles that a joint's rotation vector is reported as.

    >>> from adapt.anatomy_file import load_anatomy
    >>> euler_names(load_anatomy("lower-limb-right").joint("pelvis"))
    ('pelvis_euler_x', 'pelvis_euler_y', 'pelvis_euler_z')
    """
    return f"{joint.name}_euler_x", f"{joint.name}_euler_y", f"{joint.name}_euler_z"


def euler_angles(rotation_vectors: Floats) -> Floats:
    """Body-fixed X-Y-Z angles (N, 3) of rotation vectors (N, 3), Y from -90 to 90 degrees.

    >>> euler_angles(np.array([[0.5, 0.5, 0.0], [0.3, 0.2, 0.1]])).round(2).tolist()
    [[0.54, 0.48, -0.14], [0.29, 0.21, 0.07]]
    """
    return np.asarray(Rotation.from_rotvec(rotation_vectors).as_euler("XYZ"))


def continuous_angles(rotation_vectors: Floats) -> Floats:
    """The same of a motion (T, 3), going on past 90 degrees of Y: of a turn's triples the one next to that before.

    A rotation has the angles (x, y, z) and (x + pi, pi - y, z + pi), each give or take whole turns. The first frame's
    are those next to zero.

    >>> raised = np.deg2rad([[0.0, 80.0, 0.0], [0.0, 100.0, 0.0], [0.0, 120.0, 0.0]])
    >>> [round(float(np.rad2deg(angles(raised)[-1, 1])), 6) for angles in (euler_angles, continuous_angles)]
    [60.0, 120.0]
    """
    angles = euler_angles(rotation_vectors)
    both = np.stack([angles, [np.pi, np.pi, np.pi] + angles * [1.0, -1.0, 1.0]], axis=1)
    last = np.zeros(3)
    for t, pair in enumerate(both):
        near = pair + _TURN * np.round((last - pair) / _TURN)
        last = angles[t] = near[np.argmin(np.linalg.norm(near - last, axis=1))]
    return angles


def arm_angles(turns: Floats) -> Floats:
    """Plane of elevation, elevation and axial rotation (N, 3) of an upper arm turned by (N, 3, 3): Y-X'-Y'' of ISB.

    Plane 0 is abduction, 90 degrees forward flexion. Elevation is counted positive: raising the arm turns about -X
    (Wu et al. 2005), so it is the same rotation with the tilt's sign turned over.

    >>> flexed = Rotation.from_rotvec([[0.0, 0.0, np.pi / 3.0]]).as_matrix()
    >>> np.rad2deg(arm_angles(flexed)).round(6).tolist()
    [[90.0, 60.0, -90.0]]
    """
    plane, tilt, axial = Rotation.from_matrix(turns).as_euler("YXY").T
    return np.column_stack([_half_turn(plane), tilt, _half_turn(axial)])


def _half_turn(angle: Floats) -> Floats:
    """angle + pi, brought into (-pi, pi]."""
    return np.asarray(np.pi - np.mod(-angle, _TURN))
