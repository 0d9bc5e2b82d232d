"""A small recording of a known limb, seen by two calibrated sensors 1.2 m away."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.camera import Camera
from capture.recording import (
    Calibration,
    Recording,
    RecordingWriter,
    Sensor,
    SensorCalibration,
    open_recording,
    write_calibration_file,
)
from capture.rigid import Floats, exp_so3, inverse, transform
from tests.analytic_depth import cylinder, quantised, rays

CAMERA = Camera(320, 240, 287.5, 287.5, 159.5, 119.5)
RADIUS, HALF_LENGTH = 0.045, 0.20
AXIS = np.array([1.0, 0.2, 0.0]) / np.hypot(1.0, 0.2)
FRAMES = 3


def poses() -> dict[str, Floats]:
    """Where the two sensors stand: both look at the origin."""
    turned = {name: exp_so3(np.array([0.0, angle, 0.0])) for name, angle in (("left", -0.5), ("right", 0.5))}
    return {name: transform(rotation, -1.2 * rotation[:, 2]) for name, rotation in turned.items()}


def limb_depth(world_from_sensor: Floats, camera: Camera = CAMERA) -> NDArray[np.float32]:
    """The quantised depth image (H, W) (m) of a piece of cylinder at the origin."""
    sensor_from_world = inverse(world_from_sensor)
    centre, axis = sensor_from_world[:3, 3], sensor_from_world[:3, :3] @ AXIS
    depth = cylinder(camera, centre, axis, RADIUS)
    along = (rays(camera) * depth[..., None] - centre) @ axis
    return quantised(np.where(np.abs(along) < HALF_LENGTH, depth, 0.0))


def write_limb(path: Path, *, calibrated: bool = True, sensors: tuple[str, ...] = ("left", "right")) -> Recording:
    """Write and open the recording."""
    where = poses()
    listed = [Sensor(name, CAMERA, 0.0005) for name in sensors]
    with RecordingWriter(path, sensors=listed, created_by="test") as writer:
        for frame in range(FRAMES):
            for name in sensors:
                writer.add_frame(name, limb_depth(where[name]), frame / 30.0)
    if calibrated:
        write_calibration_file(path, Calibration({name: SensorCalibration(where[name], 0.5) for name in sensors}))
    return open_recording(path)
