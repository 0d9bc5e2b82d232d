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
from pathlib import Path

import numpy as np

from capture.calibration.box import BoxFit, symmetries
from capture.calibration.box_images import box_in_images
from capture.calibration.extrinsic_check import CloudOffset, cloud_offset, surface
from capture.calibration.shared_views import Look, agreement, least_agreement, shared_looks
from capture.errors import CalibrationError
from capture.recording import (
    Calibration,
    Recording,
    SensorCalibration,
    write_calibration_file,
)
from capture.rigid import Floats, inverse, transform

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
    fits = {sensor.name: box_in_images(recording, sensor, recording.box_size_m) for sensor in recording.sensors}
    looks = shared_looks(recording, _BOX_ALONE) if len(recording.sensors) > 1 else []
    poses, margins = _resolved(recording, fits, symmetries(recording.box_size_m), looks)
    offsets = _offsets(recording, looks, poses)
    return Calibration(
        {name: _report(fit, poses[name], margins.get(name), offsets.get(name)) for name, fit in fits.items()}
    )


def known_calibration(recording: Recording, poses: Mapping[str, Floats], *, where: Path) -> Calibration:
    """The calibration that known poses (4, 4), world from sensor by name, make, if the sensors' clouds agree with it.

    ``where`` is the file of the poses, which errors name.

    Raises:
        CalibrationError: the sensors never saw the person at once, or what they saw does not lie on each other.
    """
    looks = shared_looks(recording, "matrices alone are not believed") if len(recording.sensors) > 1 else []
    _refuse_disagreeing(looks, poses, where)
    offsets = _offsets(recording, looks, poses, _REMEDY_OF_KNOWN)
    return Calibration({name: _known_sensor(pose, where, offsets.get(name)) for name, pose in poses.items()})


def _known_sensor(pose: Floats, where: Path, offset: CloudOffset | None) -> SensorCalibration:
    return SensorCalibration(pose, residual_mm=None, details={"given_by": where.name, **_apart_details(offset)})


def _refuse_disagreeing(looks: list[dict[str, Look]], poses: Mapping[str, Floats], where: Path) -> None:
    """Refuse poses by which what one sensor saw is not where those before it saw it."""
    score = least_agreement(looks, poses)
    if score is None or score[1] >= _LEAST_SCORE:
        return
    turned = least_agreement(looks, {name: inverse(pose) for name, pose in poses.items()})
    other_way = turned is not None and turned[1] >= _LEAST_SCORE
    raise CalibrationError(
        f"what sensor {score[0]!r} saw does not lie on what the others saw: they agree by {score[1]:.2f}"
        + (f", by the inverse matrices {turned[1]:.2f}" if turned is not None and other_way else ""),
        where=where,
        remedy="the matrices map the other way: rename world_from_NAME to NAME_from_world, or back"
        if other_way
        else _REMEDY_OF_KNOWN,
    )


def write_calibration(recording: Recording, calibration: Calibration) -> None:
    """Keep a calibration in the recording's folder, where ``open_recording`` finds it."""
    write_calibration_file(recording.path, calibration)


def _report(
    fit: BoxFit, world_from_sensor: Floats, margin: float | None, offset: CloudOffset | None
) -> SensorCalibration:
    return SensorCalibration(
        world_from_sensor,
        residual_mm=1000.0 * fit.residual_m,
        details={
            "box_points": fit.points,
            "box_faces": fit.faces,
            "face_angles_deg": list(fit.face_angles_deg),
            "measured_size_mm": [1000.0 * side for side in fit.measured_size_m],
            "ambiguity_margin": margin,
            **_apart_details(offset),
        },
    )


def _apart_details(offset: CloudOffset | None) -> dict[str, float | None]:
    return {
        "apart_mm": None if offset is None else 1000.0 * offset.distance_m,
        "apart_deviation_mm": None if offset is None else 1000.0 * offset.deviation_m,
    }


def _resolved(
    recording: Recording, fits: Mapping[str, BoxFit], readings: list[Floats], looks: list[dict[str, Look]]
) -> tuple[dict[str, Floats], dict[str, float]]:
    """World from sensor (4, 4) by name, one sensor after the other, and the margins of the decisions."""
    first, *others = recording.sensors
    poses = {first.name: fits[first.name].box_from_sensor}
    margins: dict[str, float] = {}
    for sensor in others:
        candidates = [transform(turn, np.zeros(3)) @ fits[sensor.name].box_from_sensor for turn in readings]
        scores = [agreement(looks, sensor.name, candidate, poses) for candidate in candidates]
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


def _offsets(
    recording: Recording, looks: list[dict[str, Look]], poses: Mapping[str, Floats], remedy: str = _REMEDY_OF_BOX
) -> dict[str, CloudOffset]:
    """How far the clouds of each sensor but the first lie from those of one before it, the worst of all.

    Raises:
        CalibrationError: too far.
    """
    seen = [{name: surface(look.depth, look.camera) for name, look in moment.items()} for moment in looks]
    names = [sensor.name for sensor in recording.sensors]
    found: dict[str, CloudOffset] = {}
    for number, name in enumerate(names):
        for other in names[:number]:
            pairs = [(moment[name], moment[other]) for moment in seen if name in moment and other in moment]
            offset = cloud_offset(pairs, inverse(poses[other]) @ poses[name]) if pairs else None
            if offset is None:
                continue
            _refuse_far(recording, name, other, offset, remedy)
            if name not in found or offset.distance_m > found[name].distance_m:
                found[name] = offset
    return found


def _refuse_far(recording: Recording, name: str, other: str, offset: CloudOffset, remedy: str) -> None:
    if offset.distance_m < max(_FAR_APART_M, _SURELY * offset.deviation_m):
        return
    raise CalibrationError(
        f"what sensor {name!r} saw lies {1000 * offset.distance_m:.0f} mm (standard deviation "
        f"{1000 * offset.deviation_m:.0f} mm) from what {other!r} saw at the same time",
        where=recording.path,
        remedy=remedy,
    )
