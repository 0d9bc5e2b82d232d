"""How far long work has come: a moving bar on a terminal; in a file or a pipe a line every few seconds.

A line says what is done, which share of it is done and how long the rest takes, as far as that is known.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from capture.console import stdout, tell, tell_log

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

EVERY_S = 5.0
"""Between two lines."""


class Work:
    """Work that is going on; whoever does it says how far it has come."""

    def __init__(self, step: str, shown: Progress, task: TaskID) -> None:
        self._step, self._shown, self._task = step, shown, task
        self._note = ""
        self._since: tuple[float, float] | None = None  # when, and how much was done then
        self._done = 0.0

    def at(self, done: float, total: float | None = None, note: str = "") -> None:
        """So much is ``done`` of a ``total`` (None: nobody knows), in any unit; the ``note`` says what that is."""
        self._note = note
        if self._since is None or done < self._done:  # what an earlier run did tells nothing of how fast this one is
            self._since = time.monotonic(), done
        self._done = done
        words = f"{self._step}: {note}" if note else self._step
        self._shown.update(self._task, completed=done, total=total, description=words)

    def in_words(self) -> str:
        """The line of now."""
        task = self._shown.tasks[self._task]
        parts = [f"{self._step}: {self._note}" if self._note else self._step]
        if task.total:
            parts.append(f"{task.percentage:.0f} % done")
        left = self._left_s(task.total)
        if left is not None:
            parts.append(f"about {in_words(left)} left")
        else:
            parts.append(f"{in_words(task.elapsed or 0.0)} so far")
        return ", ".join(parts)

    def _left_s(self, total: float | None) -> float | None:
        """How long the rest takes (s) if it goes on as it did; the longer nothing is done, the longer."""
        if not total or self._since is None or self._done <= self._since[1]:
            return None
        when, begin = self._since
        return (time.monotonic() - when) * (total - self._done) / (self._done - begin)


@contextmanager
def progress(step: str) -> Iterator[Work]:
    """Show how far the work of the block has come; the ``step`` is what it is called.

    Where a bar shows it, a log has the lines all the same.
    """
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeRemainingColumn

    on_terminal = stdout.is_terminal and not stdout.quiet
    shown = Progress(
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=30),
        TimeRemainingColumn(compact=True, elapsed_when_finished=True),
        console=stdout,
        transient=True,
        disable=not on_terminal,
    )
    work = Work(step, shown, shown.add_task(step, total=None))
    ended = threading.Event()
    told = tell_log if on_terminal else tell
    teller = threading.Thread(target=_tell_now_and_then, args=(work, ended, told), daemon=True)
    with shown:
        teller.start()
        try:
            yield work
        finally:
            ended.set()
            teller.join()


def _tell_now_and_then(work: Work, ended: threading.Event, told: Callable[[str], None]) -> None:
    while not ended.wait(EVERY_S):
        told(work.in_words())


def in_words(seconds: float) -> str:
    """A time as people say it.

    >>> in_words(4.2), in_words(192.0), in_words(7320.0)
    ('4 s', '3 min 12 s', '2 h 2 min')
    """
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    return f"{whole // 60} min {whole % 60} s" if whole < 3600 else f"{whole // 3600} h {whole % 3600 // 60} min"
