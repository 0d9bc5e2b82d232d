"""Sensors' files into one recording, frame by frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from capture.importers.inputs import Input, open_inputs
from capture.importers.options import AS_USUAL, ImportOptions
from capture.importers.readings import Tally
from capture.importers.shifts import time_shifts
from capture.importers.time_ranges import Parts
from capture.importers.times import Timed
from capture.importers.written_frames import Progress, write_box_frames, write_frames
from capture.recording import Recording, RecordingWriter, open_recording
from capture.recording.clocks import refuse_clocks_apart, refuse_impossible_rate
from capture.rigid import Floats

_RATE = "If they stand in names of files, state the true rate with --fps (1 for stills)"

Told = Callable[[str, str], None]
"""Called with a sensor's name and what its readings are like, in words."""


def import_recording(
    paths: Path | Sequence[Path],
    out: Path,
    options: ImportOptions = AS_USUAL,
    *,
    progress: Progress | None = None,
    readings: Told | None = None,
) -> Recording:
    """Make one recording of the files or folders of one or more sensors; time 0 is the first's first depth frame.

    Args:
        paths: one file or folder a sensor.
        out: the folder to make.
        options: what is stated of the cameras, the clocks, the box; which frames are kept.
        progress: called after each frame.
        readings: called with each sensor's name and what its readings are like, in words.

    Raises:
        RecordingError: a file is missing, empty, damaged, of another kind, or without depth; its readings are of no
            use; too little is known of the camera; its times cannot be; the clocks have no time in common; motion tells
            no offset; no frames of the box, or of anything else, are at the stated times; or ``out`` is in use.
    """
    inputs, box = open_inputs(paths, out, options), options.box
    shifts, told = time_shifts(inputs, options.offset)
    created_by = "; ".join([f"bonetrack import of {' and '.join(one.in_words() for one in inputs)}", *told])
    sensors = [one.sensor for one in inputs]
    with RecordingWriter(out, sensors=sensors, created_by=created_by, overwrite=options.overwrite) as writer:
        if box is not None:
            writer.set_box(box.size_m)
        for one in inputs:
            if one.box_path is not None:
                write_box_frames(writer, one.sensor, one.opened(one.box_path), one.box_path)
        parts, filmed = Parts(None if box is None else box.seconds, options.seconds), {}
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
