"""The one place that prints: results on standard output, problems on standard error."""

from __future__ import annotations

import sys

from rich.console import Console

_WIDE = 1000
"""Columns where nobody looks: what goes into a file or another program is neither wrapped nor cut."""


def _width() -> int | None:
    """Not by COLUMNS, which shells hand on: it tells of the terminal that the output does not go to."""
    return None if sys.stdout.isatty() else _WIDE


stdout = Console(width=_width())
stderr = Console(stderr=True)


def tell(line: str) -> None:
    """Print a line as it is: brackets are no markup, and it is not wrapped."""
    stdout.print(line, highlight=False, markup=False, soft_wrap=True)
