"""What the sensors can see of posed skin: the one place where that is decided.

A sensor sees a vertex that faces it, falls into its image, and is not hidden by something measured nearer. How square
to the line of sight counts as facing depends on what the answer is for; the cosines stand side by side below. Nothing
is asked of the skin's own depth order: an arm before the trunk hides it because the sensor measured the arm.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Floats, Ints
from capture.cloud.fuse import Cloud, View
from capture.cloud.preprocess import Image
from capture.compiled import compiled, compiled_sums
from capture.projection import Lens, lens_of, pixels_in, pixels_within
from capture.rigid import apply, inverse

Bools = NDArray[np.bool_]

# Cosines between a unit normal and the line of sight, above which skin faces the sensor.
_TO_MATCH = 0.2  # 78 degrees: a match is gated by distance and by its normal, too, so oblique skin may have one
_TO_SCORE = 0.3  # 73 degrees: skin not found speaks against a pose, and sensors lose what they see at grazing angles
_TO_START = 0.2  # as to match, but from the mean direction of all sensors: where vertices will stand is not known yet
# Below this one, and above its negative, skin belongs to the outline: a quarter of a round limb does.
_OUTLINE = 0.35  # to the viewing axis, within 20 degrees of square

_OCCLUDED_M = 0.03  # something measured this much nearer hides a vertex; skin of a pose nearly right is off by less
_PAST_M = 0.06  # a sensor that measures this much behind a vertex has looked past it
_AROUND_PX, _NOTHING_M = 7, 1e6  # how far around a pixel to look for surface, across; what stands for none

_BLOCK = 256  # vertices worked on at once: the fastest memory holds all that is worked out of them


def visible_vertices(view: View, vertices: Floats, normals: Floats) -> Bools:
    """Which vertices (N, 3) with unit normals the view's sensor can see, to be matched with what it measured."""
    return _look(view, vertices, normals, _TO_MATCH)[0]


def plainly_seen_or_hidden(view: View, vertices: Floats, normals: Floats) -> tuple[Bools, Bools]:
    """Of vertices (N, 3) in its image that plainly face the view's sensor: which it sees, and which are hidden."""
    return _look(view, vertices, normals, _TO_SCORE)


def _look(view: View, vertices: Floats, normals: Floats, facing: float) -> tuple[Bools, Bools]:
    seen, hidden = np.zeros((2, len(vertices)), dtype=np.bool_)
    _see(vertices, normals, view.world_from_sensor, lens_of(view.camera), view.depth, facing, seen, hidden)
    return seen, hidden


@compiled
def _see(
    vertices: Floats,
    normals: Floats,
    world_from_sensor: Floats,
    lens: Lens,
    depth: Image,
    facing: float,
    seen: Bools,
    hidden: Bools,
) -> None:
    """Block by block: which vertices face the sensor, where those fall in the image, what was measured there."""
    x, y, z = np.empty(_BLOCK), np.empty(_BLOCK), np.empty(_BLOCK)
    which, rows, columns = np.empty(_BLOCK, np.int64), np.empty(_BLOCK, np.int32), np.empty(_BLOCK, np.int32)
    for start in range(0, len(vertices), _BLOCK):
        block = slice(start, min(start + _BLOCK, len(vertices)))
        count = _facing(vertices[block], normals[block], world_from_sensor, facing, x, y, z, which)
        pixels_within(lens, depth.shape, x, y, z, rows[:count], columns[:count])
        for j in range(count):
            if rows[j] >= 0:
                there = depth[rows[j], columns[j]]
                behind = (there > 0.0) & (there < z[j] - _OCCLUDED_M)
                seen[start + which[j]], hidden[start + which[j]] = not behind, behind


