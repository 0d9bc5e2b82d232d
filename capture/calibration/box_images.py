"""The box in one sensor's images: found in their average, and refused where it moved while they were taken."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.calibration.box import BoxFit, displacement, find_box
from capture.camera import Camera
from capture.errors import CalibrationError
from capture.recording import (
    FrameFile,
    Recording,
    Sensor,
    read_depth,
)
from capture.rigid import Floats

_NEAR_MEDIAN_M = 0.02  # readings farther from a pixel's median over the box frames are not averaged
_AVERAGED = 60  # of the box frames, at most, spread over them: all are in memory at once
_BOX_IMAGES = 5  # compared to see that the box stood still


# Single images of a Carmine show the corners 0.8 mm off at most at 1.2 m, 3.5 mm at 2.2 m: depth errs by its square.
_LARGEST_MOVE_M, _LARGEST_MOVE_AT_M = 0.003, 1.2


def averaged_depth(sensor: Sensor, frames: tuple[FrameFile, ...]) -> NDArray[np.float32]:
    """One depth image (H, W) m of a scene that does not move; 0 where most frames have no reading.

    A pixel is the mean of its readings near their median: the median alone would stay on the sensor's coarse steps.
    Of many frames some are taken, spread over all.
    """
    frames = tuple(frames[i] for i in spread(len(frames), _AVERAGED))
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


def box_in_images(recording: Recording, sensor: Sensor, size_m: tuple[float, float, float]) -> BoxFit:
    """The box of known sides (m) in a sensor's images of it.

    Raises:
        CalibrationError: there are no images, the box is not found (see ``box``), or it moved.
    """
    where = recording.path / sensor.name
    if not sensor.box_frames:
        raise CalibrationError(
            "there are no images of the calibration box", where=where, remedy="record the box with each sensor"
        )
    images = [sensor.box_frames[i] for i in spread(len(sensor.box_frames), _BOX_IMAGES)]
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


def spread(count: int, most: int) -> list[int]:
    """At most so many of ``count`` indices, first and last included.

    >>> spread(100, 5), spread(3, 5)
    ([0, 25, 50, 74, 99], [0, 1, 2])
    """
    return sorted({round(i) for i in np.linspace(0, count - 1, most)})
