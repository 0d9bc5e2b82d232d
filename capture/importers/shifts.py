"""When the sources began beside each other: what is added to the times of each, and how that was found."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from capture.errors import RecordingError
from capture.importers.inputs import Input
from capture.importers.offset import estimate_offset, motion_of
from capture.importers.source import NO_CLOCK, DepthFrame, Source


def time_shifts(inputs: Sequence[Input], offset: Literal["motion", "clock"] | float) -> tuple[list[float], list[str]]:
    """What is added to the times of each source (s), and how it was found, in words.

    Raises:
        RecordingError: a source has no depth frame, motion tells no offset, or there is no common clock.
    """
    starts = [_first_time(one.opened(), one.path) for one in inputs]
    shifts: list[float] = [-starts[0]]
    told: list[str] = []
    if len(inputs) == 1:
        return shifts, told
    if offset == "clock":
        return [-starts[0]] * len(inputs), [_one_clock(inputs)]
    before = motion_of(inputs[0].opened()) if offset == "motion" else None
    total = 0.0
    for last, one, start in zip(inputs, inputs[1:], starts[1:], strict=False):
        how = "as stated"
        if before is None:
            step = float(offset)
        else:
            now = motion_of(one.opened())
            found = estimate_offset(before, now, where=one.path)
            step, before = found.seconds, now
            how = f"by motion, one standard deviation {found.deviation_s:.4f} s, correlation {found.correlation:.2f}"
        total += step
        shifts.append(total - start)
        told.append(f"{one.sensor.name} begins {step:.4f} s after {last.sensor.name} ({how})")
    return shifts, told


def _one_clock(inputs: Sequence[Input]) -> str:
    """What one clock of all sources means, in words.

    Raises:
        RecordingError: a source's clock is its own, or only some sources have one.
    """
    if all(one.source.alone == NO_CLOCK for one in inputs):
        return "none has a clock, so all are taken to begin at once"
    for one in inputs:
        if one.source.alone:
            raise RecordingError(
                f"{one.source.alone}, so it shares no clock with the others",
                where=one.path,
                remedy="give --offset motion, or the time between the sensors' first frames (0 if they began at once)",
            )
    return "all by one clock"


def _first_time(source: Source, path: Path) -> float:
    """The time (s) of a source's first depth frame."""
    for frame in source.frames:
        if isinstance(frame, DepthFrame):
            return frame.time_s
    raise RecordingError("has no depth frames", where=path, remedy="record or copy it again")