@compiled_sums
def _facing(
    vertices: Floats,
    normals: Floats,
    world_from_sensor: Floats,
    facing: float,
    x: Floats,
    y: Floats,
    z: Floats,
    which: Ints,
) -> int:
    """Fill in which vertices of a block face the sensor and where they are in its frame; how many there are."""
    t = world_from_sensor
    ax, ay, az, bx, by, bz = t[0, 0], t[1, 0], t[2, 0], t[0, 1], t[1, 1], t[2, 1]
    cx, cy, cz, ex, ey, ez = t[0, 2], t[1, 2], t[2, 2], t[0, 3], t[1, 3], t[2, 3]
    for i in range(len(vertices)):
        a, b, c = vertices[i, 0] - ex, vertices[i, 1] - ey, vertices[i, 2] - ez
        towards = -(a * normals[i, 0] + b * normals[i, 1] + c * normals[i, 2])
        x[i], y[i], depth = a * ax + b * ay + c * az, a * bx + b * by + c * bz, a * cx + b * cy + c * cz
        z[i] = depth if towards > facing * np.sqrt(a * a + b * b + c * c) else -1.0
    count = 0
    for i in range(len(vertices)):
        x[count], y[count], z[count], which[count] = x[i], y[i], z[i], i
        count += z[i] > 0.0
    return count


def face_the_sensors(cloud: Cloud, normals: Floats) -> Bools:
    """Which unit normals (..., 3), wherever around the cloud, look where on average its sensors are.

    >>> from capture.camera import Camera
    >>> view = View("a", Camera(640, 480, 500.0, 500.0, 319.5, 239.5), np.eye(4), np.zeros((480, 640)))
    >>> cloud = Cloud(np.eye(3)[2:], -np.eye(3)[2:], np.zeros(1, bool), np.zeros(1, int), (view,))
    >>> face_the_sensors(cloud, np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])).tolist()
    [True, False, False]
    """
    eyes = np.array([view.world_from_sensor[:3, 3] for view in cloud.views])
    toward = eyes.mean(axis=0) - cloud.points.mean(axis=0)
    return np.asarray(normals @ (toward / np.linalg.norm(toward)) > _TO_START)


def on_outline(view: View, normals: Floats) -> Bools:
    """Which unit normals (..., 3) belong to skin on the limb's outline, as the view's sensor shows it.

    >>> from capture.camera import Camera
    >>> view = View("a", Camera(640, 480, 500.0, 500.0, 319.5, 239.5), np.eye(4), np.zeros((480, 640)))
    >>> on_outline(view, np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.8, 0.0, -0.6]])).tolist()
    [True, False, False]
    """
    return np.asarray(np.abs(normals @ (-view.world_from_sensor[:3, 2])) < _OUTLINE)


@compiled
def is_on_outline(world_from_sensor: Floats, a: float, b: float, c: float) -> bool:
    """The same of one normal.

    >>> is_on_outline(np.eye(4), 1.0, 0.0, 0.0), is_on_outline(np.eye(4), 0.0, 0.0, -1.0)  # the sensor looks along z
    (True, False)
    """
    t = world_from_sensor
    return bool(abs(a * t[0, 2] + b * t[1, 2] + c * t[2, 2]) < _OUTLINE)


def looked_past(view: View, points: Floats) -> Bools:
    """Which points (N, 3) in its image the view's sensor saw past: it measured only what is clearly behind, or nothing.

    Sensors drop pixels on any surface, so that must hold of all pixels around a point.

    >>> from capture.camera import Camera
    >>> depth = np.full((480, 640), 2.0, dtype=np.float32)
    >>> view = View("a", Camera(640, 480, 500.0, 500.0, 319.5, 239.5), np.eye(4), depth)
    >>> looked_past(view, np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.99], [9.0, 0.0, 1.0]])).tolist()
    [True, False, False]
    """
    nearest = nearest_around(view.depth)
    row, column, inside = pixel_of(view, points)
    return np.asarray(inside & (nearest[row, column] > depth_of(view, points) + _PAST_M))


