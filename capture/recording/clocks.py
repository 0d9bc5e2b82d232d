"""What times can and cannot be: rates that sensors have, clocks that begin anew, clocks with a time in common."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import combinations
from pathlib import Path
from statistics import median

import numpy as np

from capture.errors import RecordingError
from capture.rigid import Floats

NOMINAL_PERIOD_S = 1.0 / 30.0
"""Of a sensor of whose rate nothing is known."""
SLOWEST_HZ, FASTEST_HZ = 1.0, 1000.0
"""No depth sensor films people outside of these rates; times in another unit than seconds do."""
_APART_S = 0.04
_TICKS_S = {"microseconds": 1e-6, "milliseconds": 1e-3}
"""What 32-bit clocks of sensors count."""
_MEND = "Mend the column time_s; of stills at unknown times, import with --fps 1"
_STEPS_KNOWN = 2
_LARGEST_STEP = 5.0  # usual periods from the last time before a clock began anew to the first after


class Clock:
    """Follows the times (s) of one sensor's frames; where a 32-bit counter began anew, they go on.

    A time that lies back by the counter's whole range, to within a few frames, can be nothing else; any other time that
    lies back is left as it is.
    """

    def __init__(self) -> None:
        self.restarts: list[str] = []
        self._last: float | None = None
        self._added = 0.0
        self._steps: list[float] = []

    def __call__(self, time_s: float) -> float:
        """The time on a clock that never began anew."""
        now = time_s + self._added
        if self._last is not None and now < self._last:
            now = self._gone_on(now, self._last)
        if self._last is not None and now > self._last:
            self._steps = [*self._steps[-8:], now - self._last]
        self._last = now
        return now

    def _gone_on(self, now: float, last: float) -> float:
        for unit, tick in _TICKS_S.items():
            span = tick * 2.0**32
            if len(self._steps) >= _STEPS_KNOWN and 0.0 < now + span - last <= _LARGEST_STEP * median(self._steps):
                self._added += span
                self.restarts.append(f"the 32-bit clock of {unit} began anew after {last:.3f} s and was gone on with")
                return now + span
        return now


def usual_period(times: Floats) -> float:
    """The usual time (s) between frames at these times (N,).

    >>> round(usual_period(np.array([0.0, 0.1, 0.2, 0.9])), 9)  # a gap does not change what is usual
    0.1
    """
    return float(np.median(np.diff(times))) if len(times) > 1 else NOMINAL_PERIOD_S


def refuse_impossible_rate(name: str, times: Floats, *, where: Path, mend: str = _MEND) -> None:
    """Refuse a sensor whose frames come at a rate that no depth sensor has; ``mend`` is what to do about it.

    Raises:
        RecordingError: the rate is outside ``SLOWEST_HZ`` to ``FASTEST_HZ``; names the likely unit.

    >>> refuse_impossible_rate("left", np.array([0.0, 33.3, 66.7]), where=Path("walk"))
    Traceback (most recent call last):
        ...
    capture.errors.RecordingError: walk: sensor 'left' has 0.03 frames a second, which no sensor has; ...
    """
    if len(times) < 2:
        return
    rate = 1.0 / usual_period(times)
    # A whisper of slack, so that stills a second apart are not decided by rounding.
    if SLOWEST_HZ * (1.0 - 1e-6) <= rate <= FASTEST_HZ * (1.0 + 1e-6):
        return
    unit = _unit_of(rate)
    likely = f"are the times in {unit}, not in seconds?" if unit else "are the times in seconds?"
    raise RecordingError(
        f"sensor {name!r} has {rate:.3g} frames a second, which no sensor has",
        where=where,
        remedy=f"{likely} {mend}",
    )


def _unit_of(rate_hz: float) -> str:
    """The unit in which times of a usual rate would look like this one."""
    units = {"milliseconds": 1e3, "microseconds": 1e6, "nanoseconds": 1e9, "minutes": 1.0 / 60.0}
    return next((name for name, per_s in units.items() if 4.0 <= rate_hz * per_s <= 250.0), "")


def refuse_clocks_apart(times: Mapping[str, Floats], *, where: Path) -> None:
    """Refuse sensors, by name, whose frames (N,) (s) have no time in common: their clocks do not tell the same time.

    Raises:
        RecordingError: two sensors have none; says from when to when each filmed.

    >>> refuse_clocks_apart({"left": np.array([0.0, 5.0]), "right": np.array([90.0, 95.0])}, where=Path("walk"))
    Traceback (most recent call last):
        ...
    capture.errors.RecordingError: walk: the sensors' clocks have no time in common: 'left' 0.00 to 5.00 s and ...
    """
    spans = {name: (float(at[0]), float(at[-1])) for name, at in times.items() if len(at) > 1}
    for one, other in combinations(spans, 2):
        pair = {one: spans[one], other: spans[other]}
        if max(start for start, _ in pair.values()) <= min(end for _, end in pair.values()) + _APART_S:
            continue
        told = " and ".join(f"{name!r} {start:.2f} to {end:.2f} s" for name, (start, end) in pair.items())
        raise RecordingError(
            f"the sensors' clocks have no time in common: {told}",
            where=where,
            remedy="import the sensors' files again with --offset",
        )


def restarts_in_words(name: str, restarts: Iterable[str]) -> list[str]:
    """What is said of a sensor's clock that began anew.

    >>> clock = Clock()
    >>> [round(clock(time_s), 3) for time_s in (4294.90, 4294.93, 4294.96, 0.02)]
    [4294.9, 4294.93, 4294.96, 4294.987]
    >>> restarts_in_words("left", clock.restarts)
    ["sensor 'left': the 32-bit clock of microseconds began anew after 4294.960 s and was gone on with"]
    """
    return [f"sensor {name!r}: {told}" for told in restarts]
