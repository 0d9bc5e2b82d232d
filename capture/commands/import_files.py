"""Command: recordings of other programs, brought into this program's format."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from capture.commands.box_options import box_options, shown_box, time_span
from capture.commands.calibrate import extrinsics_option, known_by_file, print_calibration
from capture.commands.camera_options import CameraOptions
from capture.commands.recording_summary import print_recording
from capture.console import stdout
from capture.progress import progress

if TYPE_CHECKING:
    from capture.importers import ImportOptions

_PATH = click.Path(path_type=Path)

_FORMAT_NAMES = (
    "azure-kinect",
    "realsense-bag",
    "realsense-db3",
    "openni",
    "tum",
    "sensor-folder",
    "redwood",
    "realsense-snapshots",
    "clouds",
    "png",
    "pgm",
    "text",
    "raw",
)


@click.command("import")
@click.argument("sources", type=_PATH, nargs=-1, required=True, metavar="SOURCE...")
@click.option("--out", required=True, type=_PATH, help="The recording folder to make.")
@click.option(
    "--format",
    "format_name",
    type=click.Choice(_FORMAT_NAMES),
    default=None,
    help="What each SOURCE is [default: found out by its content].",
)
@click.option("--pattern", default=None, help="Which files of a folder, such as 'depth-*' [default: *.png, or *].")
@click.option("--width", type=click.IntRange(1, 16384), default=640, show_default=True, help="Columns of a raw image.")
@click.option("--height", type=click.IntRange(1, 16384), default=480, show_default=True, help="Rows of a raw image.")
@click.option(
    "--fx",
    type=click.FloatRange(0, min_open=True),
    multiple=True,
    help="Focal length (px) [default: the file's]. This and the next five: once for all, or once for each SOURCE.",
)
@click.option(
    "--fy", type=click.FloatRange(0, min_open=True), multiple=True, help="The same down the image [default: fx]."
)
@click.option("--cx", type=float, multiple=True, help="Principal point (px) [default: the image's middle].")
@click.option("--cy", type=float, multiple=True, help="Principal point (px) [default: the image's middle].")
@click.option("--distortion", multiple=True, help="OpenCV's coefficients k1,k2,p1,p2[,k3...] [default: none].")
@click.option(
    "--unit-mm",
    type=click.FloatRange(0, min_open=True),
    multiple=True,
    help="One reading's unit (mm) [default: the file's, or 1].",
)
@click.option(
    "--fps",
    type=click.FloatRange(0, min_open=True),
    default=None,
    help="Frame rate (Hz) of images, in place of what their names tell [default: the names' clock, or 30].",
)
@click.option(
    "--depth-range",
    type=click.FloatRange(0),
    nargs=2,
    default=(0.2, 4.0),
    show_default=True,
    metavar="NEAR FAR",
    help="Depth to be trusted (m).",
)
@click.option(
    "--kinect-disparity",
    is_flag=True,
    help="The readings are raw disparities of a Kinect for Xbox 360 (11 bits): convert them.",
)
@click.option(
    "--axes",
    default=None,
    help="Which way the axes of point clouds point, as seen by the sensor, such as x-right,y-up,z-back "
    "[default: as the file tells, or x-right,y-down,z-forward].",
)
@click.option(
    "--mirrored",
    is_flag=True,
    help="The driver mirrored the images (libfreenect2 and OpenNI do): turn them, and the camera, back.",
)
@click.option(
    "--sensor", multiple=True, help="A sensor's name, once for each SOURCE [default: sensor, or sensor-1, ...]."
)
@click.option(
    "--offset",
    default="motion",
    show_default=True,
    help="By how many seconds each SOURCE's first frame comes after that of the one before; 'motion': find it by what "
    "moves; 'clock': they share one clock.",
)
@box_options
@click.option("--box-source", type=_PATH, multiple=True, help="A file of the box alone, once for each SOURCE, instead.")
@click.option(
    "--seconds", type=float, nargs=2, default=None, help="Keep only what is from then to then (s), and the box."
)
@extrinsics_option
@click.option("--overwrite", is_flag=True, help="Replace a recording that stands there already.")
def import_command(
    sources: tuple[Path, ...],
    out: Path,
    extrinsics: Path | None,
    **asked: Any,
) -> None:
    """Make one recording of each SOURCE, a sensor's file or folder.

    Reads what Azure Kinect (.mkv), RealSense (.bag, .db3) and OpenNI (.oni) record; folders laid out like TUM's and
    Redwood's data sets; point clouds (.pcd, .ply); and depth images that tell nothing of their camera (16-bit PNG and
    PGM, tables of numbers, raw 16-bit little-endian dumps), for which --fx is needed. --seconds and --box-seconds
    count from the first depth frame of the first SOURCE.
    """
    from capture.importers import import_recording

    options = _options(len(sources), **asked)
    looks: list[tuple[str, str]] = []
    with progress("importing") as work:
        recording = import_recording(
            sources,
            out,
            options,
            progress=lambda name, count, total: work.at(
                count, total, f"{name}, {count}{f' of {total}' if total else ''} frames"
            ),
            readings=lambda name, words: looks.append((name, words)),
        )
    print_recording(recording)
    for name, words in looks:
        stdout.print(f"readings of {name}: {words}", highlight=False, soft_wrap=True)
    if extrinsics is not None:
        from capture.calibration.calibrate import write_calibration

        calibration = known_by_file(recording, extrinsics)
        write_calibration(recording, calibration)
        print_calibration(calibration)


def _options(
    count: int,
    *,
    format_name: str | None,
    sensor: tuple[str, ...],
    offset: str,
    box: tuple[float, float, float] | None,
    box_seconds: tuple[float, float] | None,
    box_source: tuple[Path, ...],
    seconds: tuple[float, float] | None,
    overwrite: bool,
    **cameras: Any,
) -> ImportOptions:
    """What the options ask of the import of so many sources.

    Raises:
        click.BadParameter: a value cannot be, or options do not go together.
    """
    from capture.importers import ImportOptions

    return ImportOptions(
        cameras=CameraOptions(**cameras).of_sources(count),
        format_name=format_name,
        sensor_names=sensor,
        offset=_offset(offset),
        box=shown_box(box, box_seconds, box_source),
        seconds=time_span(seconds, "--seconds"),
        overwrite=overwrite,
    )


def _offset(text: str) -> Literal["motion", "clock"] | float:
    if text == "motion":
        return "motion"
    if text == "clock":
        return "clock"
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not math.isfinite(seconds):
        raise click.BadParameter(f"{text!r} is not a number of seconds, 'motion' or 'clock'", param_hint="--offset")
    return seconds
