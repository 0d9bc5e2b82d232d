"""Command: record the cameras that are connected."""

from __future__ import annotations

from pathlib import Path

import click

from capture.commands.box_options import box_options, shown_box
from capture.commands.recording_summary import print_recording
from capture.progress import progress

_PATH = click.Path(path_type=Path)


@click.command("record")
@click.option("--out", required=True, type=_PATH, help="The recording folder to make.")
@click.option(
    "--seconds", type=click.FloatRange(0, min_open=True), required=True, help="How long; Ctrl-C ends it before."
)
@click.option("--sensor", multiple=True, help="A camera's name, once for each [default: sensor, or sensor-1, ...].")
@box_options
@click.option("--overwrite", is_flag=True, help="Replace a recording that stands there already.")
def record_command(
    out: Path,
    seconds: float,
    sensor: tuple[str, ...],
    box: tuple[float, float, float] | None,
    box_seconds: tuple[float, float] | None,
    overwrite: bool,
) -> None:
    """Record the depth of all RealSense cameras that are connected."""
    from capture.live import connected, record

    if box is not None and box_seconds is None:
        raise click.BadParameter("when the box is shown is needed, too", param_hint="--box-seconds")
    shown = shown_box(box, box_seconds)
    devices = connected(out)
    with progress("recording") as work:
        recording = record(
            devices,
            out,
            seconds=seconds,
            sensor_names=sensor,
            box=shown,
            overwrite=overwrite,
            progress=lambda now, written, lost: work.at(now, seconds, f"{written} frames, {lost} lost"),
        )
    print_recording(recording)
