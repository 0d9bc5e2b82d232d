"""Times of pieces of work, and the table that shows them."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec

import cv2
import numpy as np
from rich.table import Table

from adapt.anatomy import Floats
from capture.console import stderr


@dataclass(frozen=True)
class Timing:
    """Seconds that each repetition of one stage took (R,), and the processor's part of them (R,).

    The two differ where other programs ran meanwhile, or two threads at once. ``twin`` are the processor's seconds for
    the same work in plain NumPy, ``first_s`` what the first version took.
    """

    stage: str
    seconds: Floats
    processor: Floats
    target_s: float | None = None
    twin: Floats | None = None
    first_s: float | None = None

    @property
    def median_s(self) -> float:
        """The median of the seconds."""
        return float(np.median(self.seconds))


def timed(
    stage: str,
    work: Callable[[], object],
    *,
    repeat: int = 1,
    target_s: float | None = None,
    first_s: float | None = None,
) -> Timing:
    """Run ``work`` so many times and time each run."""
    seconds, processor = [], []
    for _ in range(repeat):
        start, used = time.perf_counter(), time.process_time()
        work()
        seconds.append(time.perf_counter() - start)
        processor.append(time.process_time() - used)
    return Timing(stage, np.array(seconds), np.array(processor), target_s, first_s=first_s)


TIMING_HEADER = ("stage", "median", "range", "processor", "plain NumPy", "first version", "target")


def timing_row(timing: Timing) -> tuple[str, ...]:
    """Median and range of a stage, the processor's median, the twin's and the first version's with ratios, the target.

    A ratio is how many times as long the other took.
    """
    used = float(np.median(timing.processor))
    twin = "" if timing.twin is None else beside(float(np.median(timing.twin)), used)
    first = "" if timing.first_s is None else beside(timing.first_s, timing.median_s)
    target = "" if timing.target_s is None else f"{readable(timing.target_s)}"
    spread = "" if len(timing.seconds) < 2 else f"{readable(timing.seconds.min())} to {readable(timing.seconds.max())}"
    return (timing.stage, readable(timing.median_s), spread, readable(used), twin, first, target)


def readable(seconds: float) -> str:
    """Seconds as people read them.

    >>> readable(0.00123), readable(12.34)
    ('1.2 ms', '12.3 s')
    """
    return f"{1e3 * seconds:.1f} ms" if seconds < 1.0 else f"{seconds:.1f} s"


def beside(other_s: float, ours_s: float) -> str:
    """What another took, and how many times as long as ours that is."""
    return f"{readable(other_s)} ({other_s / ours_s:.1f} x)"


def timing_table(timings: Sequence[Timing], title: str) -> Table:
    """The rows of all stages."""
    table = Table(TIMING_HEADER[0], title=title)
    for name in TIMING_HEADER[1:]:
        table.add_column(name, justify="right", no_wrap=True)
    for timing in timings:
        table.add_row(*timing_row(timing))
    return table


def hold_to_one_thread() -> None:
    """One thread in OpenCV and, if ``threadpoolctl`` is there, in whatever numpy and scipy multiply with."""
    cv2.setNumThreads(1)
    if find_spec("threadpoolctl") is not None:
        import_module("threadpoolctl").threadpool_limits(limits=1)
    elif os.environ.get("OMP_NUM_THREADS") != "1":
        stderr.print("threadpoolctl is not installed: set OMP_NUM_THREADS=1 to measure one thread")
