"""The page ``docs/benchmarks.md``: what was measured, where, and where the rest of the time goes."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from capture.own import page_of, replaced_if_own
from track.evaluation.benchmark.adapting import ADAPTATION_TARGET_S
from track.evaluation.benchmark.growth import Curve, slope
from track.evaluation.benchmark.lenses import LENS_HEADER, LENS_ROUNDS, LENS_TARGET, LensTiming, lens_row
from track.evaluation.benchmark.others import Comparison
from track.evaluation.benchmark.processes import Process
from track.evaluation.benchmark.stages import FIRST, FIRST_DEMO_S, FRAME_TARGET_S
from track.evaluation.benchmark.timing import TIMING_HEADER, Timing, beside, readable, timing_row

LIMIT_S = (0.011, 0.018)
"""What a frame was once estimated to take at least (s): 5 to 10 ms before the pose, 6 to 8 ms for it."""

_MEMORY_TARGET_MIB, _HELP_TARGET_S, _DEMO_TARGET_S = 1024, 0.5, 40.0
_LIBRARIES = ("numpy", "scipy", "numba", "opencv-contrib-python-headless")


@dataclass(frozen=True)
class Results:
    """Everything that was measured; what was not is empty."""

    name: str
    repeat: int
    frame: Sequence[Timing]
    lenses: Sequence[LensTiming]
    loop: Timing
    adaptation: Sequence[Timing]
    others: Sequence[Comparison]
    curves: Sequence[Curve]
    processes: Sequence[Process]
    load: float  # how many other processes wanted a processor when the measurements began


def write_page(results: Results, path: Path) -> None:
    """Write the page.

    Raises:
        OutputError: another page stands there.
    """
    text = page(results)
    with replaced_if_own(path, page_of(text)) as partial:
        partial.write_text(text, encoding="utf-8")


def page(results: Results) -> str:
    """The page as Markdown."""
    parts = [_conditions, _frame, _lenses, _adaptation, _others, _growth, _processes]
    return "\n\n".join(text for part in parts if (text := part(results))) + "\n"


def _conditions(results: Results) -> str:
    libraries = ", ".join(f"{name} {version(name)}" for name in _LIBRARIES)
    machine = f"{_processor()}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}"
    return f"""# How fast

This page is written by a command; its numbers are of one run of

```sh
pip install '.[benchmark]'
python -m track.evaluation.benchmark --whole --repeat {results.repeat} --page docs/benchmarks.md
```

on {machine},
{libraries}; one thread but where it says otherwise. {results.load:.1f} other
processes wanted a processor when it began. Data: `{results.name}`.

Each stage ran {results.repeat} times, caches filled; medians are shown. "Plain NumPy" is the same work without compiled
loops (tests compare the two), timed by the processor. "First version" is
{FIRST}.
In brackets stands how many times as long the other takes: above 1, the present version is faster."""


def _frame(results: Results) -> str:
    loop, low, high = results.loop.median_s, *LIMIT_S
    return f"""## A frame

{_table(TIMING_HEADER, [timing_row(timing) for timing in [*results.frame, results.loop]])}

The target is {readable(FRAME_TARGET_S)}, what sensors of 30 frames a second leave. Before anything was built,
{1e3 * low:.0f} to {1e3 * high:.0f} ms had been estimated as the least that a frame can take: the loop takes
{loop / high:.1f} times the upper end.

{_where_it_goes(results.frame)}"""


def _where_it_goes(frame: Sequence[Timing]) -> str:
    """In words, from the stages' names."""
    whole, read, clean, fuse = (_of(frame, begins) for begins in ("whole", "read:", "read and clean", "fuse"))
    judging = sum(timing.median_s for timing in frame if timing.stage.startswith("judge"))
    shares = {
        "reading the images, which are compressed": read,
        "cleaning them": clean - read,
        "the rest of fusing (the region, spread points, patches with normals)": fuse - clean,
        "following (rounds of posing the skin, finding its points, a step)": _of(frame, "follow"),
        "judging (which bones show, how sure the pose is)": judging,
    }
    told = "".join(f"- {name}: {100 * seconds / whole:.0f} %\n" for name, seconds in shares.items())
    return f"""Where the time of a whole frame on one thread goes:

{told.rstrip()}"""


def _of(frame: Sequence[Timing], begins: str) -> float:
    return next(timing.median_s for timing in frame if timing.stage.startswith(begins))


def _lenses(results: Results) -> str:
    if not results.lenses:
        return ""
    return f"""## A lens with distortion

The frame above, its depth images as lenses with distortion show them: with the 8 coefficients of an Azure Kinect, and
with all 14 of OpenCV's model, the sensor tilted behind the lens. Processor's time, each in turn with the pinhole;
medians of {LENS_ROUNDS} rounds. In brackets stands how many times as long as with the pinhole it takes: at most
{LENS_TARGET} times is the target.

{_table(LENS_HEADER, [lens_row(timing) for timing in results.lenses])}"""


def _adaptation(results: Results) -> str:
    if not results.adaptation:
        return ""
    return f"""## Adaptation

{_table(TIMING_HEADER, [timing_row(timing) for timing in results.adaptation])}

The target of adaptation is {readable(ADAPTATION_TARGET_S)}. "Automatic" finds the first poses and chooses the frames by
itself; it runs once."""


def _others(results: Results) -> str:
    if not results.others:
        return ""
    rows = [
        (
            comparison.what,
            beside(comparison.theirs_s, comparison.ours_s),
            readable(comparison.ours_s),
            "; ".join(f"{name} {a:.1f}, ours {b:.1f} mm" for name, (a, b) in comparison.errors_mm.items()),
        )
        for comparison in results.others
    ]
    return f"""## Beside other programs

The same data in the same run. They answer other questions: OpenSim is told what each marker is called, and the
non-rigid ICP knows of no bones. Ours is the mean of the loop above, and algorithm 4 on the one cloud.

{_table(("work", "takes", "ours takes", "mean error of the skin"), rows)}"""


def _growth(results: Results) -> str:
    if not results.curves:
        return ""
    rows = [
        (
            curve.what,
            ", ".join(f"{q}: {readable(s)}" for q, s in zip(curve.quantity, curve.seconds, strict=True)),
            f"{slope(curve):.2f}",
        )
        for curve in results.curves
    ]
    return f"""## How it grows

Processor's time of a frame. The exponent is that between the ends: 0 does not grow, 1 grows linearly. (A frame's time
that does not grow with the number of frames makes the whole linear in it.)

{_table(("by", "time of a frame", "exponent"), rows)}"""


def _processes(results: Results) -> str:
    if not results.processes:
        return ""
    targets = {
        "--help": readable(_HELP_TARGET_S),
        "demo": f"{readable(_DEMO_TARGET_S)}; first version {FIRST_DEMO_S:.0f} s",
    }
    rows = [
        (f"`bonetrack {p.command}`", readable(p.seconds), targets.get(p.command, ""), f"{p.peak_mib:.0f} MiB")
        for p in results.processes
    ]
    return f"""## Whole commands

Each in a process of its own, from start to end, imports included; `--help` is the median of {results.repeat}. The
target of memory is {_MEMORY_TARGET_MIB} MiB.

{_table(("command", "takes", "target", "peak memory"), rows)}"""


def _table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [header, ["---", *["---:"] * (len(header) - 1)], *rows]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


def _processor() -> str:
    """The processor's name, as well as the system tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    named = next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), "")
    return named or platform.processor() or platform.machine()
