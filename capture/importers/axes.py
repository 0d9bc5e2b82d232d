"""Where the axes of a point cloud point, in words: ``x-right,y-up,z-back``.

The project's sensors, as OpenCV's, have x right, y down, z forward. A cloud written the other way up is behind the
sensor or upside down: it is turned when the user says so, or when the file tells who wrote it.
"""

from __future__ import annotations

import numpy as np

from capture.errors import RecordingError
from capture.rigid import Floats

SENSOR_AXES = "x-right,y-down,z-forward"
REALSENSE_AXES = "x-right,y-up,z-back"
"""Of the clouds that RealSense's SDK and viewer write as .ply: they turn y and z for programs that show them."""
_WAYS = {
    "right": (1, 0, 0),
    "left": (-1, 0, 0),
    "down": (0, 1, 0),
    "up": (0, -1, 0),
    "forward": (0, 0, 1),
    "back": (0, 0, -1),
}


def sensor_from_axes(text: str) -> Floats:
    """The rotation (3, 3) from axes so described to the sensor's.

    Raises:
        RecordingError: not three axes at right angles, or a mirror image of them.

    >>> sensor_from_axes("x-right,y-up,z-back").diagonal()
    array([ 1., -1., -1.])
    """
    said = dict(part.strip().lower().split("-", 1) for part in text.split(",") if "-" in part)
    remedy = f"such as {REALSENSE_AXES}; ways are {', '.join(_WAYS)}"
    if set(said) != {"x", "y", "z"} or not set(said.values()) <= set(_WAYS):
        raise RecordingError(f"{text!r} does not say where x, y and z point", remedy=remedy)
    turn = np.array([_WAYS[said[axis]] for axis in "xyz"], dtype=np.float64).T
    determinant = np.linalg.det(turn)
    if abs(determinant) < 0.5:
        raise RecordingError(f"in {text!r} two axes lie on one line", remedy=remedy)
    if determinant < 0.0:
        raise RecordingError(
            f"axes {text!r} are left-handed, so the cloud is a mirror image", remedy="turn one axis round in the file"
        )
    return turn
