"""Finding the person: the region of the common frame in which a recording shows one.

A person is near, large and bounded by jumps in depth; floors and walls are large planes. So planes are taken away,
what is left falls apart into patches at its depth jumps, and the nearest large patch is kept together with the
patches close to it (a forearm in front of the chest is a patch of its own, and so is a fist towards the sensor).
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from scipy.spatial import cKDTree

from capture.background import large_planes, some_of, without_planes
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
    depth = clean_depth(depth, camera)
    depth = without_planes(depth, camera, large_planes(depth, camera))
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
        tree, depth_of_person = cKDTree(some_of(person)), float(np.median(person[:, 2]))
        near = []
        for points in others:
            reach = _REACH_FORWARD_M if np.median(points[:, 2]) < depth_of_person else _REACH_M
            near.append(bool((np.asarray(tree.query(some_of(points))[0]) < reach).any()))
        if not any(near):
            return person
        person = np.concatenate([person, *(points for points, close in zip(others, near, strict=True) if close)])
        others = [points for points, close in zip(others, near, strict=True) if not close]


def _large_patches(depth: Image, camera: Camera) -> list[tuple[float, Floats]]:
    """Area (m^2) and points of each patch without depth jumps inside that is at least as large as a fist."""
    core = (depth > 0.0) & ~jump_mask(depth, camera)
    count, labels = cv2.connectedComponents(core.view(np.uint8), connectivity=4)
    area = np.bincount(labels.ravel(), weights=pixel_area(depth, camera).ravel(), minlength=count)
    points = backproject(camera, depth)
    large = [label for label in range(1, count) if area[label] >= _LARGE_PATCH_M2]
    return [(float(area[label]), points[labels == label]) for label in large]
