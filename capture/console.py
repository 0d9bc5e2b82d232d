"""The one place that prints: results on standard output, problems on standard error."""

from __future__ import annotations

from rich.console import Console

stdout = Console()
stderr = Console(stderr=True)
