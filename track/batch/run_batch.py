"""Run a batch: Dask hands the items to processes, and again what failed or whose process died.

Nothing but rows travels: recordings and results are files, so all machines must see them under the same paths.
"""

from __future__ import annotations

import csv
import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from capture.own import refuse_foreign, replaced_if_own, table_of
from track.batch.items import BatchError, Item
from track.batch.work import Row, Work, adapt_and_track, finished, run_item

TABLE = "batch.csv"
_COLUMNS = [field.name for field in fields(Row)]
_MARK = table_of(_COLUMNS)


_LOOK_EVERY_S = 10.0
_MEMORY = {f"distributed.worker.memory.{step}": False for step in ("target", "spill", "pause")}
"""Dask would pause a process that holds 80 % of its share, and wait for it to let go; ours holds what it works with."""


def run_batch(
    items: Sequence[Item],
    out: Path,
    *,
    scheduler: str | None = None,
    workers: int = 2,
    retries: int = 2,
    work: Work = adapt_and_track,
    progress: Callable[[Row], None] = lambda row: None,
) -> list[Row]:
    """Work on all items, each in its folder of ``out``, and write the table ``out/batch.csv``.

    Args:
        items: what is to be done; those that are finished are not run again.
        out: the folder of results.
        scheduler: address of a Dask scheduler, instead of ``workers`` processes on this machine.
        workers: how many processes.
        retries: how often an item is tried again after an error that is not the user's, or after its process died. A
            scheduler of one's own counts deaths by its setting ``distributed.scheduler.allowed-failures`` instead.
        work: what is done with each item; its module must be importable by the workers.
        progress: told each row when it is known.

    Returns:
        The rows in the order of the items; those that failed have an error.

    Raises:
        BatchError: Dask is not installed, or no scheduler answers.
        OutputError: something else stands in the table's place.
    """
    out = out.resolve()
    refuse_foreign(out / TABLE, _MARK)
    rows = {item.name: row for item in items if (row := finished(item, out / item.name))}
    for row in rows.values():
        progress(row)
    left = [item for item in items if item.name not in rows]
    if left:
        out.mkdir(parents=True, exist_ok=True)
        with _client(scheduler, min(workers, len(left)), retries) as client:
            for row in _results(client, left, out, work, retries):
                rows[row.name] = row
                progress(row)
    ordered = [rows[item.name] for item in items]
    write_table(out / TABLE, ordered)
    return ordered


def write_table(path: Path, rows: Sequence[Row]) -> None:
    """Write rows as CSV.

    Raises:
        OutputError: something else than such a table stands there.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     write_table(Path(folder, TABLE), [Row("walk", frames=90, lost=2, residual_mm=1.5)])
    ...     Path(folder, TABLE).read_text().splitlines()
    ['name,frames,lost,residual_mm,hidden,used,warning,seconds,error', 'walk,90,2,1.5,,,,,']
    """
    with replaced_if_own(path, _MARK) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, _COLUMNS)
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def _results(client: Any, items: Sequence[Item], out: Path, work: Work, retries: int) -> Iterator[Row]:
    """Rows as they come in.

    Raises:
        BatchError: all processes have stopped taking work.
    """
    from distributed import TimeoutError as NotYet
    from distributed import as_completed

    names = {
        client.submit(run_item, item, out / item.name, work, retries=retries, pure=False): item.name for item in items
    }
    while names:
        try:
            for future in as_completed(list(names), loop=client.loop, timeout=_LOOK_EVERY_S):
                name = names.pop(future)  # forgotten here, so that Dask does not make it anew when a process dies later
                error = future.exception()
                yield future.result() if error is None else Row(name, error=_one_line(error))
        except NotYet:
            _refuse_if_paused(client)


def _refuse_if_paused(client: Any) -> None:
    """Raise BatchError where no process takes work any more, for want of memory: it would be waited for for ever."""
    workers = client.scheduler_info()["workers"].values()
    if workers and all(worker["status"] == "paused" and not _executing(worker) for worker in workers):
        raise BatchError(
            f"all {len(workers)} processes are paused: each holds over 80 % of the memory it may",
            remedy="give each more memory, or use fewer; the same command goes on with what is left",
        )


def _one_line(error: BaseException) -> str:
    from distributed.scheduler import KilledWorker

    if isinstance(error, KilledWorker):
        return "its process died each time; give each process more memory, or use fewer"
    return f"{type(error).__name__}: {error}".partition("\n")[0]


def _executing(worker: Mapping[str, Any]) -> int:
    """How many tasks a process has begun: one that is paused still ends those."""
    metrics = worker.get("metrics", {})
    counts = metrics.get("task_counts", {})
    return int(metrics.get("executing", 0)) + sum(int(counts.get(state, 0)) for state in ("executing", "long-running"))


@contextmanager
def _client(scheduler: str | None, workers: int, retries: int) -> Iterator[Any]:
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise BatchError("Dask is not installed", remedy="pip install 'bonetrack[batch]'") from error
    if scheduler is not None:
        try:
            client = Client(scheduler, timeout="10s", set_as_default=False)
        except (OSError, ValueError) as error:
            raise BatchError("no Dask scheduler answers", where=scheduler, remedy="check its address") from error
        with client:
            yield client
        return
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": retries, **_MEMORY}),
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            scheduler_kwargs={"dashboard": False},
            silence_logs=logging.CRITICAL,
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):
        yield client
