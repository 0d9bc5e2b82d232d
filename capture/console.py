"""The one place that prints: results on standard output, problems on standard error, and both into a log."""

from __future__ import annotations

import sys
from datetime import datetime
from pathlib import Path
from typing import IO, Any

from rich.console import Console, NewLine
from rich.control import Control

_WIDE = 1000
"""Columns where nobody looks: what goes into a file or another program is neither wrapped nor cut."""


class LoggedConsole(Console):
    """A console whose lines also go into a log, where one is kept, whether they are shown or not."""

    kept: Console | None = None

    def print(self, *objects: Any, **options: Any) -> None:
        """Print as ``Console`` does, and into the log."""
        super().print(*objects, **options)
        moves_a_bar = not objects or any(isinstance(thing, Control | NewLine) for thing in objects)
        if self.kept is not None and not moves_a_bar:
            self.kept.print(*objects, **options)


def _width() -> int | None:
    """Not by COLUMNS, which shells hand on: it tells of the terminal that the output does not go to."""
    return None if sys.stdout.isatty() else _WIDE


stdout = LoggedConsole(width=_width())
stderr = LoggedConsole(stderr=True)


def tell(line: str) -> None:
    """Print a line as it is: brackets are no markup, and it is not wrapped."""
    stdout.print(line, highlight=False, markup=False, soft_wrap=True)


def tell_log(line: str) -> None:
    """Add a line to the log alone, where one is kept."""
    if stdout.kept is not None:
        stdout.kept.print(line, highlight=False, markup=False, soft_wrap=True)


def begin_log(path: Path, command: str) -> None:
    """Add all that is printed from now on to a file, with when it was and which command; ``end_log`` closes it.

    Raises:
        OSError: the file cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    file = path.open("a", encoding="utf-8")
    stdout.kept = stderr.kept = Console(file=file, width=_WIDE)
    tell_log(f"{datetime.now():%Y-%m-%d %H:%M:%S} {command}")


def end_log() -> None:
    """Close the log, if one is kept, and show again what was asked not to be shown."""
    file: IO[str] | None = None if stdout.kept is None else stdout.kept.file
    stdout.kept = stderr.kept = None
    stdout.quiet = False
    if file is not None:
        file.close()


def be_quiet() -> None:
    """Show problems alone, until ``end_log``."""
    stdout.quiet = True
