"""What a sensor without lens distortion can see, vertex by vertex in a compiled loop.

Its twin in plain NumPy stands in ``adapt.fit.correspondences.visible_from``, where it serves distorting lenses.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Floats
from capture.cloud.fuse import View
from capture.cloud.preprocess import Image
from capture.compiled import compiled


def see(view: View, vertices: Floats, normals: Floats, *, facing: float, occluded_m: float) -> NDArray[np.bool_]:
    """Which vertices (N, 3) with unit normals face the sensor, lie in its image and are not hidden.

    Facing means a cosine between normal and line of sight of more than ``facing``, hidden that something was measured
    more than ``occluded_m`` nearer.
    """
    camera, seen = view.camera, np.zeros(len(vertices), dtype=np.bool_)
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    _see(vertices, normals, view.world_from_sensor, lens, view.depth, facing, occluded_m, seen)
    return seen


@compiled
def _see(
    vertices: Floats,
    normals: Floats,
    world_from_sensor: Floats,
    lens: Floats,
    depth: Image,
    facing: float,
    occluded_m: float,
    seen: NDArray[np.bool_],
) -> None:
    t = world_from_sensor
    for m in range(len(vertices)):
        a, b, c = vertices[m, 0] - t[0, 3], vertices[m, 1] - t[1, 3], vertices[m, 2] - t[2, 3]
        towards = -(a * normals[m, 0] + b * normals[m, 1] + c * normals[m, 2])
        z = a * t[0, 2] + b * t[1, 2] + c * t[2, 2]
        if towards <= facing * np.sqrt(a * a + b * b + c * c) or z <= 0.0:
            continue
        column = np.rint(lens[0] * (a * t[0, 0] + b * t[1, 0] + c * t[2, 0]) / z + lens[2])
        row = np.rint(lens[1] * (a * t[0, 1] + b * t[1, 1] + c * t[2, 1]) / z + lens[3])
        if 0.0 <= column < depth.shape[1] and 0.0 <= row < depth.shape[0]:
            measured = depth[int(row), int(column)]
            seen[m] = not 0.0 < measured < z - occluded_m
