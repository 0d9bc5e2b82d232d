"""Shaded pictures of meshes and points by ray casting: no screen and no graphics driver needed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Floats, Ints
from capture._open3d import open3d
from capture.camera import Camera
from capture.files import replaced_when_complete
from capture.own import marked_png
from capture.projection import project
from capture.rigid import apply, inverse, transform

SKIN, BONE, CLOUD = (0.87, 0.66, 0.55), (0.96, 0.94, 0.86), (0.10, 0.35, 0.75)


@dataclass(frozen=True, eq=False)
class Layer:
    """A mesh to show: vertices (V, 3) m, faces (F, 3), colour (RGB in [0, 1]) and opacity."""

    vertices: Floats = field(repr=False)
    faces: Ints = field(repr=False)
    colour: tuple[float, float, float] = SKIN
    opacity: float = 1.0


def look_at(points: Floats, direction: Floats, up: Floats, *, distance_m: float = 2.0) -> Floats:
    """Pose (4, 4) of an eye ``distance_m`` away along ``direction`` from the middle of points (N, 3).

    >>> eye = look_at(np.zeros((1, 3)), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    >>> eye[:3, 3].tolist(), (eye[:3, 3] + 2.0 * eye[:3, 2]).tolist()  # its z leads back to the middle
    ([2.0, 0.0, 0.0], [0.0, 0.0, 0.0])
    >>> eye[:3, 1].tolist()  # and its y down
    [0.0, -1.0, 0.0]
    """
    forward = -np.asarray(direction) / np.linalg.norm(direction)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
    return transform(np.column_stack([right, np.cross(forward, right), forward]), middle - distance_m * forward)


def framing_camera(world_from_eye: Floats, points: Floats, *, width: int = 480, height: int = 480) -> Camera:
    """A camera at the eye that has all points (N, 3) in its image, with a margin.

    >>> points = np.array([[0.5, 0.0, 1.0], [-0.5, 0.25, 1.0]])
    >>> camera = framing_camera(np.eye(4), points)
    >>> camera.width, project(camera, points)[0].round(1).tolist()
    (480, [[460.3, 239.5], [18.7, 349.9]])
    """
    seen = apply(inverse(world_from_eye), points)
    reach = np.abs(seen[:, :2] / seen[:, 2:]).max(axis=0)
    focal = 0.46 * min(width / reach[0], height / reach[1])
    return Camera(width, height, focal, focal, (width - 1) / 2.0, (height - 1) / 2.0)


def render(
    layers: Sequence[Layer],
    world_from_eye: Floats,
    camera: Camera,
    *,
    points: Floats | None = None,
    point_colour: tuple[float, float, float] | Floats | None = None,
    background: NDArray[np.uint8] | None = None,
) -> NDArray[np.uint8]:
    """An image (H, W, 3) of translucent layers, nearest last, with points (N, 3) drawn where nothing hides them.

    A translucent layer does not hide the points behind it; an opaque one does. Points have one colour (RGB in [0, 1])
    or each its own (N, 3). Behind all is white, or an image (H, W, 3).
    """
    image = np.ones((camera.height, camera.width, 3)) if background is None else background / 255.0
    casts = [_cast(layer, world_from_eye, camera) for layer in layers]
    depth = np.array([cast[0] for cast in casts]).reshape(len(casts), camera.height, camera.width)
    rows, columns = np.nonzero(np.isfinite(depth).any(axis=0))  # most of a picture is empty
    found, shades = depth[:, rows, columns], np.array([shade[rows, columns] for _, shade in casts])
    colours = image[rows, columns]
    for order in np.argsort(-found, axis=0):
        for k, layer in enumerate(layers):
            here = (order == k) & np.isfinite(found[k])
            alpha = layer.opacity
            colours[here] = (1.0 - alpha) * colours[here] + alpha * shades[k, here, None] * np.array(layer.colour)
    image[rows, columns] = colours
    if points is not None:
        opaque = [depth[k] for k, layer in enumerate(layers) if layer.opacity >= 1.0]
        front = np.min(opaque, axis=0) if opaque else np.full(image.shape[:2], np.inf)
        colours = np.broadcast_to(np.array(CLOUD if point_colour is None else point_colour), points.shape)
        _splat(image, points, colours, world_from_eye, camera, front)
    return np.asarray(np.clip(255.0 * image, 0.0, 255.0), dtype=np.uint8)


def save_png(image: NDArray[np.uint8], path: Path) -> None:
    """Write an RGB image (H, W, 3) as PNG with the mark of ``capture.own``."""
    import cv2

    _, encoded = cv2.imencode(".png", image[:, :, ::-1])
    with replaced_when_complete(path) as partial:
        partial.write_bytes(marked_png(encoded.tobytes()))


def _cast(layer: Layer, world_from_eye: Floats, camera: Camera) -> tuple[Floats, Floats]:
    """Depth (H, W) (inf where nothing) and shade (H, W) in [0, 1] of one layer."""
    core = open3d().core
    scene = open3d().t.geometry.RaycastingScene()
    scene.add_triangles(
        core.Tensor.from_numpy(np.ascontiguousarray(layer.vertices, dtype=np.float32)),
        core.Tensor.from_numpy(np.ascontiguousarray(layer.faces, dtype=np.uint32)),
    )
    depth, shade = np.full((camera.height, camera.width), np.inf), np.zeros((camera.height, camera.width))
    part = _covered(layer.vertices, world_from_eye, camera)
    if not depth[part].size:
        return depth, shade
    rays = scene.create_rays_pinhole(camera.matrix, inverse(world_from_eye), camera.width, camera.height)
    hits = scene.cast_rays(core.Tensor.from_numpy(np.ascontiguousarray(rays.numpy()[part])))
    far = hits["t_hit"].numpy()
    hit = np.isfinite(far)
    normals = hits["primitive_normals"].numpy()[hit]
    toward = -(normals @ world_from_eye[:3, 2])
    above = np.abs(normals @ (world_from_eye[:3, 2] + 0.7 * world_from_eye[:3, 1] + 0.4 * world_from_eye[:3, 0]))
    depth[part] = far
    shade[part][hit] = np.minimum(0.35 + 0.35 * np.abs(toward) + 0.25 * above, 1.0)
    return depth, shade


def _covered(vertices: Floats, world_from_eye: Floats, camera: Camera) -> tuple[slice, slice]:
    """The rows and columns that a mesh can be seen in; all, if some of it is beside or behind the eye."""
    uv, _ = project(replace(camera, distortion=()), apply(inverse(world_from_eye), vertices))
    if not len(uv) or not np.isfinite(uv).all():
        return slice(None), slice(None)
    low = np.maximum(np.floor(uv.min(axis=0)).astype(int) - 1, 0)
    high = np.maximum(np.ceil(uv.max(axis=0)).astype(int) + 2, 0)
    return slice(int(low[1]), int(high[1])), slice(int(low[0]), int(high[0]))


def _splat(
    image: Floats,
    points: Floats,
    colours: Floats,
    world_from_eye: Floats,
    camera: Camera,
    front: Floats,
) -> None:
    """Draw points as small squares, where no opaque surface is nearer."""
    uv, z = project(camera, apply(inverse(world_from_eye), points))
    has_pixel = np.isfinite(uv).all(axis=1)
    uv, z, colours = uv[has_pixel], z[has_pixel], colours[has_pixel]
    for du in (0, 1):
        for dv in (0, 1):
            u, v = np.rint(uv[:, 0]).astype(int) + du, np.rint(uv[:, 1]).astype(int) + dv
            inside = (u >= 0) & (v >= 0) & (u < camera.width) & (v < camera.height)
            u, v, near = u[inside], v[inside], z[inside]
            shown = near < front[v, u] + 0.003
            image[v[shown], u[shown]] = colours[inside][shown]
