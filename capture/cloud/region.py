"""Finding the person: the region of the common frame in which a recording shows one.

A person is near, large and bounded by jumps in depth; floors and walls are large planes. So planes are taken away,
what is left falls apart into patches at its depth jumps, and the nearest large patch is kept together with the
patches close to it (a forearm in front of the chest is a patch of its own, and so is a fist towards the sensor).
Where somebody else is in view, images may disagree about who is nearest: see ``candidates``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial import cKDTree

from capture.camera import Camera, backproject
from capture.cloud.background import large_planes, some_of, without_planes
from capture.cloud.candidates import LARGEST_PERSON_M, LIMB_M2, REACH_M, Candidate, Seen, candidates, choose
from capture.cloud.preprocess import Image, clean_depth, jump_mask, pixel_area
from capture.errors import CloudError
from capture.recording import Instant, Recording, Region, Sensor, instants, read_depth, world_from_sensor
from capture.rigid import Floats, apply

MARGIN_M = 0.10
INSTANTS_LOOKED_AT = 12

_SMALLEST_LIMB_M = 0.15  # the longest side of a box around it: a child's hand and forearm are twice as long
_LARGE_PATCH_M2 = 0.005  # a fist covers about this much
_MAIN_PATCH_SHARE = 0.25  # of the largest patch's area: the nearest patch of at least this is the person
_REACH_FORWARD_M = 0.60  # the same for patches nearer to the sensor: a fist may hide the arm behind it


@dataclass(frozen=True, eq=False)
class Found:
    """A region that was found, and lines that say what is of a person's size and was left out of it."""

    region: Region
    left_out: tuple[str, ...]


def automatic_region(
    recording: Recording, at: Sequence[Instant] | None = None, *, near: Floats | None = None
) -> Region:
    """The region of ``find_region``."""
    return find_region(recording, at, near=near).region


def find_region(recording: Recording, at: Sequence[Instant] | None = None, *, near: Floats | None = None) -> Found:
    """The box in the common frame, with a margin, that holds the person in all the given instants.

    Args:
        recording: what was recorded.
        at: the instants; default: a dozen spread over the recording.
        near: a point (3,) (m, common frame); of several people the one whose box is nearest to it is kept.

    Raises:
        CloudError: no person-like patch in any of them, or several people who could be meant, or what is found is
            smaller than a limb or larger than a person.
        RecordingError: an image cannot be read.
        CalibrationError: where a sensor stands is not known.
    """
    if at is None:
        every = instants(recording)
        picks = np.unique(np.linspace(0, len(every) - 1, INSTANTS_LOOKED_AT).round().astype(int))
        at = [every[i] for i in picks]
    everybody = candidates([person for number in range(len(at)) for person in _people_seen(recording, at, number)])
    if not everybody:
        times = ", ".join(f"{instant.time_s:.2f}" for instant in at)
        raise CloudError(
            f"no person found in the frames at {times} s",
            where=recording.path,
            remedy="state the region in recording.json",
        )
    if near is None:
        subject, still = choose(recording, at, everybody)
    else:
        subject, still = min(everybody, key=lambda one: one.distance_to(near)), []
    _refuse_smaller_than_a_limb(recording, subject)
    _refuse_larger_than_a_person(recording, subject)
    minimum, maximum = (np.stack([getattr(one, end) for one in subject.seen]) for end in ("minimum", "maximum"))
    region = Region(minimum.min(axis=0) - MARGIN_M, maximum.max(axis=0) + MARGIN_M)
    return Found(region, tuple(_said_of(one) for one in still))


def _said_of(still: Candidate) -> str:
    place = " ".join(f"{value:.2f}" for value in still.place)
    return f"what does not move at {place} m, {still.side_m:.1f} m long (if it is meant: `--near {place}`)"


def _people_seen(recording: Recording, at: Sequence[Instant], number: int) -> list[Seen]:
    seen = []
    for name, frame in at[number].frames.items():
        sensor = recording.sensor(name)
        people, minor = _people(read_depth(sensor, frame), sensor)
        for k, (area, points) in enumerate([*people, *minor]):
            world = apply(world_from_sensor(recording, name), points)
            box = world.min(axis=0), world.max(axis=0)
            nearest, is_minor = k == 0, k >= len(people)
            seen.append(Seen(number, at[number].time_s, name, some_of(points), *box, area, nearest, is_minor))
    return seen


