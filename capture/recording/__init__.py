"""Recordings: a folder with the depth images of one or more sensors (docs/recording-format.md).

This module is what the rest of the program uses; the data stand in ``types``, reading and writing in ``read`` and
``write``, which sensor's frame belongs to which other's in ``pairing``.
"""

from __future__ import annotations

import numpy as np

from capture.errors import CalibrationError
from capture.recording.pairing import FramesUsed, frames_used, instants, refuse_impossible_rates, used_in_words
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
from capture.recording.usable import refuse_useless_depth
from capture.recording.write import RecordingWriter, write_calibration_file
from capture.rigid import Floats

__all__ = [
    "Calibration",
    "Colour",
    "FrameFile",
    "FramesUsed",
    "Instant",
    "Recording",
    "RecordingWriter",
    "Region",
    "Sensor",
    "SensorCalibration",
    "frames_used",
    "instants",
    "open_recording",
    "read_depth",
    "refuse_impossible_rates",
    "refuse_useless_depth",
    "used_in_words",
    "world_from_sensor",
    "write_calibration_file",
]


def world_from_sensor(recording: Recording, name: str) -> Floats:
    """The rigid transform (4, 4) from a sensor's frame to the common frame.

    A recording of one sensor that was never calibrated uses the sensor's own frame (identity;
    ``recording.common_frame_is_sensor`` says so).

    Raises:
        CalibrationError: several sensors, and no calibration tells where this one stands.

    >>> from pathlib import Path
    >>> from capture.camera import Camera
    >>> camera = Camera(640, 480, 580.0, 580.0, 320.0, 240.0)
    >>> world_from_sensor(Recording(Path("alone"), (Sensor("a", camera),)), "a").tolist() == np.eye(4).tolist()
    True
    >>> world_from_sensor(Recording(Path("both"), (Sensor("a", camera), Sensor("b", camera))), "a")
    Traceback (most recent call last):
        ...
    capture.errors.CalibrationError: both: where sensor 'a' stands is not known; run `bonetrack calibrate both`
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
