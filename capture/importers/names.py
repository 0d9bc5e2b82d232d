"""What the names of image files tell: their order, and often the time, as a clock or as a count of frames.

A clock is believed if the times that it makes come at a rate that sensors have; a count tells which frames are missing,
and its rate is assumed. Names that tell neither give the order alone.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import reduce
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.importers.source import NOMINAL_FPS
from capture.recording.clocks import FASTEST_HZ, SLOWEST_HZ
from capture.rigid import Floats

_NUMBER = re.compile(r"\d+(?:\.\d+)?")
_WHOLE = re.compile(r"\d+")
_DATE = re.compile(
    r"(20\d\d)[-_.]?(\d\d)[-_.]?(\d\d)[-_T .]?(\d\d)[-_.:h]?(\d\d)[-_.:m]?(\d\d)(?:s?[-_.,](\d{1,9}))?(?!\d)"
)
_REDWOOD = re.compile(r"\d+-(\d{9,})")
"""A count, and microseconds."""

_UNIX_S = (1_000_000_000, 4_102_444_800)
"""From 2001 to 2100, seconds since 1970."""

_UNIX_UNITS = {10: 1.0, 13: 1e-3, 16: 1e-6, 19: 1e-9}
"""How many digits such a time has, and what its last is worth (s)."""

_PERIODS_S = (0.015, 0.21)
"""Between these a sensor's frames mostly are; it tells in which unit a clock counts that began anywhere."""

_FEWEST = 3
_EVEN, _EVENNESS = 0.8, 0.25
"""So many of the steps of a clock are, to within so much, one to three usual ones."""
_A_CLOCKS_STEP = 1000
"""Nobody counts frames in steps as large as this."""


@dataclass(frozen=True)
class NamedTimes:
    """Image files in order with their times (s), where these come from in words, and whether from a clock."""

    files: tuple[Path, ...]
    times_s: tuple[float, ...]
    words: str
    clock: bool


def named_times(files: Iterable[Path], fps: float | None, *, told_by: str = "as stated") -> NamedTimes:
    """Files in order, with the times that their names tell, or else that a rate makes.

    Args:
        files: the images of one sensor.
        fps: a rate (Hz) that somebody states, which goes before the names' clock; None: the names, or 30 Hz.
        told_by: who states it, in words.

    >>> named = named_times([Path(f"depth_{count}.png") for count in (9, 10, 12)], None)
    >>> [round(time_s, 4) for time_s in named.times_s], named.clock
    ([0.0, 0.0333, 0.1], False)
    >>> named.words
    'a nominal rate of 30 Hz (assumed: the names tell no time but count, 9 to 12, 1 missing, whose time is left free)'
    """
    ordered = natural_order(files)
    found = _clock(ordered)
    if found is not None and fps is None:
        times, unit = found
        words = f"the file names ({unit}, {_rate(times):.3g} Hz)" if len(times) > 1 else f"the file names ({unit})"
        return NamedTimes(tuple(ordered), tuple(times.tolist()), words, True)
    rate = fps or NOMINAL_FPS
    number, told = _count(ordered)
    if found is not None:
        told = f"the names have a clock of their own ({found[1]}, {_rate(found[0]):.3g} Hz), which is not used"
    words = f"{rate_in_words(rate)} ({told_by if fps else 'assumed'}: {told})"
    return NamedTimes(tuple(ordered), tuple((number / rate).tolist()), words, False)


def rate_in_words(fps: float) -> str:
    """Where times come from that nobody knows.

    >>> rate_in_words(30.0), rate_in_words(29.97)
    ('a nominal rate of 30 Hz', 'a nominal rate of 29.97 Hz')
    """
    return f"a nominal rate of {fps:g} Hz"


def natural_order(files: Iterable[Path]) -> list[Path]:
    """Files sorted by name, numbers in names by their value: 20.png before 100.png, and 1.25.png before 1.5.png.

    Numbers with a point are decimals, unless what stands behind the point counts up, as in 1.9.png, 1.10.png.

    >>> [file.name for file in natural_order([Path("100.png"), Path("20.png"), Path("3.png")])]
    ['3.png', '20.png', '100.png']
    """
    listed = list(files)
    pattern = _WHOLE if _counts_behind_points(listed) else _NUMBER

    def key(file: Path) -> list[tuple[float, str]]:
        parts: list[tuple[float, str]] = []
        at = 0
        for match in pattern.finditer(file.name):
            parts += [(-1.0, file.name[at : match.start()]), (float(match[0]), match[0])]
            at = match.end()
        return [*parts, (-1.0, file.name[at:])]

    return sorted(listed, key=key)


def _counts_behind_points(files: Sequence[Path]) -> bool:
    """Whether numbers like 1.9, 1.10, 1.11 are two whole numbers: behind each first one the second counts up."""
    behind: dict[tuple[str, int], set[int]] = {}
    widths = set()
    for file in files:
        for match in _NUMBER.finditer(file.name):
            whole, _, part = match[0].partition(".")
            if part:
                if len(part) > 1 and part[0] == "0":
                    return False
                behind.setdefault((whole, match.start()), set()).add(int(part))
                widths.add(len(part))
    runs = [numbers for numbers in behind.values() if len(numbers) > 1]
    return len(widths) > 1 and bool(runs) and all(max(run) - min(run) == len(run) - 1 for run in runs)


def _stem(file: Path) -> str:
    """A name without its suffix, which is no number."""
    return file.name if file.suffix[1:].isdecimal() else file.stem


