"""Command: find where the sensors stand, or take it as known."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from capture.console import stdout
from capture.progress import progress

if TYPE_CHECKING:
    from capture.recording import Calibration, Recording

_PATH = click.Path(path_type=Path)

extrinsics_option = click.option(
    "--extrinsics",
    type=_PATH,
    default=None,
    help="Where the sensors stand is known: a file (JSON, text or OpenCV YAML) of 4 x 4 matrices (m) called "
    "world_from_NAME or NAME_from_world.",
)


@click.command("calibrate")
@click.argument("recording", type=_PATH)
@extrinsics_option
def calibrate_command(recording: Path, extrinsics: Path | None) -> None:
    """Find where the sensors of RECORDING stand, from its images of the calibration box, or take known matrices."""
    from capture.calibration.calibrate import calibrate_recording, write_calibration
    from capture.recording import open_recording

    opened = open_recording(recording)
    with progress("calibrating"):
        calibration = calibrate_recording(opened) if extrinsics is None else known_by_file(opened, extrinsics)
    write_calibration(opened, calibration)
    print_calibration(calibration)


def known_by_file(recording: Recording, extrinsics: Path) -> Calibration:
    """The calibration that the matrices of a file make, if the sensors' clouds agree with it."""
    from capture.calibration.calibrate import known_calibration
    from capture.calibration.extrinsics import read_extrinsics

    poses = read_extrinsics(extrinsics, [sensor.name for sensor in recording.sensors])
    return known_calibration(recording, poses, where=extrinsics)


def print_calibration(calibration: Calibration) -> None:
    """A table of the sensors: where each stands, how well that fits, and a warning where clouds lie apart."""
    from rich.table import Table

    from capture.calibration.calibrate import DOUBTFUL_APART_M

    table = Table("sensor", "residual (mm)", "clouds apart (mm)", "stands at x, y, z (m)")
    doubtful = []
    for name, sensor in calibration.sensors.items():
        position = "  ".join(f"{x:+.3f}" for x in sensor.world_from_sensor[:3, 3])
        apart, deviation = sensor.details["apart_mm"], sensor.details["apart_deviation_mm"]
        distance = "" if apart is None else f"{apart:.1f} ± {deviation:.1f}"
        residual = "" if sensor.residual_mm is None else f"{sensor.residual_mm:.2f}"
        table.add_row(name, residual, distance, position)
        if apart is not None and apart > 1000.0 * DOUBTFUL_APART_M:
            doubtful.append(name)
    stdout.print(table)
    if doubtful:
        stdout.print(
            f"warning: the clouds of {', '.join(doubtful)} lie apart from those of the sensors before; if the box was "
            "moved between the sensors' images of it, record it again, seen by all at once; if matrices were given, "
            "they are not quite those of this rig",
            highlight=False,
            soft_wrap=True,
        )
