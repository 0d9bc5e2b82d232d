"""What an ideal depth sensor sees of a mesh, by rays: depth, the angle of the surface, and the projector's shadow."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture._open3d import open3d
from capture.camera import Camera, ray_slopes
from capture.projection import project
from capture.rigid import Floats, apply, inverse
from capture.simulation.rig import Ints

Floats32 = NDArray[np.float32]

_SHADOW_OFFSET_M = 0.001  # a shadow ray starts this far off the surface


@dataclass(frozen=True, eq=False)
class View:
    """What one ideal sensor sees, all (H, W): depth z (m, 0 for nothing), cosine of ray to normal, shadow."""

    depth: Floats32
    normal_cos: Floats32
    shadow: NDArray[np.bool_]


def cast(scene: Any, camera: Camera, world_from_sensor: Floats, vertices: Floats, baseline_m: float) -> View:
    """The exact view of the scene of a mesh with ``vertices`` (V, 3) m (see ``scene_of``).

    Rays are cast only where the vertices' bounding rectangle is in the image. Without a baseline nothing is in shadow.
    """
    shape = (camera.height, camera.width)
    view = View(np.zeros(shape, np.float32), np.zeros(shape, np.float32), np.zeros(shape, np.bool_))
    window = _image_window(camera, apply(inverse(world_from_sensor), vertices))
    slopes = ray_slopes(camera)[window]
    if slopes.size == 0:
        return view
    rotation, origin = world_from_sensor[:3, :3], world_from_sensor[:3, 3]
    directions = np.concatenate([slopes, np.ones((*slopes.shape[:2], 1))], axis=-1) @ rotation.T
    hits = scene.cast_rays(_rays(np.broadcast_to(origin, directions.shape), directions))
    depth = hits["t_hit"].numpy()  # directions have z = 1 in the sensor's frame, so this is z
    hit = np.isfinite(depth)
    normals = hits["primitive_normals"].numpy()
    across = (normals * directions).sum(axis=-1)
    view.depth[window] = np.where(hit, depth, 0.0)
    view.normal_cos[window] = np.where(hit, np.abs(across) / np.linalg.norm(directions, axis=-1), 0.0)
    if baseline_m > 0.0:
        facing = normals[hit] * -np.sign(across[hit])[:, None]
        starts = origin + directions[hit] * depth[hit][:, None] + _SHADOW_OFFSET_M * facing
        projector = origin + rotation[:, 0] * baseline_m
        view.shadow[window][hit] = scene.test_occlusions(_rays(starts, projector - starts), tfar=1.0).numpy()
    return view


def _rays(origins: Floats, directions: Floats) -> Any:
    rays = np.concatenate([origins, directions], axis=-1).astype(np.float32)
    return open3d().core.Tensor.from_numpy(np.ascontiguousarray(rays))


def scene_of(vertices: Floats, faces: Ints) -> Any:
    """The mesh with vertices (V, 3) m and faces (F, 3), ready to cast rays at: an Open3D ``RaycastingScene``."""
    core = open3d().core
    scene = open3d().t.geometry.RaycastingScene()
    scene.add_triangles(
        core.Tensor.from_numpy(np.ascontiguousarray(vertices, dtype=np.float32)),
        core.Tensor.from_numpy(np.ascontiguousarray(faces, dtype=np.uint32)),
    )
    return scene


def _image_window(camera: Camera, points: Floats) -> tuple[slice, slice]:
    """Rows and columns of the image that points (N, 3) of the sensor's frame can fall on, one pixel around included."""
    pixels, _ = project(camera, points)
    if not np.isfinite(pixels).all():
        return slice(0, camera.height), slice(0, camera.width)
    low = np.clip(np.floor(pixels.min(axis=0)) - 1, 0, (camera.width, camera.height)).astype(int)
    high = np.clip(np.ceil(pixels.max(axis=0)) + 2, 0, (camera.width, camera.height)).astype(int)
    return slice(low[1], high[1]), slice(low[0], high[0])