def _refuse_smaller_than_a_limb(recording: Recording, subject: Candidate) -> None:
    """A cup on a table that was taken away as a plane is all that is left, and no limb."""
    size = max((size for _, size in subject.sizes()), key=lambda sides: float(sides.max()))
    if size.max() < _SMALLEST_LIMB_M:
        sides = " x ".join(f"{100.0 * side:.0f}" for side in size)
        raise CloudError(
            f"what was found automatically is {sides} cm, smaller than a limb",
            where=recording.path,
            remedy="if that is the limb, the depth unit is wrong (`bonetrack import --unit-mm`); else state where the "
            "limb is with `--region X0 Y0 Z0 X1 Y1 Z1`",
        )


def _refuse_larger_than_a_person(recording: Recording, subject: Candidate) -> None:
    """Where furniture or walls grew together with the person, the box is larger than anybody is at one instant."""
    for time, size in subject.sizes():
        if size.max() > LARGEST_PERSON_M:
            sides = " x ".join(f"{side:.1f}" for side in size)
            raise CloudError(
                f"what was found automatically at {time:.2f} s is {sides} m, larger than a person",
                where=recording.path,
                remedy="the person and the room cannot be told apart: state where the limb is with "
                "`--region X0 Y0 Z0 X1 Y1 Z1`, or `region` in recording.json",
            )


def person_points(depth: Image, sensor: Sensor) -> Floats:
    """Points (N, 3) (m, sensor frame) of the nearest person in a depth image (H, W) (m); none if nobody is there."""
    people, _ = _people(depth, sensor)
    return people[0][1] if people else np.zeros((0, 3))


_Patches = list[tuple[float, Floats]]


def _people(depth: Image, sensor: Sensor) -> tuple[_Patches, _Patches]:
    """Area (m^2) and points (N, 3) (m, sensor frame) of each person in a depth image (H, W) (m), nearest first.

    Then the same of what is nearer than all of them, and no more than a limb.
    """
    camera = sensor.camera
    depth = clean_depth(depth, camera)
    depth = without_planes(depth, camera, large_planes(depth, camera))
    patches = _large_patches(depth, camera)
    people, patches = _taken(patches, _MAIN_PATCH_SHARE * max((area for area, _ in patches), default=0.0))
    front = min((_depth_of(points) for _, points in people), default=0.0)
    minor, _ = _taken([patch for patch in patches if _depth_of(patch[1]) < front], LIMB_M2)
    return people, minor


def _taken(patches: _Patches, least_m2: float) -> tuple[_Patches, _Patches]:
    """Of patches, what each of at least an area makes together with those close to it; and those that are left."""
    people = []
    while any(area >= least_m2 for area, _ in patches):
        person, patches = _nearest_person(patches, least_m2)
        people.append(person)
    return people, patches


def _depth_of(points: Floats) -> float:
    return float(np.median(points[:, 2]))


def _nearest_person(patches: _Patches, least_m2: float) -> tuple[tuple[float, Floats], _Patches]:
    """The nearest patch of at least an area together with the patches close to it, and the patches that are left."""
    main = min(
        (i for i, (area, _) in enumerate(patches) if area >= least_m2),
        key=lambda i: _depth_of(patches[i][1]),
    )
    area, person = patches[main]
    others = [patch for i, patch in enumerate(patches) if i != main]
    while True:
        tree, depth_of_person = cKDTree(some_of(person)), _depth_of(person)
        near = []
        for _, points in others:
            reach = _REACH_FORWARD_M if _depth_of(points) < depth_of_person else REACH_M
            near.append(bool((np.asarray(tree.query(some_of(points))[0]) < reach).any()))
        if not any(near):
            return (area, person), others
        joining = [patch for patch, close in zip(others, near, strict=True) if close]
        area += sum(patch[0] for patch in joining)
        person = np.concatenate([person, *(points for _, points in joining)])
        others = [patch for patch, close in zip(others, near, strict=True) if not close]


def _large_patches(depth: Image, camera: Camera) -> _Patches:
    """Area (m^2) and points of each patch without depth jumps inside that is at least as large as a fist."""
    core = (depth > 0.0) & ~jump_mask(depth, camera)
    count, labels = cv2.connectedComponents(core.view(np.uint8), connectivity=4)
    area = np.bincount(labels.ravel(), weights=pixel_area(depth, camera).ravel(), minlength=count)
    points = backproject(camera, depth)
    large = [label for label in range(1, count) if area[label] >= _LARGE_PATCH_M2]
    return [(float(area[label]), points[labels == label]) for label in large]
