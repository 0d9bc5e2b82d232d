"""The one place that prints: results on standard output, problems on standard error."""

from __future__ import annotations

import os
import sys

from rich.console import Console

_WIDE = 1000
"""Columns where nobody looks: what goes into a file or another program is neither wrapped nor cut."""


def _width() -> int | None:
    return None if sys.stdout.isatty() or "COLUMNS" in os.environ else _WIDE


stdout = Console(width=_width())
stderr = Console(stderr=True)
