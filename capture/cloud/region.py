"""Finding the person: the region of the common frame in which a recording shows one.

A person is near, large and bounded by jumps in depth; floors and walls are large planes. So planes are taken away,
what is left falls apart into patches at its depth jumps, and the nearest large patch is kept together with the
patches close to it (a forearm in front of the chest is a patch of its own, and so is a fist towards the sensor).
Where somebody else is in view, images may disagree about who is nearest; then the area that they show decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from capture.camera import Camera, backproject
from capture.cloud.background import large_planes, some_of, without_planes
from capture.cloud.preprocess import Image, clean_depth, jump_mask, pixel_area
from capture.errors import CloudError
from capture.recording import Instant, Recording, Region, Sensor, instants, read_depth, world_from_sensor
from capture.rigid import Floats, apply

MARGIN_M = 0.10
INSTANTS_LOOKED_AT = 12

_LARGEST_PERSON_M = 2.4  # the longest side of a box around one person at one instant, arms stretched out

_LARGE_PATCH_M2 = 0.005  # a fist covers about this much
_MAIN_PATCH_SHARE = 0.25  # of the largest patch's area: the nearest patch of at least this is the person
_REACH_M = 0.25  # patches closer than this to the person belong to the person
_REACH_FORWARD_M = 0.60  # the same for patches nearer to the sensor: a fist may hide the arm behind it


def automatic_region(
    recording: Recording, at: Sequence[Instant] | None = None, *, near: Floats | None = None
) -> Region:
    """The box in the common frame, with a margin, that holds the person in all the given instants.

    Args:
        recording: what was recorded.
        at: the instants; default: a dozen spread over the recording.
        near: a point (3,) (m, common frame); of several people the one whose box is nearest to it is kept.

    Raises:
        CloudError: no person-like patch in any of them, or what is found is larger than a person.
        RecordingError: an image cannot be read.
        CalibrationError: where a sensor stands is not known.
    """
    if at is None:
        every = instants(recording)
        picks = np.unique(np.linspace(0, len(every) - 1, INSTANTS_LOOKED_AT).round().astype(int))
        at = [every[i] for i in picks]
    seen = [person for instant in at for person in _people_seen(recording, instant)]
    if not seen:
        times = ", ".join(f"{instant.time_s:.2f}" for instant in at)
        raise CloudError(
            f"no person found in the frames at {times} s",
            where=recording.path,
            remedy="state the region in recording.json",
        )
    subject = _subject(seen, near)
    _refuse_larger_than_a_person(recording, subject)
    minimum, maximum = (np.stack([getattr(person, end) for person in subject]) for end in ("minimum", "maximum"))
    return Region(minimum.min(axis=0) - MARGIN_M, maximum.max(axis=0) + MARGIN_M)


@dataclass(frozen=True, eq=False)
class _Seen:
    """Smallest and largest coordinates (3,) of what one image shows of somebody at one time, in the common frame."""

    time_s: float
    minimum: Floats
    maximum: Floats
    nearest_area_m2: float  # 0 for all but the nearest in the image


def _people_seen(recording: Recording, instant: Instant) -> list[_Seen]:
    seen = []
    for name, frame in instant.frames.items():
        sensor = recording.sensor(name)
        for number, (area, points) in enumerate(_people(read_depth(sensor, frame), sensor)):
            world = apply(world_from_sensor(recording, name), points)
            seen.append(_Seen(instant.time_s, world.min(axis=0), world.max(axis=0), 0.0 if number else area))
    return seen


def _refuse_larger_than_a_person(recording: Recording, subject: list[_Seen]) -> None:
    """Where furniture or walls grew together with the person, the box is larger than anybody is at one instant."""
    for time in sorted({person.time_s for person in subject}):
        now = [person for person in subject if person.time_s == time]
        size = np.max([person.maximum for person in now], axis=0) - np.min([person.minimum for person in now], axis=0)
        if size.max() > _LARGEST_PERSON_M:
            sides = " x ".join(f"{side:.1f}" for side in size)
            raise CloudError(
                f"what was found automatically at {time:.2f} s is {sides} m, larger than a person",
                where=recording.path,
                remedy="the person and the room cannot be told apart: state where the limb is with "
                "`--region X0 Y0 Z0 X1 Y1 Z1`, or `region` in recording.json",
            )


def _subject(seen: list[_Seen], near: Floats | None) -> list[_Seen]:
    """Of all that the images show, what belongs to the one who is nearest in most of them, by the area that they show.

    If a point (3,) ``near`` is given, to the one whose box comes nearest to it instead.
    Boxes that come close to each other at any time are of one person: a bystander must keep his distance.
    """
    low, high = np.stack([person.minimum for person in seen]), np.stack([person.maximum for person in seen])
    gap = np.maximum(low[:, None] - high[None], low[None] - high[:, None]).max(axis=2)
    _, labels = connected_components(gap < _REACH_M, directed=False)
    if near is not None:
        distance = np.linalg.norm(np.maximum(np.maximum(low - near, near - high), 0.0), axis=1)
        chosen = labels[distance.argmin()]
    else:
        chosen = np.bincount(labels, weights=[person.nearest_area_m2 for person in seen]).argmax()
    return [person for person, label in zip(seen, labels, strict=True) if label == chosen]


def person_points(depth: Image, sensor: Sensor) -> Floats:
    """Points (N, 3) (m, sensor frame) of the nearest person in a depth image (H, W) (m); none if nobody is there."""
    people = _people(depth, sensor)
    return people[0][1] if people else np.zeros((0, 3))


def _people(depth: Image, sensor: Sensor) -> list[tuple[float, Floats]]:
    """Area (m^2) and points (N, 3) (m, sensor frame) of each person in a depth image (H, W) (m), nearest first."""
    camera = sensor.camera
    depth = clean_depth(depth, camera)
    depth = without_planes(depth, camera, large_planes(depth, camera))
    patches = _large_patches(depth, camera)
    least = _MAIN_PATCH_SHARE * max((area for area, _ in patches), default=0.0)
    people = []
    while any(area >= least for area, _ in patches):
        person, patches = _nearest_person(patches, least)
        people.append(person)
    return people


def _nearest_person(
    patches: list[tuple[float, Floats]], least_m2: float
) -> tuple[tuple[float, Floats], list[tuple[float, Floats]]]:
    """The nearest patch of at least an area together with the patches close to it, and the patches that are left."""
    main = min(
        (i for i, (area, _) in enumerate(patches) if area >= least_m2),
        key=lambda i: float(np.median(patches[i][1][:, 2])),
    )
    area, person = patches[main]
    others = [patch for i, patch in enumerate(patches) if i != main]
    while True:
        tree, depth_of_person = cKDTree(some_of(person)), float(np.median(person[:, 2]))
        near = []
        for _, points in others:
            reach = _REACH_FORWARD_M if np.median(points[:, 2]) < depth_of_person else _REACH_M
            near.append(bool((np.asarray(tree.query(some_of(points))[0]) < reach).any()))
        if not any(near):
            return (area, person), others
        joining = [patch for patch, close in zip(others, near, strict=True) if close]
        area += sum(patch[0] for patch in joining)
        person = np.concatenate([person, *(points for _, points in joining)])
        others = [patch for patch, close in zip(others, near, strict=True) if not close]


def _large_patches(depth: Image, camera: Camera) -> list[tuple[float, Floats]]:
    """Area (m^2) and points of each patch without depth jumps inside that is at least as large as a fist."""
    core = (depth > 0.0) & ~jump_mask(depth, camera)
    count, labels = cv2.connectedComponents(core.view(np.uint8), connectivity=4)
    area = np.bincount(labels.ravel(), weights=pixel_area(depth, camera).ravel(), minlength=count)
    points = backproject(camera, depth)
    large = [label for label in range(1, count) if area[label] >= _LARGE_PATCH_M2]
    return [(float(area[label]), points[labels == label]) for label in large]
