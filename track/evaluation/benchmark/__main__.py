"""The command: ``python -m track.evaluation.benchmark``."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import click
from rich.table import Table

from adapt.subject import load_subject
from capture.console import stdout
from capture.errors import BonetrackError
from track.evaluation.benchmark.adapting import adaptation_timings, automatic_timing
from track.evaluation.benchmark.growth import Curve, growth, slope
from track.evaluation.benchmark.lenses import LENS_HEADER, LENS_ROUNDS, lens_row, lens_timings
from track.evaluation.benchmark.others import Comparison, beside_nonrigid_icp, beside_opensim
from track.evaluation.benchmark.page import Results, write_page
from track.evaluation.benchmark.processes import Process, whole_commands
from track.evaluation.benchmark.stages import (
    frame_timings,
    loop_timing,
    opened,
    prepare,
    simulated_subject,
)
from track.evaluation.benchmark.timing import beside, hold_to_one_thread, readable, timing_table

_PATH = click.Path(path_type=Path)


@click.command()
@click.argument("recording", type=_PATH, default=Path("recordings/upper-limb-right-sample"))
@click.option("--subject", type=_PATH, help="Who moves there; else who was simulated.")
@click.option("--repeat", default=5, show_default=True, type=click.IntRange(min=1), help="How often each stage runs.")
@click.option("--adapt", is_flag=True, help="Also time the whole automatic adaptation, once.")
@click.option("--whole", is_flag=True, help="Everything: other programs, growth, whole commands and their memory, too.")
@click.option("--page", type=_PATH, help="Write what was measured as a page of Markdown.")
def main(recording: Path, subject: Path | None, repeat: int, adapt: bool, whole: bool, page: Path | None) -> None:
    """Time tracking and adaptation on RECORDING and print tables."""
    hold_to_one_thread()
    try:
        with stdout.status("timing") as status:
            results = measure(recording, subject, repeat, adapt or whole, whole, status.update)
        if page is not None:
            write_page(results, page)
    except BonetrackError as error:
        raise click.ClickException(str(error)) from error
    for table in tables(results):
        stdout.print(table)


def measure(
    path: Path, subject: Path | None, repeat: int, automatic: bool, whole: bool, progress: Callable[[str], None]
) -> Results:
    """All that was asked for; what needs an idle machine most comes first.

    Raises:
        BonetrackError: the recording has no truth and no subject was given, or any of the work failed.
    """
    load, recording = os.getloadavg()[0], opened(path)
    who = simulated_subject(recording) if subject is None else load_subject(subject)
    progress("timing a frame")
    bench = prepare(recording, who, repeat=repeat)
    frame, lenses, loop = frame_timings(bench), lens_timings(bench), loop_timing(recording, who)
    progress("timing the adaptation")
    adaptation = adaptation_timings(recording, who, repeat=repeat)
    if automatic:
        progress("timing the automatic adaptation")
        adaptation.append(automatic_timing(recording, who))
    others: list[Comparison | None] = []
    curves: list[Curve] = []
    processes: list[Process] = []
    if whole:
        progress("timing other programs")
        others = [beside_opensim(recording, loop), beside_nonrigid_icp(recording, who)]
        progress("timing more frames, sensors and skin")
        curves = growth(recording, who, loop)
        progress("timing whole commands")
        processes = whole_commands(recording, who.anatomy.name, repeat=repeat)
    compared = [comparison for comparison in others if comparison is not None]
    return Results(path.name, repeat, frame, lenses, loop, adaptation, compared, curves, processes, load)


def tables(results: Results) -> list[Table]:
    """What was measured, for the terminal."""
    timings = [*results.frame, results.loop, *results.adaptation]
    shown = [timing_table(timings, f"{results.name}: median of {results.repeat} (automatic adaptation: once)")]
    lenses = Table(*LENS_HEADER, title=f"lenses with distortion: median of {LENS_ROUNDS}")
    for timing in results.lenses:
        lenses.add_row(*lens_row(timing))
    shown.append(lenses)
    if results.others:
        other = Table("work", "takes", "ours", title="beside other programs")
        for row in results.others:
            other.add_row(row.what, beside(row.theirs_s, row.ours_s), readable(row.ours_s))
        shown.append(other)
    if results.curves:
        grows = Table("by", "time of a frame", "exponent", title="growth")
        for curve in results.curves:
            points = (f"{q}: {readable(s)}" for q, s in zip(curve.quantity, curve.seconds, strict=True))
            grows.add_row(curve.what, ", ".join(points), f"{slope(curve):.2f}")
        shown.append(grows)
    if results.processes:
        commands = Table("command", "takes", "peak memory", title="whole commands")
        for process in results.processes:
            commands.add_row(process.command, readable(process.seconds), f"{process.peak_mib:.0f} MiB")
        shown.append(commands)
    return shown


if __name__ == "__main__":
    main()
