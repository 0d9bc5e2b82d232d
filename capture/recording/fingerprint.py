"""What tells a recording from every other: a fingerprint that copying, moving, renaming and calibrating leave alone.

Results keep it, so that they are not looked at with the recording of another limb or another day.
"""

from __future__ import annotations

import hashlib
from functools import lru_cache

from capture.errors import RecordingError
from capture.recording.types import Recording, Sensor


@lru_cache(maxsize=8)
def fingerprint(recording: Recording) -> str:
    """A digest of each sensor's image size, number of frames, and first, middle and last image, in any order.

    Times, names, cameras, region and calibration may be mended without making it another recording.

    Raises:
        RecordingError: an image cannot be read.
    """
    return hashlib.sha256("".join(sorted(map(_of_sensor, recording.sensors))).encode()).hexdigest()[:32]


def _of_sensor(sensor: Sensor) -> str:
    camera, frames = sensor.camera, sensor.frames
    digest = hashlib.sha256(f"{camera.width} {camera.height} {len(frames)}".encode())
    for k in sorted({0, len(frames) // 2, len(frames) - 1}) if frames else ():
        path = frames[k].path
        try:
            digest.update(hashlib.sha256(path.read_bytes()).digest())
        except OSError as error:
            raise RecordingError("cannot be read", where=path, remedy="record or copy it again") from error
    return digest.hexdigest()
