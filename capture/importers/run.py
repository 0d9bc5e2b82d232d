"""Sensors' files into one recording, frame by frame."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from capture.errors import RecordingError
from capture.importers.formats import open_source
from capture.importers.source import ColourFrame, DepthFrame, Source, Stated
from capture.recording import Recording, RecordingWriter, Sensor, open_recording

_EARLY_COLOUR = 8
"""How many colour images before the first depth frame are kept."""

Progress = Callable[[str, int, int | None], None]
"""Called after each depth frame with the sensor's name, how many have been read, and of how many (if known)."""


def import_recording(
    path: Path,
    out: Path,
    *,
    stated: Stated | None = None,
    format_name: str | None = None,
    sensor_name: str = "sensor",
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Recording:
    """Make a recording of one sensor's file or folder; its time 0 is the first depth frame.

    Raises:
        RecordingError: the file is missing, empty, damaged, of another kind, or without depth; too little is known of
            the camera; or ``out`` is in use.
    """
    source = open_source(path, stated or Stated(), name=format_name)
    sensor = replace(source.sensor, name=sensor_name)
    created_by = f"bonetrack import of {path.name}, times by {source.times}"
    with RecordingWriter(out, sensors=[sensor], created_by=created_by, overwrite=overwrite) as writer:
        write_frames(writer, sensor, source, path, progress=progress)
    return open_recording(out)


def write_frames(
    writer: RecordingWriter,
    sensor: Sensor,
    source: Source,
    path: Path,
    *,
    start_s: float | None = 0.0,
    progress: Progress | None = None,
) -> None:
    """Write all frames of a source; ``start_s`` is the time of its first depth frame (None: its own clock's).

    Colour images out of order are left out, and so are those long before the first depth frame.

    Raises:
        RecordingError: no depth frame, depth out of order, or whatever the reader finds wrong.
    """
    count, shift = 0, 0.0
    last_colour = last_depth = -math.inf
    early: deque[ColourFrame] = deque(maxlen=_EARLY_COLOUR)
    for frame in source.frames:
        if isinstance(frame, DepthFrame):
            if count == 0 and start_s is not None:
                shift = start_s - frame.time_s
            if not frame.time_s > last_depth:
                raise RecordingError(
                    f"depth frame {count} (at {frame.time_s:.4f} s) does not come after the one before",
                    where=path,
                    remedy="record or copy it again",
                )
            last_depth = frame.time_s
            writer.add_frame(sensor.name, frame.readings, frame.time_s + shift)
            count += 1
            if progress is not None:
                progress(sensor.name, count, source.count)
        else:
            early.append(frame)
        while early and count:
            colour = early.popleft()
            if colour.time_s > last_colour:
                last_colour = colour.time_s
                writer.add_colour(sensor.name, colour.image, colour.time_s + shift)
    if count == 0:
        raise RecordingError("has no depth frames", where=path, remedy="record or copy it again")
