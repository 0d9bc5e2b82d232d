"""Whether the machine is fit: cores, memory, room on the disk, a place for compiled loops, a browser."""

from __future__ import annotations

import os
import shutil
import tempfile
import webbrowser
from pathlib import Path

import psutil

import capture
from track.doctor.finding import Finding

_GIB = 1 << 30

LEAST_MEMORY = 1 * _GIB
"""Free memory that adapting and tracking may take (docs/benchmarks.md: at most 0.6 GiB were seen)."""

LEAST_ROOM = 1 * _GIB
"""On the disk; a minute of two sensors takes some hundred MB."""


def machine(place: Path) -> list[Finding]:
    """What of the machine matters; ``place`` is where results are to be written."""
    return [_cores(), _memory(), _room(place), _compiled(), _browser()]


def _cores() -> Finding:
    may_use = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else range(os.cpu_count() or 1)
    return Finding("ok", f"{len(may_use)} core{'s' if len(may_use) > 1 else ''} to work with")


def _memory() -> Finding:
    memory = psutil.virtual_memory()
    told = f"{memory.available / _GIB:.1f} of {memory.total / _GIB:.1f} GiB of memory free"
    if memory.available < LEAST_MEMORY:
        return Finding("bad", f"{told}, and 1 GiB may be needed", "close other programs, or take another machine")
    return Finding("ok", told)


def _room(place: Path) -> Finding:
    """Whether results can be written to a folder, or to the nearest one above it that is there."""
    home = next(folder for folder in (place.resolve(), *place.resolve().parents) if folder.is_dir())
    try:
        with tempfile.TemporaryFile(dir=home):
            pass
    except OSError as error:
        return Finding("bad", f"{home} cannot be written to ({error.strerror})", "name a folder that can")
    free = shutil.disk_usage(home).free
    told = f"{free / _GIB:.1f} GiB of room at {home}"
    if free < LEAST_ROOM:
        return Finding("bad", f"{told}, and a recording may need more than 1 GiB", "make room, or name another place")
    return Finding("ok", told)


def _compiled() -> Finding:
    """Loops are compiled on the first use, which takes a minute, and kept beside the sources or where numba is told."""
    home = Path(capture.__file__).parent
    if os.environ.get("NUMBA_CACHE_DIR") or os.access(home, os.W_OK):
        return Finding("ok", "compiled loops are kept from one run to the next")
    return Finding(
        "missing",
        f"compiled loops cannot be kept in {home}, so that each run compiles them anew",
        "set NUMBA_CACHE_DIR to a folder of your own",
    )


def _browser() -> Finding:
    try:
        webbrowser.get()
    except webbrowser.Error:
        told = "no browser, or no screen, for what `bonetrack view` shows"
        remedy = "open its address on another machine (--host 0.0.0.0), or write a file with --html"
        return Finding("missing", told, remedy)
    return Finding("ok", "a browser for `bonetrack view`")