def _clock(files: Sequence[Path]) -> tuple[Floats, str] | None:
    """Times (N,) (s) of a clock in the names, and which it is; None if there is none."""
    stems = [_stem(file) for file in files]
    if len(stems) < _FEWEST:
        return _redwood(stems)
    columns = _columns(stems)
    clocks = (
        _unix_and_fraction(columns),
        _redwood(stems),
        _dates(stems),
        *map(_unix, columns),
        *map(_any_clock, columns),
    )
    return next((found for found in clocks if found is not None and _possible(found[0])), None)


def _redwood(stems: Sequence[str]) -> tuple[Floats, str] | None:
    matches = _all_match(_REDWOOD.fullmatch(stem) for stem in stems)
    return (np.array([int(match[1]) for match in matches]) * 1e-6, "microseconds") if matches else None


def _all_match(matches: Iterable[re.Match[str] | None]) -> list[re.Match[str]]:
    """The matches, if all are; else none."""
    found = list(matches)
    return [match for match in found if match] if all(found) else []


def _columns(stems: Sequence[str]) -> list[list[str]]:
    """The numbers in names that differ in numbers only, place by place; those that vary."""
    texts = {tuple(_NUMBER.split(stem)) for stem in stems}
    if len(texts) != 1:
        return []
    places = zip(*(_NUMBER.findall(stem) for stem in stems), strict=True)
    return [list(place) for place in places if len(set(place)) > 1]


def _dates(stems: Sequence[str]) -> tuple[Floats, str] | None:
    matches = _all_match(_DATE.search(stem) for stem in stems)
    if not matches:
        return None
    try:
        parts = [[int(part) for part in match.groups()[:6]] for match in matches]
        whole = [datetime(y, mo, d, h, mi, s, tzinfo=UTC).timestamp() for y, mo, d, h, mi, s in parts]
    except ValueError:
        return None
    return np.array(
        [at + float(f"0.{match[7] or 0}") for at, match in zip(whole, matches, strict=True)]
    ), "date and time"


def _unix(column: Sequence[str]) -> tuple[Floats, str] | None:
    digits = {len(text.partition(".")[0]) for text in column}
    unit = _UNIX_UNITS.get(digits.pop()) if len(digits) == 1 else None
    if unit is None:
        return None
    per_s = round(1.0 / unit)
    whole = [int(text.partition(".")[0]) for text in column]
    if not all(_UNIX_S[0] * per_s <= value < _UNIX_S[1] * per_s for value in whole):
        return None
    parts = [float(f"0.{text.partition('.')[2] or 0}") for text in column]
    # Seconds first, for nanoseconds since 1970 have more digits than a float.
    since = [value // per_s + (value % per_s + part) * unit for value, part in zip(whole, parts, strict=True)]
    return np.array(since), "seconds since 1970"


def _unix_and_fraction(columns: Sequence[Sequence[str]]) -> tuple[Floats, str] | None:
    """Whole seconds since 1970 in one place, micro- or nanoseconds in the next."""
    for seconds, fractions in pairwise(columns):
        widths = {len(text) for text in fractions}
        whole = _unix(seconds) if {len(text) for text in seconds} == {10} else None
        if whole is not None and len(widths) == 1 and (widths & {3, 6, 9}):
            return whole[0] + np.array([float(f"0.{text}") for text in fractions]), "seconds since 1970"
    return None


def _any_clock(column: Sequence[str]) -> tuple[Floats, str] | None:
    """A clock that began anywhere: its unit is the one in which its steps are those of a sensor."""
    values = np.array([float(text) for text in column])
    steps = np.diff(values)
    if (steps <= 0.0).any():
        return None
    usual = float(np.median(steps))
    whole = not any("." in text for text in column)
    if whole and _is_count(values) and usual < _A_CLOCKS_STEP:
        return None
    ratios = steps / usual
    even = (np.abs(ratios - np.rint(ratios)) <= _EVENNESS) & (ratios > 0.5) & (ratios < 3.5)
    units = {"milliseconds": 1e-3, "microseconds": 1e-6, "nanoseconds": 1e-9}
    for name, unit in units.items() if whole else {"seconds": 1.0, **units}.items():
        if even.mean() >= _EVEN and _PERIODS_S[0] <= usual * unit <= _PERIODS_S[1]:
            return values * unit, name
    return None


def _possible(times: Floats) -> bool:
    """Whether times increase, at a rate that sensors have."""
    return bool((np.diff(times) > 0.0).all()) and SLOWEST_HZ <= _rate(times) <= FASTEST_HZ


def _rate(times: Floats) -> float:
    return 1.0 / float(np.median(np.diff(times))) if len(times) > 1 else math.nan


def _is_count(values: Floats) -> bool:
    """Whether whole numbers go up by one step, but for some that are missing."""
    steps = np.diff(values).astype(np.int64)
    return bool((steps > 0).all()) and int(np.median(steps)) == reduce(math.gcd, steps.tolist())


def _count(files: Sequence[Path]) -> tuple[NDArray[np.float64], str]:
    """The number (N,) of each frame, from 0, by the names if these count, else by their order; and what they tell."""
    order = np.arange(len(files), dtype=np.float64)
    if len(files) < 2:
        return order, "nothing tells the time"
    for column in reversed(_columns([_stem(file) for file in files])):
        if any("." in text for text in column):
            continue
        values = np.array([int(text) for text in column], dtype=np.float64)
        if not _is_count(values):
            continue
        step = int(np.diff(values).min())
        number = (values - values[0]) / step
        missing = int(number[-1]) + 1 - len(files)
        steps = f" in steps of {step}, one frame each" if step > 1 else ""
        gaps = f", {missing} missing, whose time is left free" if missing else ", none missing"
        return number, f"the names tell no time but count, {column[0]} to {column[-1]}{steps}{gaps}"
    return order, "the names tell no time and do not count, so that each image is taken for the next frame"
