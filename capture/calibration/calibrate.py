"""Where the sensors of a recording stand, from images of a box of known size.

Each sensor finds the box by itself. A box looks the same after half turns about its axes (and more, if sides are
equal), so the sensors may mean different corners by the same words. What settles it is the recording itself: of all
ways to read the box, only the true one lays what the sensors saw at the same instant onto each other. How well it does
so then tells whether the box stood in one place for all sensors.

The common frame is the box's, as the first sensor reads it: origin at the box's centre, axes along its edges in the
order of the stated size, the first sensor on the positive side of the first two.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from capture.calibration.agreement import Apart, apart, surface
from capture.calibration.box import BoxFit, displacement, find_box, symmetries
from capture.camera import Camera, backproject
from capture.errors import CalibrationError
from capture.projection import pixels_in
from capture.recording import (
    Calibration,
    FrameFile,
    Recording,
    Sensor,
    SensorCalibration,
    instants,
    read_depth,
    write_calibration_file,
)
from capture.rigid import Floats, apply, inverse, transform

_NEAR_MEDIAN_M = 0.02  # readings farther from a pixel's median over the box frames are not averaged
_AVERAGED = 60  # of the box frames, at most, spread over them: all are in memory at once
_BOX_IMAGES = 5  # compared to see that the box stood still
# Single images of a Carmine show the corners 0.8 mm off at most at 1.2 m, 3.5 mm at 2.2 m: depth errs by its square.
_LARGEST_MOVE_M, _LARGEST_MOVE_AT_M = 0.003, 1.2
_INSTANTS = 12  # compared to settle the ambiguity
_POINTS = 3000  # of each sensor at each instant
_AGREEMENT_FLOOR_M, _AGREEMENT_GROWTH = 0.015, 0.003  # tolerance at depth z: floor + growth z^2
_SILHOUETTE_PX = 5  # a reading missing nearer than this to others says nothing
_FEW = 0.02  # of all points; so many must agree before a score means much
_LEAST_SCORE, _LEAST_MARGIN = 0.3, 0.3
DOUBTFUL_APART_M = 0.0025  # sound calibrations of simulated Carmines left 0.3 to 1 mm at 1.2 m, 2 mm at 2.2 m
_FAR_APART_M = 0.005
_SURELY = 2.0  # standard deviations
_BOX_ALONE = "the box alone does not tell which way round each sensor sees it"
_REMEDY_OF_BOX = "show the box to all sensors at once and move neither it nor them; check that the clocks agree"
_REMEDY_OF_KNOWN = (
    "check that the matrices are of this rig and these sensors, in metres, that nothing moved since, and that the "
    "clocks agree; or show all sensors a box"
)


@dataclass(frozen=True, eq=False)
class _Look:
    """What one sensor sees at one instant: depth (H, W) m, some of its points (N, 3) m, surely empty pixels (H, W)."""

    camera: Camera
    depth: NDArray[np.float32]
    points: Floats
    empty: NDArray[np.bool_]
    range_m: tuple[float, float]


def calibrate_recording(recording: Recording) -> Calibration:
    """Find where each sensor stands.

    The details of each sensor's calibration: ``box_points``, ``box_faces``, ``face_angles_deg``,
    ``measured_size_mm``; ``ambiguity_margin``: by how much the chosen reading of the box beats the next best
    (2 is the most there can be); ``apart_mm`` and ``apart_deviation_mm``: how far its clouds of the recording lie from
    those of the sensors before it. The first sensor has none of the last three, and where sensors do not see the same
    surface there is no telling how far apart it is.

    Raises:
        CalibrationError: no stated box, no box frames, no box found (see ``box``), it moved, the recording
            does not tell which way round the sensors see the box, or their clouds do not lie on each other.
    """
    if recording.box_size_m is None:
        raise CalibrationError(
            "the recording does not say how large the calibration box is",
            where=recording.path,
            remedy="add its size to recording.json",
        )
    fits = {sensor.name: _fit(recording, sensor, recording.box_size_m) for sensor in recording.sensors}
    looks = _looks(recording, _BOX_ALONE) if len(recording.sensors) > 1 else []
    poses, margins = _resolved(recording, fits, symmetries(recording.box_size_m), looks)
    distances = _distances(recording, looks, poses)
    return Calibration(
        {name: _report(fit, poses[name], margins.get(name), distances.get(name)) for name, fit in fits.items()}
    )


def known_calibration(recording: Recording, poses: Mapping[str, Floats], *, where: Path) -> Calibration:
    """The calibration that known poses (4, 4), world from sensor by name, make, if the sensors' clouds agree with it.

    ``where`` is the file of the poses, which errors name.

    Raises:
        CalibrationError: the sensors never saw the person at once, or what they saw does not lie on each other.
    """
    looks = _looks(recording, "matrices alone are not believed") if len(recording.sensors) > 1 else []
    _refuse_disagreeing(looks, poses, where)
    distances = _distances(recording, looks, poses, _REMEDY_OF_KNOWN)
    return Calibration({name: _known_sensor(pose, where, distances.get(name)) for name, pose in poses.items()})


def _known_sensor(pose: Floats, where: Path, distance: Apart | None) -> SensorCalibration:
    return SensorCalibration(pose, residual_mm=None, details={"given_by": where.name, **_apart_details(distance)})


def _refuse_disagreeing(looks: list[dict[str, _Look]], poses: Mapping[str, Floats], where: Path) -> None:
    """Refuse poses by which what one sensor saw is not where those before it saw it."""
    score = _least_score(looks, poses)
    if score is None or score[1] >= _LEAST_SCORE:
        return
    turned = _least_score(looks, {name: inverse(pose) for name, pose in poses.items()})
    other_way = turned is not None and turned[1] >= _LEAST_SCORE
    raise CalibrationError(
        f"what sensor {score[0]!r} saw does not lie on what the others saw: they agree by {score[1]:.2f}"
        + (f", by the inverse matrices {turned[1]:.2f}" if turned is not None and other_way else ""),
        where=where,
        remedy="the matrices map the other way: rename world_from_NAME to NAME_from_world, or back"
        if other_way
        else _REMEDY_OF_KNOWN,
    )


def _least_score(looks: list[dict[str, _Look]], poses: Mapping[str, Floats]) -> tuple[str, float] | None:
    """The sensor that agrees least with those before it, and by how much; None if there is but one."""
    names = list(poses)
    scores = [
        (_score(looks, name, poses[name], {other: poses[other] for other in names[:number]}), name)
        for number, name in enumerate(names)
        if number
    ]
    if not scores:
        return None
    score, name = min(scores)
    return name, score


def write_calibration(recording: Recording, calibration: Calibration) -> None:
    """Keep a calibration in the recording's folder, where ``open_recording`` finds it."""
    write_calibration_file(recording.path, calibration)


