"""What sensors see at the same instants, and how well it agrees by given poses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from capture.calibration.box_images import spread
from capture.camera import Camera, backproject
from capture.errors import CalibrationError
from capture.projection import pixels_in
from capture.recording import (
    FrameFile,
    Recording,
    Sensor,
    instants,
    read_depth,
)
from capture.rigid import Floats, apply, inverse

_INSTANTS = 12  # compared to settle the ambiguity
_POINTS = 3000  # of each sensor at each instant
_AGREEMENT_FLOOR_M, _AGREEMENT_GROWTH = 0.015, 0.003  # tolerance at depth z: floor + growth z^2
_SILHOUETTE_PX = 5  # a reading missing nearer than this to others says nothing
_FEW = 0.02  # of all points; so many must agree before a score means much


@dataclass(frozen=True, eq=False)
class Look:
    """What one sensor sees at one instant: depth (H, W) m, some of its points (N, 3) m, surely empty pixels (H, W)."""

    camera: Camera
    depth: NDArray[np.float32]
    points: Floats
    empty: NDArray[np.bool_]
    range_m: tuple[float, float]


def least_agreement(looks: list[dict[str, Look]], poses: Mapping[str, Floats]) -> tuple[str, float] | None:
    """The sensor that agrees least with those before it, and by how much; None if there is but one."""
    names = list(poses)
    scores = [
        (agreement(looks, name, poses[name], {other: poses[other] for other in names[:number]}), name)
        for number, name in enumerate(names)
        if number
    ]
    if not scores:
        return None
    score, name = min(scores)
    return name, score


def shared_looks(recording: Recording, alone: str) -> list[dict[str, Look]]:
    """What the sensors saw at some instants, spread over the recording, at which at least two saw something."""
    if not any(sensor.frames for sensor in recording.sensors):
        shared = []
    else:
        shared = [instant for instant in instants(recording) if len(instant.frames) > 1]
    if not shared:
        raise CalibrationError(
            f"{alone}, and no frames of two sensors are from the same time",
            where=recording.path,
            remedy="record the person with all sensors at once",
        )
    return [
        {name: _look(recording.sensor(name), frame) for name, frame in shared[index].frames.items()}
        for index in spread(len(shared), _INSTANTS)
    ]


def _look(sensor: Sensor, frame: FrameFile) -> Look:
    depth = read_depth(sensor, frame)
    points = backproject(sensor.camera, depth)
    points = points[np.isfinite(points[..., 2])]
    window = np.ones((2 * _SILHOUETTE_PX + 1,) * 2, np.uint8)
    empty = cv2.dilate((depth > 0.0).astype(np.uint8), window) == 0
    return Look(
        sensor.camera, depth, points[:: max(1, len(points) // _POINTS)], np.asarray(empty), sensor.depth_range_m
    )


def agreement(looks: list[dict[str, Look]], name: str, pose: Floats, poses: Mapping[str, Floats]) -> float:
    """How well a sensor at ``pose`` (4, 4) fits those at ``poses``, in [-1, 1]: (a - c) / (a + c + few).

    Of the points compared, a agree and c contradict; ``few`` keeps a handful of points from deciding. Points that say
    nothing do not count: else a reading that makes two sensors look from the same side, where all is seen by both,
    would beat the true one.
    """
    agreeing = contradicting = total = 0
    for look in looks:
        for other in poses.keys() & look.keys() if name in look else ():
            other_from_this = inverse(poses[other]) @ pose
            for seen, by, by_from_seen in (
                (look[name], look[other], other_from_this),
                (look[other], look[name], inverse(other_from_this)),
            ):
                agree, contradict = _compared(seen, by, by_from_seen)
                agreeing, contradicting, total = agreeing + agree, contradicting + contradict, total + len(seen.points)
    return (agreeing - contradicting) / max(agreeing + contradicting + _FEW * total, 1.0)


def _compared(seen: Look, by: Look, by_from_seen: Floats) -> tuple[int, int]:
    """How many points one sensor saw that the other saw too, and how many where the other saw through them.

    Points hidden behind what the other saw, out of its image or out of its range say nothing.
    """
    points = apply(by_from_seen, seen.points)
    row, column, inside = pixels_in(by.camera, points)
    near, far = by.range_m
    usable = inside & (points[:, 2] > near) & (points[:, 2] < far)
    row, column, depth = row[usable], column[usable], points[usable, 2]
    measured = by.depth[row, column]
    tolerance = _AGREEMENT_FLOOR_M + _AGREEMENT_GROWTH * depth**2
    agree = (measured > 0.0) & (np.abs(depth - measured) < tolerance)
    through = ((measured > 0.0) & (depth < measured - tolerance)) | by.empty[row, column]
    return int(agree.sum()), int(through.sum())
