"""The command ``bonetrack batch``."""

from __future__ import annotations

from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

import click

from capture.console import stdout
from capture.progress import progress

if TYPE_CHECKING:
    from collections.abc import Sequence

    from track.batch.work import Row

_PATH = click.Path(path_type=Path)


@click.command("batch")
@click.argument("source", type=_PATH)
@click.option("--out", required=True, type=_PATH, help="The folder of results, one folder for each recording.")
@click.option("--anatomy", default=None, help="Name or file, of each recording that the table states none for.")
@click.option("--workers", type=click.IntRange(1), default=2, show_default=True, help="Processes on this machine.")
@click.option("--scheduler", default=None, metavar="ADDRESS", help="A running Dask scheduler, instead of processes.")
@click.option(
    "--retries", type=click.IntRange(0), default=2, show_default=True, help="New trials of a recording that failed."
)
def batch_command(
    source: Path, out: Path, anatomy: str | None, workers: int, scheduler: str | None, retries: int
) -> None:
    """Adapt and track all recordings of SOURCE: a folder, or a CSV file of them.

    The file's columns are recording, anatomy, and if needed name, subject, region or near, height, mass, sex.
    Recordings of several sensors that were not calibrated are calibrated first. The same command goes on where it was
    stopped, and tries again what failed.
    """
    from track.batch.items import BatchError, read_items
    from track.batch.run_batch import TABLE, run_batch

    items = read_items(source, anatomy=anatomy)
    with progress("batch") as work:
        finished = count(1)

        def told(_: Row) -> None:
            number = next(finished)
            work.at(number, len(items), f"{number} of {len(items)} recordings")

        rows = run_batch(items, out, scheduler=scheduler, workers=workers, retries=retries, progress=told)
    print_rows(rows)
    stdout.print(f"table written to {out / TABLE}", highlight=False)
    if failed := sum(bool(row.error) for row in rows):
        remedy = "mend what the table says, then the same command tries them again"
        raise BatchError(f"{failed} of {len(rows)} recordings failed", where=source, remedy=remedy)


def print_rows(rows: Sequence[Row]) -> None:
    """The table of a batch."""
    from rich.markup import escape
    from rich.table import Table

    table = Table("recording", "frames", "lost", "residual (mm)", "bones hidden (frames)", "frames used", "seconds")
    table.add_column("error or warning")
    for row in rows:
        numbers = [str(row.frames), str(row.lost), _rounded(row.residual_mm, 2)]
        seen = [escape(row.hidden), escape(row.used)]
        table.add_row(escape(row.name), *numbers, *seen, _rounded(row.seconds, 1), escape(row.error or row.warning))
    stdout.print(table)


def _rounded(value: float | None, digits: int) -> str:
    return "" if value is None else f"{value:.{digits}f}"
