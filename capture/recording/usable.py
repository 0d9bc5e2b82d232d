"""Whether the depth images of a recording hold depth that can be used, before anybody searches a limb in them."""

from __future__ import annotations

import numpy as np

from capture.errors import RecordingError
from capture.recording import depth_png
from capture.recording.types import Recording, Sensor
from capture.rigid import Floats

LEAST_USABLE = 0.05
"""Of the readings; with fewer in a sensor's range, its unit or its range is wrong."""
_LIMB = 0.01  # of the image: as much as this inside a range that was set close around a limb is meant so
_LOOKED_AT = 5
_SATURATED = 65535
_FACTORS = {"ten times larger": 10.0, "ten times smaller": 0.1, "1000 times larger": 1e3, "1000 times smaller": 1e-3}


def refuse_useless_depth(recording: Recording) -> None:
    """Refuse a recording with a sensor that gave depth, hardly any of which lies in the sensor's range.

    A few images spread over the recording are looked at. A sensor without any reading is let pass: it says nothing.

    Raises:
        RecordingError: names the sensor, where its depth lies, and the likely unit; or an image cannot be read.
    """
    for sensor in recording.sensors:
        depth = _depth(sensor)
        near, far = sensor.depth_range_m
        usable = _inside(depth, sensor)
        picks = min(len(sensor.frames), _LOOKED_AT)
        if not len(depth) or usable >= LEAST_USABLE or usable * len(depth) >= _LIMB * picks * _pixels(sensor):
            continue
        low, high = np.quantile(depth, [0.01, 0.99])
        better = [words for words, factor in _FACTORS.items() if _inside(depth * factor, sensor) > 1.0 - LEAST_USABLE]
        likely = f"a depth_unit_m {better[0]} would bring them there" if better else "is depth_unit_m right?"
        raise RecordingError(
            f"sensor {sensor.name!r} has depth from {low:.3g} to {high:.3g} m by its unit, of which {usable:.0%} "
            f"lies in its range of {near:g} to {far:g} m",
            where=recording.path,
            remedy=f"{likely}; if they are right so, widen depth_range_m in recording.json",
        )


def _depth(sensor: Sensor) -> Floats:
    """All readings (N,) of a few of a sensor's images, as metres."""
    if not sensor.frames:
        return np.zeros(0)
    picks = np.unique(np.linspace(0, len(sensor.frames) - 1, _LOOKED_AT).round().astype(int))
    size = {"width": sensor.camera.width, "height": sensor.camera.height}
    images = [depth_png.read_readings(sensor.frames[k].path, **size) for k in picks]
    readings = np.concatenate([image[(image > 0) & (image < _SATURATED)] for image in images])
    return readings.astype(np.float64) * sensor.depth_unit_m


def _inside(depth: Floats, sensor: Sensor) -> float:
    """The share of depth (N,) (m) in the sensor's range."""
    near, far = sensor.depth_range_m
    return float(((depth >= near) & (depth <= far)).mean()) if len(depth) else 0.0


def _pixels(sensor: Sensor) -> int:
    return sensor.camera.width * sensor.camera.height
