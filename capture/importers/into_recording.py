"""Sensors' files into one recording, frame by frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

from capture.importers.inputs import Input, open_inputs
from capture.importers.readings import Tally
from capture.importers.shifts import time_shifts
from capture.importers.source import UserCamera
from capture.importers.time_ranges import Parts, ShownBox, Span
from capture.importers.times import Timed
from capture.importers.written_frames import Progress, write_box_frames, write_frames
from capture.recording import Recording, RecordingWriter, open_recording
from capture.recording.clocks import refuse_clocks_apart, refuse_impossible_rate
from capture.rigid import Floats

_NOTHING_STATED = UserCamera()

_RATE = "If they stand in names of files, state the true rate with --fps (1 for stills)"

Told = Callable[[str, str], None]
"""Called with a sensor's name and what its readings are like, in words."""


def import_recording(
    paths: Path | Sequence[Path],
    out: Path,
    *,
    stated: UserCamera | Sequence[UserCamera] = _NOTHING_STATED,
    format_name: str | None = None,
    sensor_names: Sequence[str] = (),
    offset: Literal["motion", "clock"] | float = "motion",
    box: ShownBox | None = None,
    seconds: Span | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
    readings: Told | None = None,
) -> Recording:
    """Make one recording of the files or folders of one or more sensors; time 0 is the first's first depth frame.

    Args:
        paths: one file or folder a sensor.
        out: the folder to make.
        stated: what the user states of the cameras: of all alike, or of each.
        format_name: what the files are, if not to be found out.
        sensor_names: the sensors' names [``sensor``, or ``sensor-1``, ``sensor-2``, ...].
        offset: of several sensors, by how much the first depth frame of each comes after that of the one before (s);
            or ``motion``, to find it by what moves; or ``clock``, if their files were written by one clock.
        box: which frames show the calibration box; they are kept apart from the others.
        seconds: keep only what was recorded in this time, and the box's frames.
        overwrite: replace a recording that stands there already.
        progress: called after each frame.
        readings: called with each sensor's name and what its readings are like, in words.

    Raises:
        RecordingError: a file is missing, empty, damaged, of another kind, or without depth; its readings are of no
            use; too little is known of the camera; its times cannot be; the clocks have no time in common; motion tells
            no offset; no frames of the box, or of anything else, are at the stated times; or ``out`` is in use.
    """
    inputs = open_inputs(paths, out, stated=stated, format_name=format_name, sensor_names=sensor_names, box=box)
    shifts, told = time_shifts(inputs, offset)
    created_by = "; ".join([f"bonetrack import of {' and '.join(one.in_words() for one in inputs)}", *told])
    sensors = [one.sensor for one in inputs]
    with RecordingWriter(out, sensors=sensors, created_by=created_by, overwrite=overwrite) as writer:
        if box is not None:
            writer.set_box(box.size_m)
        for one in inputs:
            if one.box_path is not None:
                write_box_frames(writer, one.sensor, one.opened(one.box_path), one.box_path)
        parts, filmed = Parts(None if box is None else box.seconds, seconds), {}
        for one, shift_s in zip(inputs, shifts, strict=True):
            filmed[one.sensor.name] = _write(writer, one, shift_s, parts, progress, readings)
        refuse_clocks_apart(filmed, where=out)
    return open_recording(out)


def _write(
    writer: RecordingWriter,
    one: Input,
    shift_s: float,
    parts: Parts,
    progress: Progress | None,
    readings: Told | None,
) -> Floats:
    """Write a source's frames, and tell what is odd about its times and readings; when it was filmed (T,) (s)."""
    name, tally, timed = one.sensor.name, Tally(one.sensor, one.path), Timed(one.path)
    watched = replace(one.source, frames=tally.watched(timed.watched(one.source.frames)))
    write_frames(writer, one.sensor, watched, one.path, shift_s=shift_s, parts=parts, progress=progress)
    refuse_impossible_rate(name, timed.times_s, where=one.path, mend=_RATE)
    for words in timed.words():
        writer.tell(f"{name}: {words}")
    if readings is not None:
        readings(name, tally.words())
    return timed.times_s + shift_s
