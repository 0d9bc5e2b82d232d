"""Sensors' files into one recording, frame by frame."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

from capture.errors import RecordingError
from capture.importers.formats import open_source
from capture.importers.offset import estimate_offset, motion_of
from capture.importers.parts import Parts, ShownBox, Span
from capture.importers.readings import Tally
from capture.importers.source import NO_CLOCK, ColourFrame, DepthFrame, Source, Stated
from capture.importers.times import Timed
from capture.recording import Recording, RecordingWriter, Sensor, open_recording
from capture.recording.clocks import refuse_clocks_apart, refuse_impossible_rate

_EARLY_COLOUR = 8
"""How many colour images before the first depth frame are kept."""

_NOTHING_STATED = Stated()

_RATE = "If they stand in names of files, state the true rate with --fps (1 for stills)"

Progress = Callable[[str, int, int | None], None]
"""Called after each depth frame with the sensor's name, how many have been read, and of how many (if known)."""


def import_recording(
    paths: Path | Sequence[Path],
    out: Path,
    *,
    stated: Stated | Sequence[Stated] = _NOTHING_STATED,
    format_name: str | None = None,
    sensor_names: Sequence[str] = (),
    offset: Literal["motion", "clock"] | float = "motion",
    box: ShownBox | None = None,
    seconds: Span | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
    readings: Callable[[str, str], None] | None = None,
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
    listed = [paths] if isinstance(paths, Path) else list(paths)
    names = list(sensor_names) or (["sensor"] if len(listed) == 1 else [f"sensor-{i + 1}" for i in range(len(listed))])
    if len(set(names)) != len(listed):
        raise RecordingError(
            f"{len(listed)} sensors need as many different names, not {', '.join(names)}",
            where=out,
            remedy="give --sensor once for each",
        )

    _refuse_inside([*listed, *(box.paths if box is not None else ())], out)
    each = [stated] * len(listed) if isinstance(stated, Stated) else list(stated)
    of_path = dict(zip([*listed, *(box.paths if box is not None else ())], [*each, *each], strict=False))

    def opened(path: Path) -> Source:
        source = open_source(path, of_path[path], name=format_name)
        return replace(source, frames=Tally(source.sensor, path).watched(Timed(path).watched(source.frames)))

    shown = box.paths if box is not None and box.paths else ()
    if shown and len(shown) != len(listed):
        raise RecordingError(
            f"{len(listed)} sensors need as many files of the box, not {len(shown)}",
            where=out,
            remedy="give --box-source once for each",
        )
    parts = Parts(box.seconds if box is not None else None, seconds)
    sources = [open_source(path, of_path[path], name=format_name) for path in listed]
    sensors = [replace(source.sensor, name=name) for source, name in zip(sources, names, strict=True)]
    starts = [_first_time(opened(path), path) for path in listed]
    shifts, told = _shifts(listed, names, starts, offset, opened)
    if offset == "clock" and len(listed) > 1:
        told = [_one_clock(sources, listed)]
    what = " and ".join(_in_words(path, source) for path, source in zip(listed, sources, strict=True))
    created_by = "; ".join([f"bonetrack import of {what}", *told])
    with RecordingWriter(out, sensors=sensors, created_by=created_by, overwrite=overwrite) as writer:
        if box is not None:
            writer.set_box(box.size_m)
        for path, sensor in zip(shown, sensors, strict=False):
            write_box_frames(writer, sensor, opened(path), path)
        filmed = {}
        for path, source, sensor, shift in zip(listed, sources, sensors, shifts, strict=True):
            tally, timed = Tally(sensor, path), Timed(path)
            watched = replace(source, frames=tally.watched(timed.watched(source.frames)))
            write_frames(writer, sensor, watched, path, shift_s=shift, parts=parts, progress=progress)
            refuse_impossible_rate(sensor.name, timed.times_s, where=path, mend=_RATE)
            filmed[sensor.name] = timed.times_s + shift
            for words in timed.words():
                writer.tell(f"{sensor.name}: {words}")
            if readings is not None:
                readings(sensor.name, tally.words())
        refuse_clocks_apart(filmed, where=out)
    return open_recording(out)


def _refuse_inside(paths: Sequence[Path], out: Path) -> None:
    """Raise RecordingError where a file to be read lies in the folder that is emptied before it is written."""
    for path in paths:
        if out.resolve() in (path.resolve(), *path.resolve().parents):
            remedy = "give another --out"
            raise RecordingError("lies in the folder that is to be written", where=path, remedy=remedy)


def _in_words(path: Path, source: Source) -> str:
    """What a source is and how it was taken, for who looks at the recording later."""
    turned = ", mirrored by the driver and turned back" if source.sensor.mirrored else ""
    return f"{path.name}{turned}, times by {source.times}"


def _one_clock(sources: Sequence[Source], paths: Sequence[Path]) -> str:
    """What one clock of all sources means, in words.

    Raises:
        RecordingError: a source's clock is its own, or only some sources have one.
    """
    if all(source.alone == NO_CLOCK for source in sources):
        return "none has a clock, so all are taken to begin at once"
    for source, path in zip(sources, paths, strict=True):
        if source.alone:
            raise RecordingError(
                f"{source.alone}, so it shares no clock with the others",
                where=path,
                remedy="give --offset motion, or the time between the sensors' first frames (0 if they began at once)",
            )
    return "all by one clock"


def _first_time(source: Source, path: Path) -> float:
    """The time (s) of a source's first depth frame."""
    for frame in source.frames:
        if isinstance(frame, DepthFrame):
            return frame.time_s
    raise RecordingError("has no depth frames", where=path, remedy="record or copy it again")


def _shifts(
    paths: Sequence[Path],
    names: Sequence[str],
    starts: Sequence[float],
    offset: Literal["motion", "clock"] | float,
    opened: Callable[[Path], Source],
) -> tuple[list[float], list[str]]:
    """What is added to the times of each source, and how it was found, in words."""
    shifts: list[float] = [-starts[0]]
    told: list[str] = []
    if len(paths) == 1:
        return shifts, told
    if offset == "clock":
        return [-starts[0]] * len(paths), told
    before = motion_of(opened(paths[0])) if offset == "motion" else None
    total = 0.0
    for i in range(1, len(paths)):
        how = "as stated"
        if before is None:
            step = float(offset)
        else:
            now = motion_of(opened(paths[i]))
            found = estimate_offset(before, now, where=paths[i])
            step, before = found.seconds, now
            how = f"by motion, one standard deviation {found.deviation_s:.4f} s, correlation {found.correlation:.2f}"
        total += step
        shifts.append(total - starts[i])
        told.append(f"{names[i]} begins {step:.4f} s after {names[i - 1]} ({how})")
    return shifts, told


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
