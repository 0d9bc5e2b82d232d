"""Which way is up in a recording: its frame is the calibration box's, which may stand any way, but sensors stand level.

A sensor may look up or down, but its rows of pixels are level. So up is the direction that is square to all sensors' x
axes: the u of unit length with the least sum of (x_i . u)^2, on the side of their -y. One sensor alone, or several that
look the same way, tell no more than their own -y. A box that stands flat knows better: if an edge of it, an axis of the
frame, is within a few degrees, that is taken.
"""

from __future__ import annotations

import numpy as np

from capture.recording import Recording, world_from_sensor
from capture.rigid import Floats

AXES = {f"{sign}{name}": (-1.0 if sign else 1.0) * np.eye(3)[k] for sign in ("", "-") for k, name in enumerate("xyz")}
"""The six axes of a frame by name, as ``-y``: unit vectors (3,)."""

_FLAT = np.cos(np.deg2rad(5.0))
_APART = 1.0 - np.cos(np.deg2rad(20.0))  # the second eigenvalue of two sensors whose x axes are so far apart


def up_direction(recording: Recording) -> Floats:
    """The direction (3,) in a recording's frame that points up, of unit length.

    Raises:
        CalibrationError: where a sensor stands is not known.
    """
    turns = np.array([world_from_sensor(recording, sensor.name)[:3, :3] for sensor in recording.sensors])
    return upward(turns)


def upward(turns: Floats) -> Floats:
    """The same of sensors' turns (N, 3, 3), whose columns are the sensors' axes in the frame.

    >>> level = np.diag([1.0, -1.0, -1.0])  # x right, y down, z forward in a frame with y up
    >>> upward(level[None]).tolist()
    [0.0, 1.0, 0.0]
    """
    own, across = -turns[:, :, 1].sum(axis=0), turns[:, :, 0]
    spread, directions = np.linalg.eigh(across.T @ across)
    up = directions[:, 0] if spread[1] > _APART else own
    up = up * np.sign(up @ own) / np.linalg.norm(up)
    flat = max(AXES.values(), key=lambda axis: float(axis @ up))
    return np.asarray(flat if flat @ up > _FLAT else up)
