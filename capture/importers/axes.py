"""Which way the axes of a point cloud point: stated as ``x-right,y-up,z-back``, or told by a file's header.

The sensor's own axes here are x-right,y-down,z-forward, as seen by the sensor. A set of axes of the other handedness is
no mirrored scene: the words say where each axis points, and the points are put where they were.
"""

from __future__ import annotations

import numpy as np

from capture.rigid import Floats

_WORDS = {
    "right": (1.0, 0.0, 0.0), "left": (-1.0, 0.0, 0.0), "down": (0.0, 1.0, 0.0), "up": (0.0, -1.0, 0.0),
    "forward": (0.0, 0.0, 1.0), "back": (0.0, 0.0, -1.0),
}  # fmt: skip

AXES_OF_SCREENS = "x-right,y-up,z-back"
"""The axes of OpenGL, in which RealSense's own program saves its clouds."""


def sensor_from_axes(text: str) -> Floats:
    """The matrix (3, 3) that maps points of the axes that a text names into the sensor's own.

    >>> sensor_from_axes("x-right,y-up,z-back")
    array([[ 1.,  0.,  0.],
           [ 0., -1.,  0.],
           [ 0.,  0., -1.]])

    Raises:
        ValueError: the text does not say where x, y and z point, or two of them point along one line.
    """
    said = dict(part.strip().lower().partition("-")[::2] for part in text.split(","))
    if sorted(said) != ["x", "y", "z"] or not set(said.values()) <= set(_WORDS):
        raise ValueError(
            f"{text!r} does not say where x, y and z point, as x-right,y-up,z-back does "
            f"(each {', '.join(_WORDS)}; as seen by the sensor)"
        )
    matrix = np.array([_WORDS[said[axis]] for axis in "xyz"]).T
    if abs(np.linalg.det(matrix)) < 0.5:
        raise ValueError(f"in {text!r} two axes point along one line")
    return matrix + 0.0
