"""Which sensor's frame belongs to which other's: instants, and how many frames of each sensor they use.

Sensors that run freely stand beside each other by any part of a period, so pairing follows each sensor's own rate: the
fastest sensor is the clock, and a frame of another belongs to the tick at most half a period of the clock away. What is
farther from every tick stands alone, as an instant of its own: there is no gap between the two.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from capture.errors import RecordingError
from capture.recording.clocks import refuse_clocks_apart, refuse_impossible_rate, usual_period
from capture.recording.stale import stale_frames
from capture.recording.types import FrameFile, Instant, Recording
from capture.rigid import Floats

WARNED_SHARE = 0.9
"""Of a sensor's frames, below which it is said that others were not used."""
_HALF_A_PERIOD = 0.55  # and a little, for sensors exactly half a period apart tremble about it
_AS_FAST = 1.1
_FEWEST = 5  # frames that tell a sensor's rate
_AT_MOST_S = 0.040  # what a limb does in more than that is no instant, however slow the sensor


@dataclass(frozen=True)
class FramesUsed:
    """Of one sensor's frames: how many there are, how many are in some instant, how many repeat an earlier image."""

    sensor: str
    total: int
    used: int
    stale: int

    @property
    def few(self) -> bool:
        """Whether so few are used that it must be said."""
        return self.used < WARNED_SHARE * self.total


@lru_cache(maxsize=8)
def _cached(recording: Recording) -> tuple[Instant, ...]:
    refuse_impossible_rates(recording)
    refuse_clocks_apart({s.name: _times(s.frames) for s in recording.sensors}, where=recording.path)
    stale = stale_frames(recording)
    left = {s.name: [f for f in s.frames if f not in stale[s.name]] for s in recording.sensors}
    found: list[Instant] = []
    while any(left.values()):
        clock = _clock(left)
        ticks, others = left.pop(clock), {name: frames for name, frames in left.items() if frames}
        within_s = _tolerance(ticks)
        found += _on_ticks(clock, ticks, others, within_s)
        left = {name: _far_from(ticks, frames, within_s) for name, frames in others.items()}
    if not found:
        problem = "there are no depth frames, only box frames"
        raise RecordingError(problem, where=recording.path, remedy="record the person, too")
    return tuple(sorted(found, key=lambda instant: instant.time_s))


def instants(recording: Recording) -> list[Instant]:
    """Group the frames of all sensors into instants, in order of time.

    Each frame goes to one instant at most; a sensor without a frame near a tick is absent from the instant. Images that
    a sensor repeats under new times are left out (``capture.recording.stale``).

    Raises:
        RecordingError: no sensor has a frame, a sensor has a rate that none has, or the clocks of two sensors have no
            time in common.
    """
    return list(_cached(recording))


def frames_used(recording: Recording) -> list[FramesUsed]:
    """How many frames of each sensor the instants use.

    Raises:
        RecordingError: see ``instants``.
    """
    moments, stale = instants(recording), stale_frames(recording)
    counts = {s.name: sum(s.name in moment.frames for moment in moments) for s in recording.sensors}
    return [FramesUsed(s.name, len(s.frames), counts[s.name], len(stale[s.name])) for s in recording.sensors]


def refuse_impossible_rates(recording: Recording) -> None:
    """Raise RecordingError where a sensor's frames come at a rate that no depth sensor has: the unit is wrong."""
    for sensor in recording.sensors:
        refuse_impossible_rate(sensor.name, _times(sensor.frames), where=recording.path)


def _clock(left: Mapping[str, list[FrameFile]]) -> str:
    """The fastest sensor, or of those about as fast the one with the most frames: no tick is then wanted twice."""
    told = {name: frames for name, frames in left.items() if len(frames) >= _FEWEST} or left
    periods = {name: usual_period(_times(frames)) for name, frames in told.items() if frames}
    fast = [name for name, period in periods.items() if period <= _AS_FAST * min(periods.values())]
    return max(fast, key=lambda name: len(left[name]))


