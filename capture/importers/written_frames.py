"""Frames of a source into a recording: those of the box, those of a person, and colour images."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from pathlib import Path

from capture.errors import RecordingError
from capture.importers.source import ColourFrame, DepthFrame, Source
from capture.importers.time_ranges import Parts
from capture.recording import RecordingWriter, Sensor

_EARLY_COLOUR = 8
"""How many colour images before the first depth frame are kept."""

Progress = Callable[[str, int, int | None], None]
"""Called after each depth frame with the sensor's name, how many have been read, and of how many (if known)."""


def write_box_frames(writer: RecordingWriter, sensor: Sensor, source: Source, path: Path) -> None:
    """Write all depth frames of a source as the box's; its first has time 0.

    Raises:
        RecordingError: it is of another camera, has no depth frame, or whatever the reader finds wrong.
    """
    if (source.sensor.camera, source.sensor.depth_unit_m) != (sensor.camera, sensor.depth_unit_m):
        raise RecordingError(
            f"was recorded by another camera than {sensor.name!r} or in another mode",
            where=path,
            remedy="give the files of the box in the order of the others, recorded with the same settings",
        )
    first = None
    for frame in source.frames:
        if isinstance(frame, DepthFrame):
            first = frame.time_s if first is None else first
            writer.add_box_frame(sensor.name, frame.readings, frame.time_s - first)
    if first is None:
        raise RecordingError("has no depth frames", where=path, remedy="record or copy it again")


def write_frames(
    writer: RecordingWriter,
    sensor: Sensor,
    source: Source,
    path: Path,
    *,
    shift_s: float,
    parts: Parts,
    progress: Progress | None = None,
) -> None:
    """Write the frames of a source, ``shift_s`` later than the source says, each to its part of the recording.

    Colour images out of order are left out, and so are those long before the first depth frame.

    Raises:
        RecordingError: no depth frame of a part, or whatever the reader finds wrong.
    """
    count = 0
    written = {"box": 0, "person": 0, "neither": 0}
    last_colour = last_depth = -math.inf
    early: deque[ColourFrame] = deque(maxlen=_EARLY_COLOUR)
    for frame in source.frames:
        part = parts.of(frame.time_s + shift_s)
        if isinstance(frame, DepthFrame):
            last_depth = frame.time_s
            if part != "neither":
                add = writer.add_box_frame if part == "box" else writer.add_frame
                add(sensor.name, frame.readings, frame.time_s + shift_s)
            written[part] += 1
            count += 1
            if progress is not None:
                progress(sensor.name, count, source.count)
        elif part != "neither":
            early.append(frame)
        while early and count:
            colour = early.popleft()
            if colour.time_s > last_colour:
                last_colour = colour.time_s
                writer.add_colour(sensor.name, colour.image, colour.time_s + shift_s)
    if count == 0:
        raise RecordingError("has no depth frames", where=path, remedy="record or copy it again")
    _refuse_empty(parts, written, last_depth + shift_s, path)


def _refuse_empty(parts: Parts, written: dict[str, int], last_s: float, path: Path) -> None:
    """Raise RecordingError if a part that was asked for got no frame."""
    if parts.box is not None and not written["box"]:
        raise RecordingError(
            f"has no frames of the box, from {parts.box[0]:g} to {parts.box[1]:g} s",
            where=path,
            remedy=f"state --box-seconds of the recording's time, which ends at {last_s:.2f} s",
        )
    if not written["person"]:
        told = "" if parts.person is None else f", from {parts.person[0]:g} to {parts.person[1]:g} s"
        raise RecordingError(
            f"has no frames of a person{told}" if told else "has no frames but those of the box",
            where=path,
            remedy=f"state other times; the recording ends at {last_s:.2f} s",
        )