def averaged_depth(sensor: Sensor, frames: tuple[FrameFile, ...]) -> NDArray[np.float32]:
    """One depth image (H, W) m of a scene that does not move; 0 where most frames have no reading.

    A pixel is the mean of its readings near their median: the median alone would stay on the sensor's coarse steps.
    Of many frames some are taken, spread over all.
    """
    frames = tuple(frames[i] for i in _spread(len(frames), _AVERAGED))
    stack = np.stack([read_depth(sensor, frame) for frame in frames])
    stack[stack == 0.0] = np.nan
    usual = np.count_nonzero(np.isfinite(stack), axis=0) * 2 > len(frames)
    readings = stack[:, usual]
    near = np.abs(readings - np.nanmedian(readings, axis=0)) < _NEAR_MEDIAN_M
    # An even number of readings can have its median in a gap between two surfaces.
    count, total = near.sum(axis=0), np.where(near, readings, 0.0).sum(axis=0)
    depth = np.zeros(usual.shape, dtype=np.float32)
    depth[usual] = np.where(count > 0, total / np.maximum(count, 1), 0.0)
    return depth


def _fit(recording: Recording, sensor: Sensor, size_m: tuple[float, float, float]) -> BoxFit:
    where = recording.path / sensor.name
    if not sensor.box_frames:
        raise CalibrationError(
            "there are no images of the calibration box", where=where, remedy="record the box with each sensor"
        )
    images = [sensor.box_frames[i] for i in _spread(len(sensor.box_frames), _BOX_IMAGES)]
    single = [read_depth(sensor, frame).astype(np.float64) for frame in images]
    try:
        fit = find_box(averaged_depth(sensor, sensor.box_frames).astype(np.float64), sensor.camera, size_m)
    except CalibrationError as error:
        _refuse_moved(_first_box(single, sensor.camera, size_m), single, sensor, size_m, where)
        raise CalibrationError(error.problem, where=where, remedy=error.remedy) from error
    _refuse_moved(fit, single, sensor, size_m, where)
    return fit


def _first_box(single: list[Floats], camera: Camera, size_m: tuple[float, float, float]) -> BoxFit | None:
    """The box in the first image alone, if the last one has it too: else neither tells that it moved."""
    try:
        fits = [find_box(depth, camera, size_m) for depth in (single[0], single[-1])]
    except CalibrationError:
        return None
    return fits[0]


def _refuse_moved(
    fit: BoxFit | None, single: list[Floats], sensor: Sensor, size_m: tuple[float, float, float], where: Path
) -> None:
    moves = [0.0 if fit is None else displacement(fit, depth, sensor.camera, size_m) for depth in single]
    if fit is not None and max(moves) > _largest_move(fit):
        far = f"by {1000 * max(moves):.0f} mm" if np.isfinite(max(moves)) else "far"
        raise CalibrationError(
            f"the box, or the sensor, moved {far} while its images were taken",
            where=where,
            remedy="leave both alone while the box is recorded, and nobody in front of it",
        )


def _largest_move(fit: BoxFit) -> float:
    """How far (m) apart two images of a box that stands still may show it."""
    distance = float(np.linalg.norm(fit.box_from_sensor[:3, 3]))
    return _LARGEST_MOVE_M * max(1.0, distance / _LARGEST_MOVE_AT_M) ** 2