def _tolerance(ticks: Sequence[FrameFile]) -> float:
    return min(_HALF_A_PERIOD * usual_period(_times(ticks)), _AT_MOST_S)


def _on_ticks(
    clock: str, ticks: list[FrameFile], others: Mapping[str, list[FrameFile]], within_s: float
) -> list[Instant]:
    """One instant for each frame of the clock, with the frames of the others that belong to it."""
    seen = [{clock: frame} for frame in ticks]
    for name, frames in others.items():
        for instant, frame in _pairs(_times(ticks), _times(frames), within_s):
            seen[instant][name] = frames[frame]
    return [Instant(frame.time_s, there) for frame, there in zip(ticks, seen, strict=True)]


def _far_from(ticks: list[FrameFile], frames: list[FrameFile], seconds: float) -> list[FrameFile]:
    """The frames with no tick within so many seconds."""
    clock, times = _times(ticks), _times(frames)
    apart = np.abs(times - clock[_nearest(clock, times)])
    return [frame for frame, far in zip(frames, apart > seconds + 1e-9, strict=True) if far]


def _times(frames: Sequence[FrameFile]) -> Floats:
    return np.array([frame.time_s for frame in frames])


def _pairs(clock: Floats, times: Floats, within_s: float) -> list[tuple[int, int]]:
    """Pairs (index into clock, index into times): mutual nearest neighbours, or in order where these leave some out.

    Frames half a period from two ticks tremble between them, and their nearest ticks get in each other's way; either
    tick is as near, so each frame in order of time takes the first that is free, which leaves the fewest alone.
    """
    nearest = _mutual(clock, times, within_s)
    close = np.abs(times - clock[_nearest(clock, times)]) <= within_s + 1e-9
    return nearest if len(nearest) == close.sum() else _in_order(clock, times, within_s)


def _in_order(clock: Floats, times: Floats, within_s: float) -> list[tuple[int, int]]:
    pairs: list[tuple[int, int]] = []
    first = np.searchsorted(clock, times - within_s - 1e-9)
    free = 0
    for j, (time, tick) in enumerate(zip(times, first, strict=True)):
        i = max(int(tick), free)
        if i < len(clock) and clock[i] <= time + within_s + 1e-9:
            pairs.append((i, j))
            free = i + 1
    return pairs


def _mutual(clock: Floats, times: Floats, within_s: float) -> list[tuple[int, int]]:
    tick, frame = _nearest(clock, times), _nearest(times, clock)
    # A whisper of slack, so that exactly half a period is not decided by rounding.
    close = np.abs(clock - times[frame]) <= within_s + 1e-9
    mutual = tick[frame] == np.arange(len(clock))
    return [(int(i), int(frame[i])) for i in np.flatnonzero(close & mutual)]


def _nearest(times: Floats, wanted: Floats) -> NDArray[np.intp]:
    """For each wanted time (N,) the index of the nearest of the increasing times (M,)."""
    if len(times) == 1:
        return np.zeros(len(wanted), dtype=np.intp)
    right = np.clip(np.searchsorted(times, wanted), 1, len(times) - 1)
    return np.asarray(np.where(wanted - times[right - 1] <= times[right] - wanted, right - 1, right), dtype=np.intp)


def used_in_words(used: Sequence[FramesUsed]) -> list[str]:
    """What is said of the sensors' frames: one line for all, and a warning for each sensor of which few are used.

    >>> used_in_words([FramesUsed("a", 60, 60, 0), FramesUsed("b", 60, 12, 40)])[1]
    "warning: only 12 of 60 frames of sensor 'b' were used (40 repeat the image before)"
    """
    lines = ["frames used: " + ", ".join(f"{one.sensor} {one.used} of {one.total}" for one in used)]
    for one in used:
        if one.few:
            why = (
                f" ({one.stale} repeat the image before)"
                if one.stale
                else ": the others' clock leaves them without a pair"
            )
            lines.append(f"warning: only {one.used} of {one.total} frames of sensor {one.sensor!r} were used{why}")
    return lines
