"""Where the whole body's joints stand at rest, told by the source's frames as they were posed into the skin.

Spline, hinge and ball joints have the rest values of the pose's own hinges. The blade's are read in the frame that
CompleteHumanModel gives its joint in the scapula; the ellipsoid's centre lies where these values put it. The arm's is
the turn from the blade's axes to the humerus's, the spine's the turn from one end of an arc to the other.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from adapt.template_builder.pose_bones import Placement
from capture.rigid import log_so3

Floats = NDArray[np.float64]

# CompleteHumanModel's scapulothoracic joint: radii (m), and its frame in the scapula (m, rad body-fixed X-Y-Z).
RADII = np.array([0.0829975, 0.199991, 0.083001])
_IN_SCAPULA, _TURNED = np.array([-0.0598196, -0.0390416, -0.0559802]), (-0.5181, -1.1416, -0.2854)


def blade_at_rest(thorax: Placement, scapula: Placement) -> tuple[Floats, dict[str, Floats]]:
    """Abduction, elevation and upward rotation (3,) rad of the right blade, and the ellipsoid's landmarks (3,) m.

    The radii are scaled as the thorax is.
    """
    turn = thorax.rotation.T @ scapula.rotation @ Rotation.from_euler("XYZ", _TURNED).as_matrix()
    abduction, tilt, upward = Rotation.from_matrix(turn).as_euler("YXZ")
    radii = RADII * thorax.scale
    centre = scapula.points(_IN_SCAPULA) - thorax.rotation @ (radii * turn[:, 2])
    ends = {
        name: centre + thorax.rotation @ (radii * axis)
        for name, axis in zip(("ellipsoid_front", "ellipsoid_top", "ellipsoid_side"), np.eye(3), strict=True)
    }
    return np.array([abduction, -tilt, upward]), {"ellipsoid_centre": centre} | ends


def arm_at_rest(scapula: Placement, humerus: Placement) -> Floats:
    """The rotation vector (3,) rad of the right shoulder."""
    return np.asarray(log_so3(scapula.rotation.T @ humerus.rotation))


def arc_at_rest(base: Floats, middle: Floats, top: Floats) -> float:
    """How far (rad) an arc from base over middle to top (3,) m turns backward: twice the angle of its two halves.

    >>> round(arc_at_rest(np.zeros(3), np.array([0.02, 0.1, 0.0]), np.array([0.0, 0.2, 0.0])), 2)  # bulging forward
    0.79
    """
    (x, y, _), (u, v, _) = middle - base, top - middle
    return 2.0 * float(np.arctan2(x * v - y * u, x * u + y * v))
