"""Which way a mesh from a file stands: the simulator's sensors take X as forward, Y as up, Z as right.

What is in other axes would be recorded lying on its side, or, if its axes are mirrored, from the inside: neither fails,
and nothing that is made of it afterwards fits. So a mesh that seems to be so is refused, until its axes are stated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from capture.errors import RecordingError
from capture.rigid import Floats
from capture.simulation.rig import Ints

_LYING = 1.25  # times its height that something standing may be long or wide; open arms span about their owner's height
_HOLLOW = 0.01  # of (area / 6)^1.5, a cube's volume: less than this encloses nothing, as a sheet does not
_AXES = ("+x", "-x", "+y", "-y", "+z", "-z")


@dataclass(frozen=True)
class MeshAxes:
    """Which of a file's axes point up and forward, such as "+z" and "-y"; a sign may be left out where it is +.

    Raises:
        RecordingError: no such axis, or both name the same one.
    """

    up: str
    forward: str

    def __post_init__(self) -> None:
        if abs(_direction(self.up) @ _direction(self.forward)) > 0.0:
            raise RecordingError(
                f"up is {self.up} and forward is {self.forward}: the same axis", remedy="name two different ones"
            )

    def turned(self, points: Floats) -> Floats:
        """Points (..., 3) in axes X forward, Y up, Z right; always a turn, never a mirror image.

        >>> MeshAxes("+z", "-y").turned(np.array([0.1, -0.3, 1.7]))
        array([ 0.3,  1.7, -0.1])
        """
        forward, up = _direction(self.forward), _direction(self.up)
        return np.asarray(points @ np.array([forward, up, np.cross(forward, up)]).T)


def _direction(name: str) -> Floats:
    """The unit vector (3,) of an axis' name."""
    axis = name.strip().lower()
    axis = axis if axis.startswith(("+", "-")) else f"+{axis}"
    if axis not in _AXES:
        raise RecordingError(f"no axis is called {name!r}", remedy=f"use one of {', '.join(_AXES)}")
    unit = np.zeros(3)
    unit["xyz".index(axis[1])] = 1.0 if axis[0] == "+" else -1.0
    return unit


def require_standing(points: Floats) -> None:
    """Refuse what is clearly longer or wider than it is high: points (V, 3) m, Y up.

    Raises:
        RecordingError: it seems to lie; the remedy says how to state the axes.
    """
    size = np.ptp(points, axis=0)
    longest = int(np.argmax(size))
    if size[longest] > _LYING * size[1]:
        raise RecordingError(
            f"the mesh seems to lie: it is {size[1]:.2f} m along Y, which is up, and {size[longest]:.2f} m along "
            f"{'XYZ'[longest]}",
            remedy="state its axes, as --up +z --forward +x; if it does lie, --up +y --forward +x",
        )


def require_outward(points: Floats, faces: Ints) -> None:
    """Refuse a surface whose triangles face inwards: points (V, 3) m, faces (F, 3), closed or nearly.

    The volume is that of the cones from the middle of the points: (1/6) sum_f a . (b x c), positive if a, b, c run
    counter-clockwise as seen from outside. What encloses next to nothing is neither, and passes.

    Raises:
        RecordingError: the sensors would see it from the inside.
    """
    a, b, c = (points - points.mean(axis=0))[faces].transpose(1, 0, 2)
    volume = float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0
    area = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) / 2.0
    if volume < -_HOLLOW * (area / 6.0) ** 1.5:
        raise RecordingError(
            "the mesh's triangles face inwards: the sensors would see it from the inside",
            remedy="if its axes were exchanged, mirror it back; otherwise store faces[:, ::-1]",
        )