@compiled
def is_past(measured: float, depth: float) -> bool:
    """The same of one point at a depth (m), by the nearest depth (m) measured around it.

    >>> is_past(measured=1.5, depth=1.2), is_past(measured=1.25, depth=1.2)
    (True, False)
    """
    return measured > depth + _PAST_M


def nearest_around(depth: Image) -> Image:
    """The smallest depth (H, W) m measured around each pixel of an image (H, W), or something far beyond any.

    >>> depth = np.full((5, 5), 2.0, dtype=np.float32)
    >>> depth[2, 2], depth[0, 0] = 1.0, 0.0  # one pixel nearer, one not measured
    >>> nearest_around(depth)[2].tolist(), float(nearest_around(depth)[0, 0])
    ([1.0, 1.0, 1.0, 1.0, 1.0], 1.0)
    """
    filled = np.where(depth > 0.0, depth, _NOTHING_M).astype(np.float32)
    nearest = cv2.erode(filled, np.ones((_AROUND_PX, _AROUND_PX)), borderType=cv2.BORDER_REPLICATE)
    return np.asarray(nearest, dtype=np.float32)


def depth_at(view: View, points: Floats) -> tuple[Floats, Floats, Bools]:
    """Where points (N, 3) fall in a view's image: the depth measured there, their own depth (N,) m, whether inside.

    Nothing measured, or outside the image, is 0.

    >>> from capture.camera import Camera
    >>> view = View("a", Camera(640, 480, 500.0, 500.0, 319.5, 239.5), np.eye(4), np.full((480, 640), 2.0))
    >>> [part.tolist() for part in depth_at(view, np.array([[0.0, 0.0, 1.0], [9.0, 0.0, 1.0]]))]
    [[2.0, 0.0], [1.0, 1.0], [True, False]]
    """
    row, column, inside = pixel_of(view, points)
    return np.where(inside, view.depth[row, column], 0.0), depth_of(view, points), inside


def depth_of(view: View, points: Floats) -> Floats:
    """How far (N,) m along the viewing axis points (N, 3) are from the view's sensor.

    >>> from capture.camera import Camera
    >>> view = View("a", Camera(640, 480, 500.0, 500.0, 319.5, 239.5), np.eye(4), np.zeros((480, 640)))
    >>> depth_of(view, np.array([[0.3, 0.0, 1.2], [0.0, 0.0, -0.5]])).tolist()
    [1.2, -0.5]
    """
    return np.asarray((points - view.world_from_sensor[:3, 3]) @ view.world_from_sensor[:3, 2])


def pixel_of(view: View, points: Floats) -> tuple[Ints, Ints, Bools]:
    """Row and column (N,) of the pixels that points (N, 3) fall on, and whether they fall inside the image.

    Outside, row and column are 0.

    >>> from capture.camera import Camera
    >>> view = View("a", Camera(640, 480, 500.0, 500.0, 319.5, 239.5), np.eye(4), np.zeros((480, 640)))
    >>> [part.tolist() for part in pixel_of(view, np.array([[0.1, 0.0, 1.0], [9.0, 0.0, 1.0]]))]
    [[240, 0], [370, 0], [True, False]]
    """
    return pixels_in(view.camera, apply(inverse(view.world_from_sensor), points))


def in_an_image(views: Sequence[View], points: Floats) -> Bools:
    """Which points (N, 3) fall inside the image of any of the views: of the others nothing can be known.

    >>> from capture.camera import Camera
    >>> from capture.rigid import transform
    >>> camera, nothing = Camera(640, 480, 500.0, 500.0, 319.5, 239.5), np.zeros((480, 640))
    >>> places = [transform(np.eye(3), np.array([x, 0.0, 0.0])) for x in (0.0, 2.0)]  # side by side
    >>> views = [View("a", camera, place, nothing) for place in places]
    >>> in_an_image(views, np.array([[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [1.0, 0.0, 1.0]])).tolist()
    [True, True, False]
    """
    return np.asarray(np.any([pixel_of(view, points)[2] for view in views], axis=0))
