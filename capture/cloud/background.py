"""Floor and walls: planes that hold a large share of what a sensor sees and are larger than any flat side of a person.

They are found once in a recording, for a sensor stands still, or rolls over the floor that it sees, and are then taken
out of every depth image, so that nobody grows together with the floor he stands on.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from capture.camera import Camera, backproject
from capture.cloud.preprocess import DEPTH_STEP, Image, clean_depth
from capture.recording import Instant, Recording, instants, read_depth
from capture.rigid import Floats

_TOLERANCE_M = 0.02
_TOLERANCE_STEPS = 2.0 * DEPTH_STEP  # 1 / m: two steps of a reading, more than 2 cm beyond 1.9 m
_SHARE = 0.25  # of the readings left
_SIDES_M = (1.2, 0.6)  # larger than any flat side of a person
_TRIALS = 200
_MOST = 3
_SAMPLE = 2000


@lru_cache(maxsize=8)
def background_planes(recording: Recording) -> dict[str, tuple[Floats, ...]]:
    """The large planes (4,) that each sensor, by name, sees halfway through a recording, in its own frame.

    Raises:
        RecordingError: an image cannot be read.
    """
    every = instants(recording)
    planes: dict[str, tuple[Floats, ...]] = {}
    for sensor in recording.sensors:
        having = [moment for moment in every if sensor.name in moment.frames]
        planes[sensor.name] = _planes_at(recording, having[len(having) // 2], sensor.name) if having else ()
    return planes


def _planes_at(recording: Recording, instant: Instant, name: str) -> tuple[Floats, ...]:
    sensor = recording.sensor(name)
    return large_planes(clean_depth(read_depth(sensor, instant.frames[name]), sensor.camera), sensor.camera)


def large_planes(depth: Image, camera: Camera) -> tuple[Floats, ...]:
    """Planes (4,), n . x + d = 0 (m, sensor frame), of a depth image (H, W) (m) that are floor or wall."""
    points = backproject(camera, depth)[depth > 0.0]
    planes: list[Floats] = []
    while len(points) >= 3 and len(planes) < _MOST:
        plane = largest_plane(some_of(points))
        on_plane = _distance(points, plane) < _tolerance(points)
        if on_plane.mean() < _SHARE or not _is_large(points[on_plane]):
            break
        planes.append(plane)
        points = points[~on_plane]
    return tuple(planes)


def without_planes(depth: Image, camera: Camera, planes: tuple[Floats, ...]) -> Image:
    """The depth image (H, W) (m) without readings on any of the planes (4,), nor specks that are left of them."""
    if not planes:
        return depth
    points, kept = backproject(camera, depth), depth.copy()
    for plane in planes:
        kept[_distance(points, plane) < _tolerance(points)] = 0.0
    return clean_depth(kept, camera)


def largest_plane(points: Floats) -> Floats:
    """The plane (4,), n . x + d = 0 with |n| = 1, that has the most of the points (N, 3) within tolerance (RANSAC)."""
    random = np.random.default_rng(0)
    corner = points[random.integers(len(points), size=(_TRIALS, 3))]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal /= np.where(length > 0.0, length, 1.0)
    offset = -(normal * corner[:, 0]).sum(axis=1)
    votes = (np.abs(points @ normal.T + offset) < _tolerance(points)[:, None]).sum(axis=0)
    best = int(np.argmax(np.where(length[:, 0] > 0.0, votes, -1)))
    on_plane = points[np.abs(points @ normal[best] + offset[best]) < _tolerance(points)]
    centre = on_plane.mean(axis=0)
    refined = np.linalg.svd(on_plane - centre, full_matrices=False)[2][2]
    return np.append(refined, -refined @ centre)


def some_of(points: NDArray[np.float64]) -> Floats:
    """At most a few thousand of the points (N, 3), evenly picked."""
    return points[:: max(1, len(points) // _SAMPLE)]


def _distance(points: Floats, plane: Floats) -> Floats:
    return np.asarray(np.abs(points @ plane[:3] + plane[3]))


def _tolerance(points: Floats) -> Floats:
    """How far (...) (m) off a plane each of points (..., 3) of it may be read: noise grows with the square of depth."""
    return np.asarray(np.maximum(_TOLERANCE_M, _TOLERANCE_STEPS * points[..., 2] ** 2))


def _is_large(points: Floats) -> bool:
    sample = some_of(points)
    axes = np.linalg.svd(sample - sample.mean(axis=0), full_matrices=False)[2]
    low, high = np.percentile(sample @ axes[:2].T, [5, 95], axis=0)
    return bool((high - low >= _SIDES_M).all())
