"""Recordings: a folder with the depth images of one or more sensors (docs/recording-format.md).

This module is what the rest of the program uses; the data stand in ``_recording_types``, reading and writing in
``_recording_read`` and ``_recording_write``.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from capture.errors import CalibrationError, RecordingError
from capture.recording.read import open_recording, read_depth
from capture.recording.types import (
    Calibration,
    Colour,
    FrameFile,
    Instant,
    Recording,
    Region,
    Sensor,
    SensorCalibration,
)
from capture.recording.write import RecordingWriter, write_calibration_file
from capture.rigid import Floats

__all__ = [
    "Calibration",
    "Colour",
    "FrameFile",
    "Instant",
    "Recording",
    "RecordingWriter",
    "Region",
    "Sensor",
    "SensorCalibration",
    "instants",
    "open_recording",
    "read_depth",
    "world_from_sensor",
    "write_calibration_file",
]

_STOOD_STILL = 1.5
"""A frame this many tolerances from any of the clock's was not paired with a neighbour's: the clock missed its time."""


def instants(recording: Recording, tolerance_s: float = 1.0 / 60.0) -> list[Instant]:
    """Group the frames of all sensors into instants, in order of time.

    The sensor with the most frames is the clock. Each other sensor gives the frame nearest in time, if it is
    within the tolerance, and each frame goes to one instant at most, the nearest; a sensor without such a frame
    is absent from the instant. Frames far from any tick, where the clock stood still, are grouped by themselves.

    Raises:
        RecordingError: no sensor has a frame.
    """
    found: list[Instant] = []
    left = {sensor.name: list(sensor.frames) for sensor in recording.sensors}
    while any(left.values()):
        clock = max(left, key=lambda name: len(left[name]))
        ticks, others = left.pop(clock), {name: frames for name, frames in left.items() if frames}
        found += _on_ticks(clock, ticks, others, tolerance_s)
        left = {name: _far_from(ticks, frames, _STOOD_STILL * tolerance_s) for name, frames in others.items()}
    if not found:
        problem = "there are no depth frames, only box frames"
        raise RecordingError(problem, where=recording.path, remedy="record the person, too")
    return sorted(found, key=lambda instant: instant.time_s)


def _on_ticks(
    clock: str, ticks: list[FrameFile], others: Mapping[str, list[FrameFile]], tolerance_s: float
) -> list[Instant]:
    """One instant for each frame of the clock, with the frames of the others that belong to it."""
    seen = [{clock: frame} for frame in ticks]
    for name, frames in others.items():
        for instant, frame in _nearest_pairs(_times(ticks), _times(frames), tolerance_s):
            seen[instant][name] = frames[frame]
    return [Instant(frame.time_s, there) for frame, there in zip(ticks, seen, strict=True)]


def _far_from(ticks: list[FrameFile], frames: list[FrameFile], seconds: float) -> list[FrameFile]:
    """The frames with no tick within so many seconds."""
    clock, times = _times(ticks), _times(frames)
    apart = np.abs(times - clock[_nearest(clock, times)])
    return [frame for frame, far in zip(frames, apart > seconds, strict=True) if far]


def _times(frames: list[FrameFile]) -> Floats:
    return np.array([frame.time_s for frame in frames])


def _nearest_pairs(clock: Floats, times: Floats, tolerance_s: float) -> list[tuple[int, int]]:
    """Pairs (index into clock, index into times): mutual nearest neighbours in time within the tolerance."""
    tick = _nearest(clock, times)
    frame = _nearest(times, clock)
    # A whisper of slack, so that a tolerance of exactly half a period is not decided by rounding.
    close = np.abs(clock - times[frame]) <= tolerance_s + 1e-9
    mutual = tick[frame] == np.arange(len(clock))
    return [(int(i), int(frame[i])) for i in np.flatnonzero(close & mutual)]


def _nearest(times: Floats, wanted: Floats) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """For each wanted time (N,) the index of the nearest of the increasing times (M,)."""
    right = np.clip(np.searchsorted(times, wanted), 1, max(len(times) - 1, 1))
    if len(times) == 1:
        return np.zeros(len(wanted), dtype=np.intp)
    return np.asarray(np.where(wanted - times[right - 1] <= times[right] - wanted, right - 1, right), dtype=np.intp)


def world_from_sensor(recording: Recording, name: str) -> Floats:
    """The rigid transform (4, 4) from a sensor's frame to the common frame.

    A recording of one sensor that was never calibrated uses the sensor's own frame (identity;
    ``recording.common_frame_is_sensor`` says so).

    Raises:
        CalibrationError: several sensors, and no calibration tells where this one stands.
    """
    recording.sensor(name)
    if recording.common_frame_is_sensor:
        return np.eye(4)
    if recording.calibration is None or name not in recording.calibration.sensors:
        raise CalibrationError(
            f"where sensor {name!r} stands is not known",
            where=recording.path,
            remedy=f"run `bonetrack calibrate {recording.path}`",
        )
    return recording.calibration.sensors[name].world_from_sensor
