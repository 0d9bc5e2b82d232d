"""Images that a sensor handed out again under new times, as drivers do that have nothing new to give.

They look like a limb that stands still while the other sensor sees it move. A real image is never the same twice, bit
for bit; a simulated one without noise may be, where nothing moves. So a repeated image is stale where something else
tells that time went on: another sensor whose images changed meanwhile, or, of a sensor alone, its own other images.
"""

from __future__ import annotations

import hashlib
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from capture.errors import RecordingError
from capture.recording.types import FrameFile, Recording, Sensor


@lru_cache(maxsize=8)
def stale_frames(recording: Recording) -> dict[str, frozenset[FrameFile]]:
    """Of each sensor, by name, the frames that repeat the image before though time went on.

    Raises:
        RecordingError: an image cannot be read.
    """
    repeats = {sensor.name: _repeats(sensor) for sensor in recording.sensors}
    stale: dict[str, frozenset[FrameFile]] = {}
    for sensor in recording.sensors:
        others = [other for other in recording.sensors if other is not sensor and len(other.frames) > 1]
        mine = repeats[sensor.name]
        if others:
            moved = np.any([_changed(other, repeats[other.name], sensor) for other in others], axis=0)
        else:
            moved = np.full(len(mine), not mine[1:].all())
        stale[sensor.name] = frozenset(sensor.frames[k] for k in np.flatnonzero(mine & moved))
    return stale


def _repeats(sensor: Sensor) -> NDArray[np.bool_]:
    """Which frames (N,) have the very image of the frame before; only files of one size are read."""
    sizes = [_size(frame) for frame in sensor.frames]
    same = np.zeros(len(sizes), dtype=bool)
    digests: dict[int, bytes] = {}
    for k in range(1, len(sizes)):
        if sizes[k] == sizes[k - 1]:
            pair = [digests.setdefault(i, _digest(sensor.frames[i])) for i in (k - 1, k)]
            same[k] = pair[0] == pair[1]
    return same


def _changed(other: Sensor, repeats: NDArray[np.bool_], sensor: Sensor) -> NDArray[np.bool_]:
    """Whether another sensor's image changed since the frame before each of the sensor's frames (N,)."""
    times = np.array([frame.time_s for frame in other.frames])
    fresh = times[1:][~repeats[1:]]
    now = np.array([frame.time_s for frame in sensor.frames])
    before = np.r_[-np.inf, now[:-1]]
    return np.asarray(np.searchsorted(fresh, now, side="right") > np.searchsorted(fresh, before, side="right"))


def _size(frame: FrameFile) -> int:
    try:
        return frame.path.stat().st_size
    except OSError as error:
        raise RecordingError("cannot be read", where=frame.path, remedy="check the file") from error


def _digest(frame: FrameFile) -> bytes:
    try:
        return hashlib.blake2b(frame.path.read_bytes(), digest_size=16).digest()
    except OSError as error:
        raise RecordingError("cannot be read", where=frame.path, remedy="check the file") from error