def _spread(count: int, most: int) -> list[int]:
    """At most so many of ``count`` indices, first and last included."""
    return sorted({round(i) for i in np.linspace(0, count - 1, most)})


def _report(fit: BoxFit, world_from_sensor: Floats, margin: float | None, distance: Apart | None) -> SensorCalibration:
    return SensorCalibration(
        world_from_sensor,
        residual_mm=1000.0 * fit.residual_m,
        details={
            "box_points": fit.points,
            "box_faces": fit.faces,
            "face_angles_deg": list(fit.face_angles_deg),
            "measured_size_mm": [1000.0 * side for side in fit.measured_size_m],
            "ambiguity_margin": margin,
            **_apart_details(distance),
        },
    )


def _apart_details(distance: Apart | None) -> dict[str, float | None]:
    return {
        "apart_mm": None if distance is None else 1000.0 * distance.distance_m,
        "apart_deviation_mm": None if distance is None else 1000.0 * distance.deviation_m,
    }


def _resolved(
    recording: Recording, fits: Mapping[str, BoxFit], readings: list[Floats], looks: list[dict[str, _Look]]
) -> tuple[dict[str, Floats], dict[str, float]]:
    """World from sensor (4, 4) by name, one sensor after the other, and the margins of the decisions."""
    first, *others = recording.sensors
    poses = {first.name: fits[first.name].box_from_sensor}
    margins: dict[str, float] = {}
    for sensor in others:
        candidates = [transform(turn, np.zeros(3)) @ fits[sensor.name].box_from_sensor for turn in readings]
        scores = [_score(looks, sensor.name, candidate, poses) for candidate in candidates]
        ranked = np.argsort(scores)[::-1]
        best, margin = int(ranked[0]), float(scores[ranked[0]] - scores[ranked[1]])
        if scores[best] < _LEAST_SCORE:
            raise CalibrationError(
                f"what sensor {sensor.name!r} saw does not lie on what the others saw, whichever of {len(scores)} ways "
                f"round it sees the box: the best agrees by {scores[best]:.2f}",
                where=recording.path,
                remedy="leave box and sensors alone between the sensors' images of the box and the end, with the "
                "person moving in view of all sensors at once",
            )
        if margin < _LEAST_MARGIN:
            raise CalibrationError(
                f"which way round sensor {sensor.name!r} sees the box cannot be decided: of {len(scores)} ways the "
                f"best agrees with the other sensors by {scores[best]:.2f}, the next by {scores[ranked[1]]:.2f}",
                where=recording.path,
                remedy="record the person moving in view of all sensors at once",
            )
        poses[sensor.name], margins[sensor.name] = candidates[best], margin
    return poses, margins


def _distances(
    recording: Recording, looks: list[dict[str, _Look]], poses: Mapping[str, Floats], remedy: str = _REMEDY_OF_BOX
) -> dict[str, Apart]:
    """How far the clouds of each sensor but the first lie from those of one before it, the worst of all.

    Raises:
        CalibrationError: too far.
    """
    seen = [{name: surface(look.depth, look.camera) for name, look in moment.items()} for moment in looks]
    names = [sensor.name for sensor in recording.sensors]
    found: dict[str, Apart] = {}
    for number, name in enumerate(names):
        for other in names[:number]:
            pairs = [(moment[name], moment[other]) for moment in seen if name in moment and other in moment]
            distance = apart(pairs, inverse(poses[other]) @ poses[name]) if pairs else None
            if distance is None:
                continue
            _refuse_far(recording, name, other, distance, remedy)
            if name not in found or distance.distance_m > found[name].distance_m:
                found[name] = distance
    return found


def _refuse_far(recording: Recording, name: str, other: str, distance: Apart, remedy: str) -> None:
    if distance.distance_m < max(_FAR_APART_M, _SURELY * distance.deviation_m):
        return
    raise CalibrationError(
        f"what sensor {name!r} saw lies {1000 * distance.distance_m:.0f} mm (standard deviation "
        f"{1000 * distance.deviation_m:.0f} mm) from what {other!r} saw at the same time",
        where=recording.path,
        remedy=remedy,
    )


def _looks(recording: Recording, alone: str) -> list[dict[str, _Look]]:
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
        for index in _spread(len(shared), _INSTANTS)
    ]


def _look(sensor: Sensor, frame: FrameFile) -> _Look:
    depth = read_depth(sensor, frame)
    points = backproject(sensor.camera, depth)
    points = points[np.isfinite(points[..., 2])]
    window = np.ones((2 * _SILHOUETTE_PX + 1,) * 2, np.uint8)
    empty = cv2.dilate((depth > 0.0).astype(np.uint8), window) == 0
    return _Look(
        sensor.camera, depth, points[:: max(1, len(points) // _POINTS)], np.asarray(empty), sensor.depth_range_m
    )


def _score(looks: list[dict[str, _Look]], name: str, pose: Floats, poses: Mapping[str, Floats]) -> float:
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


def _compared(seen: _Look, by: _Look, by_from_seen: Floats) -> tuple[int, int]:
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
