"""What drivers and importers make of images: mirrored, other units, other lenses, raw disparity."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from capture.recording import open_recording
from capture.recording.depth_png import Readings, read_readings, write_readings
from track.evaluation.trials.people import ARM, sound
from track.evaluation.trials.recorded import Made, performance_of, record
from track.simulation.simulate import performance_rig

_NONE = 2047  # a Kinect's raw reading where it measured nothing


def mirrored(*numbers: int) -> Callable[[int, Path], Made]:
    """The images of some sensors, those of the box too, are mirrored by the driver."""

    def make(seed: int, folder: Path) -> Made:
        made = sound(ARM)(seed, folder)
        names = [sensor.name for sensor in open_recording(folder).sensors]
        for number in numbers:
            change_images(folder, names[number], lambda readings: np.ascontiguousarray(readings[:, ::-1]))
        return made

    return make


def change_images(folder: Path, sensor: str, change: Callable[[Readings], Readings]) -> None:
    """Change all images of a sensor of a recording in place."""
    camera = open_recording(folder).sensor(sensor).camera
    for path in sorted((folder / sensor).glob("*.png")):
        write_readings(path, change(read_readings(path, width=camera.width, height=camera.height)))


def one_sensor(seed: int, folder: Path) -> Made:
    """An arm before one sensor: no box is needed, so nothing checks what the recording says of the sensor."""
    performance = performance_of(ARM, seed)
    rig = performance_rig(performance, elevations_deg=(18.0,), seed=seed)
    made = Made(folder, ARM, record(performance, folder, seed=seed, rig=rig))
    _edit_header(folder, lambda header: {k: v for k, v in header.items() if k != "box"})
    for path in folder.glob("*/box*"):
        path.unlink()
    return made


def raw_disparity(seed: int, folder: Path) -> Made:
    """A Kinect's raw 11-bit disparity stands where millimetres should."""
    made = one_sensor(seed, folder)
    for sensor in open_recording(folder).sensors:
        change_images(folder, sensor.name, as_disparity)
    return made


def as_disparity(millimetres: Readings) -> Readings:
    """Readings as OpenKinect's raw ones: depth = 1 / (3.331 - 0.003071 raw) m."""
    metres = np.where(millimetres > 0, millimetres, 1000) / 1000.0
    raw = np.rint((3.3309495161 - 1.0 / metres) / 0.0030711016)
    return np.where(millimetres > 0, np.clip(raw, 0, _NONE), _NONE).astype(np.uint16)


def focal(factor: float) -> Callable[[int, Path], Made]:
    """The recording's focal lengths are wrong by a factor."""

    def change(sensor: dict[str, Any]) -> dict[str, Any]:
        camera = sensor["camera"]
        return sensor | {"camera": camera | {name: factor * camera[name] for name in ("fx", "fy")}}

    return _misdescribed(change)


def unit(factor: float) -> Callable[[int, Path], Made]:
    """The recording's depth unit, and its range, are wrong by a factor."""

    def change(sensor: dict[str, Any]) -> dict[str, Any]:
        limits = [factor * limit for limit in sensor["depth_range_m"]]
        return sensor | {"depth_unit_m": factor * sensor["depth_unit_m"], "depth_range_m": limits}

    return _misdescribed(change)


def _misdescribed(change: Callable[[dict[str, Any]], dict[str, Any]]) -> Callable[[int, Path], Made]:
    def make(seed: int, folder: Path) -> Made:
        made = one_sensor(seed, folder)
        _edit_header(folder, lambda header: header | {"sensors": [change(sensor) for sensor in header["sensors"]]})
        return made

    return make


def _edit_header(folder: Path, edit: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
    path = folder / "recording.json"
    header = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps(edit(header), indent=1) + "\n", encoding="utf-8")


MAKERS: dict[str, Callable[[int, Path], Made]] = {
    "one sound sensor": one_sensor,
    "all sensors mirrored": mirrored(0, 1),
    "one sensor mirrored": mirrored(1),
    "raw Kinect disparity": raw_disparity,
    "focal length 0.8": focal(0.8),
    "focal length 1.25": focal(1.25),
    "depth unit x 10": unit(10.0),
    "depth unit / 10": unit(0.1),
}
