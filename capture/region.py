"""Finding the person: the region of the common frame in which a recording shows one.

A person is near, large and bounded by jumps in depth; floors and walls are large planes. So planes are taken away,
what is left falls apart into patches at its depth jumps, and the nearest large patch is kept together with the
patches close to it (a forearm in front of the chest is a patch of its own, and so is a fist towards the sensor).
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from capture.camera import Camera, backproject
from capture.errors import CloudError
from capture.preprocess import Image, clean_depth, jump_mask, pixel_area
from capture.recording import Instant, Recording, Region, Sensor, instants, read_depth, world_from_sensor
from capture.rigid import Floats, apply

MARGIN_M = 0.10
INSTANTS_LOOKED_AT = 12

_LARGE_PATCH_M2 = 0.005  # a fist covers about this much
_MAIN_PATCH_SHARE = 0.25  # of the largest patch's area: the nearest patch of at least this is the person
_REACH_M = 0.25  # patches closer than this to the person belong to the person
_REACH_FORWARD_M = 0.60  # the same for patches nearer to the sensor: a fist may hide the arm behind it
_PLANE_TOLERANCE_M = 0.02
_PLANE_SHARE = 0.25  # of all readings
_PLANE_SIDES_M = (1.2, 0.6)  # larger than any flat side of a person
_PLANE_TRIALS = 200
_MOST_PLANES = 3
_SAMPLE = 2000


def automatic_region(recording: Recording, at: Sequence[Instant] | None = None) -> Region:
    """The box in the common frame, with a margin, that holds the person in all the given instants.

    Default: a dozen instants spread over the recording.

    Raises:
        CloudError: no person-like patch in any of them.
        RecordingError: an image cannot be read.
        CalibrationError: where a sensor stands is not known.
    """
    if at is None:
        every = instants(recording)
        picks = np.unique(np.linspace(0, len(every) - 1, INSTANTS_LOOKED_AT).round().astype(int))
        at = [every[i] for i in picks]
    corners = [corner for instant in at for corner in _corners(recording, instant)]
    if not corners:
        times = ", ".join(f"{instant.time_s:.2f}" for instant in at)
        raise CloudError(
            f"no person found in the frames at {times} s",
            where=recording.path,
            remedy="state the region in recording.json",
        )
    return Region(np.min(corners, axis=0) - MARGIN_M, np.max(corners, axis=0) + MARGIN_M)


def _corners(recording: Recording, instant: Instant) -> list[Floats]:
    """Smallest and largest coordinates (3,) of what each sensor shows of the person."""
    corners = []
    for name, frame in instant.frames.items():
        sensor = recording.sensor(name)
        points = person_points(read_depth(sensor, frame), sensor)
        if len(points):
            world = apply(world_from_sensor(recording, name), points)
            corners += [world.min(axis=0), world.max(axis=0)]
    return corners


def person_points(depth: Image, sensor: Sensor) -> Floats:
    """Points (N, 3) (m, sensor frame) of the person in a depth image (H, W) (m); none if nobody is there."""
    camera = sensor.camera
    depth = without_large_planes(clean_depth(depth, camera), camera)
    patches = _large_patches(depth, camera)
    if not patches:
        return np.zeros((0, 3))
    largest = max(area for area, _ in patches)
    main = min(
        (i for i, (area, _) in enumerate(patches) if area >= _MAIN_PATCH_SHARE * largest),
        key=lambda i: float(np.median(patches[i][1][:, 2])),
    )
    person = patches[main][1]
    others = [points for i, (_, points) in enumerate(patches) if i != main]
    while True:
        tree, depth_of_person = cKDTree(_sample(person)), float(np.median(person[:, 2]))
        near = []
        for points in others:
            reach = _REACH_FORWARD_M if np.median(points[:, 2]) < depth_of_person else _REACH_M
            near.append(bool((np.asarray(tree.query(_sample(points))[0]) < reach).any()))
        if not any(near):
            return person
        person = np.concatenate([person, *(points for points, close in zip(others, near, strict=True) if close)])
        others = [points for points, close in zip(others, near, strict=True) if not close]


def without_large_planes(depth: Image, camera: Camera) -> Image:
    """The depth image (H, W) (m) without floor and walls: planes that are dominant and larger than a person."""
    depth = depth.copy()
    points = backproject(camera, depth)
    for _ in range(_MOST_PLANES):
        seen = depth > 0.0
        cloud = points[seen]
        if len(cloud) < 3:
            break
        plane = largest_plane(_sample(cloud))
        on_plane = np.abs(cloud @ plane[:3] + plane[3]) < _PLANE_TOLERANCE_M
        if on_plane.mean() < _PLANE_SHARE or not _is_large(cloud[on_plane]):
            break
        depth[seen] = np.where(on_plane, 0.0, depth[seen])
    return clean_depth(depth, camera)


def largest_plane(points: Floats) -> Floats:
    """The plane (4,), n . x + d = 0 with |n| = 1, that has the most of the points (N, 3) within 2 cm (RANSAC)."""
    random = np.random.default_rng(0)
    corner = points[random.integers(len(points), size=(_PLANE_TRIALS, 3))]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal /= np.where(length > 0.0, length, 1.0)
    offset = -(normal * corner[:, 0]).sum(axis=1)
    votes = (np.abs(points @ normal.T + offset) < _PLANE_TOLERANCE_M).sum(axis=0)
    best = int(np.argmax(np.where(length[:, 0] > 0.0, votes, -1)))
    on_plane = points[np.abs(points @ normal[best] + offset[best]) < _PLANE_TOLERANCE_M]
    centre = on_plane.mean(axis=0)
    refined = np.linalg.svd(on_plane - centre, full_matrices=False)[2][2]
    return np.append(refined, -refined @ centre)


def _is_large(points: Floats) -> bool:
    sample = _sample(points)
    axes = np.linalg.svd(sample - sample.mean(axis=0), full_matrices=False)[2]
    low, high = np.percentile(sample @ axes[:2].T, [5, 95], axis=0)
    return bool((high - low >= _PLANE_SIDES_M).all())


def _large_patches(depth: Image, camera: Camera) -> list[tuple[float, Floats]]:
    """Area (m^2) and points of each patch without depth jumps inside that is at least as large as a fist."""
    core = (depth > 0.0) & ~jump_mask(depth, camera)
    count, labels = cv2.connectedComponents(core.view(np.uint8), connectivity=4)
    area = np.bincount(labels.ravel(), weights=pixel_area(depth, camera).ravel(), minlength=count)
    points = backproject(camera, depth)
    large = [label for label in range(1, count) if area[label] >= _LARGE_PATCH_M2]
    return [(float(area[label]), points[labels == label]) for label in large]


def _sample(points: NDArray[np.float64]) -> Floats:
    """At most a few thousand of the points (N, 3), evenly picked."""
    return points[:: max(1, len(points) // _SAMPLE)]
