"""Formats whose readers take y for up get a motion turned upright; others keep the recording's frame."""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Floats
from capture.rigid import hat
from capture.upright import AXES
from track.motion import Motion


def told_up(motion: Motion) -> Floats | None:
    """The direction (3,) that points up, where the motion knows it from its recording; older motions do not."""
    told = None if motion.settings is None else motion.settings.options.get("up")
    return None if told is None else np.array(told)


def y_up(up: Floats) -> Floats:
    """The smallest turn (4, 4) that brings a direction (3,) of unit length to y.

    >>> turn = y_up(np.array([0.0, -1.0, 0.0]))
    >>> (turn @ [0.0, -2.0, 0.0, 1.0]).tolist(), round(float(np.linalg.det(turn)), 6)
    ([0.0, 2.0, 0.0, 1.0], 1.0)
    """
    y, turn = AXES["y"], np.eye(4)
    axis, cosine = np.cross(up, y), float(up @ y)
    if cosine > -1.0 + 1e-9:
        cross = hat(axis)
        turn[:3, :3] = np.eye(3) + cross + cross @ cross / (1.0 + cosine)
    else:
        turn[:3, :3] = np.diag([1.0, -1.0, -1.0])
    return turn


def up_in_words(up: Floats) -> str:
    """A direction's name where it is an axis, else its parts.

    >>> up_in_words(np.array([0.0, 0.0, -1.0])), up_in_words(np.array([0.6, 0.8, 0.0]))
    ('-z', '(0.60, 0.80, 0.00)')
    """
    named = [name for name, axis in AXES.items() if np.allclose(axis, up)]
    return named[0] if named else f"({', '.join(f'{part:.2f}' for part in up)})"
