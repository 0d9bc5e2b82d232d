"""The command line of the capture package."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import click

from capture.console import stdout
from capture.errors import RecordingError

if TYPE_CHECKING:
    from capture.importers import ShownBox
    from capture.recording import Calibration, Recording, Region

Command = TypeVar("Command", bound=Callable[..., Any])
T = TypeVar("T")

_PATH = click.Path(path_type=Path)


def region_option(command: Command) -> Command:
    """Add the option ``--region``; ``as_region`` turns its value into a Region."""
    option = click.option(
        "--region",
        nargs=6,
        type=float,
        default=None,
        metavar="X0 Y0 Z0 X1 Y1 Z1",
        help="Use only what is inside this box of the common frame (m), not the recording's or an automatic box.",
    )
    return option(command)


def as_region(values: tuple[float, ...] | None) -> Region | None:
    """The region of six numbers: smallest x, y, z, then largest (m).

    Raises:
        click.BadParameter: a smallest coordinate is not below its largest.
    """
    if values is None:
        return None
    import numpy as np

    from capture.recording import Region

    minimum, maximum = np.array(values[:3]), np.array(values[3:])
    if not (minimum < maximum).all():
        raise click.BadParameter("the first three numbers must be below the last three", param_hint="--region")
    return Region(minimum, maximum)


def near_option(command: Command) -> Command:
    """Add the option ``--near``; ``region_near`` turns it and ``--region`` into a Region."""
    option = click.option(
        "--near",
        nargs=3,
        type=float,
        default=None,
        metavar="X Y Z",
        help="Of several people in view, keep the one nearest to this point of the common frame (m).",
    )
    return option(command)


def region_near(
    recording: Recording, region: tuple[float, ...] | None, near: tuple[float, ...] | None
) -> Region | None:
    """The region that the options ``--region`` and ``--near`` state; None where neither is given.

    Raises:
        click.BadParameter: both are given, a point is not finite, or see ``as_region``.
        CloudError: see ``automatic_region``.
    """
    if near is None:
        return as_region(region)
    if region is not None:
        raise click.BadParameter("give either a region or a point, not both", param_hint="--near")
    if not all(math.isfinite(value) for value in near):
        raise click.BadParameter("needs three finite numbers", param_hint="--near")
    import numpy as np

    from capture.cloud.region import automatic_region

    return automatic_region(recording, near=np.array(near))


def box_options(command: Command) -> Command:
    """Add the options ``--box`` and ``--box-seconds``: which frames show the calibration box."""
    sides = click.option(
        "--box",
        type=click.FloatRange(0, min_open=True),
        nargs=3,
        default=None,
        help="Sides of the calibration box (m).",
    )
    when = click.option(
        "--box-seconds", type=float, nargs=2, default=None, help="From when to when the box, and nobody, is shown (s)."
    )
    return sides(when(command))


def _shown_box(
    sides: tuple[float, float, float] | None, seconds: tuple[float, float] | None, sources: tuple[Path, ...] = ()
) -> ShownBox | None:
    """What the options say of the box.

    Raises:
        click.BadParameter: the box is shown, but its sides are not stated; or the time is none.
    """
    from capture.importers import ShownBox

    if sides is None:
        if seconds is not None or sources:
            raise click.BadParameter("its sides are needed where it is said to be shown", param_hint="--box")
        return None
    return ShownBox(sides, _span(seconds, "--box-seconds"), sources)


def _span(seconds: tuple[float, float] | None, option: str) -> tuple[float, float] | None:
    if seconds is not None and not seconds[0] < seconds[1]:
        raise click.BadParameter("the first must be before the second", param_hint=option)
    return seconds


_extrinsics_option = click.option(
    "--extrinsics",
    type=_PATH,
    default=None,
    help="Where the sensors stand is known: a file (JSON, text or OpenCV YAML) of 4 x 4 matrices (m) called "
    "world_from_NAME or NAME_from_world.",
)

_FORMAT_NAMES = (
    "azure-kinect",
    "realsense-bag",
    "realsense-db3",
    "openni",
    "tum",
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
@_extrinsics_option
@click.option("--overwrite", is_flag=True, help="Replace a recording that stands there already.")
def import_command(
    sources: tuple[Path, ...],
    out: Path,
    format_name: str | None,
    pattern: str | None,
    width: int,
    height: int,
    fx: tuple[float, ...],
    fy: tuple[float, ...],
    cx: tuple[float, ...],
    cy: tuple[float, ...],
    distortion: tuple[str, ...],
    unit_mm: tuple[float, ...],
    fps: float | None,
    depth_range: tuple[float, float],
    kinect_disparity: bool,
    axes: str | None,
    mirrored: bool,
    sensor: tuple[str, ...],
    offset: str,
    box: tuple[float, float, float] | None,
    box_seconds: tuple[float, float] | None,
    box_source: tuple[Path, ...],
    seconds: tuple[float, float] | None,
    extrinsics: Path | None,
    overwrite: bool,
) -> None:
    """Make one recording of each SOURCE, a sensor's file or folder.

    Reads what Azure Kinect (.mkv), RealSense (.bag, .db3) and OpenNI (.oni) record; folders laid out like TUM's and
    Redwood's data sets; point clouds (.pcd, .ply); and depth images that tell nothing of their camera (16-bit PNG and
    PGM, tables of numbers, raw 16-bit little-endian dumps), for which --fx is needed. --seconds and --box-seconds
    count from the first depth frame of the first SOURCE.
    """
    from capture.importers import Stated, import_recording

    if not fx and (fy or cx or cy or distortion):
        raise click.BadParameter("is needed where another part of the camera is stated", param_hint="--fx")
    count = len(sources)
    cameras = zip(
        _for_each(fx, count, "--fx"),
        _for_each(fy, count, "--fy"),
        _for_each(cx, count, "--cx"),
        _for_each(cy, count, "--cy"),
        _for_each(distortion, count, "--distortion"),
        _for_each(unit_mm, count, "--unit-mm"),
        strict=True,
    )
    common = Stated(
        size=(width, height),
        fps=fps,
        pattern=pattern,
        mirrored=mirrored,
        axes=_axes(axes),
        disparity=kinect_disparity,
        depth_range_m=_depth_range(depth_range),
    )
    stated = [
        replace(
            common,
            fx=one_fx,
            fy=one_fy,
            cx=one_cx,
            cy=one_cy,
            distortion=_distortion(one_distortion or ""),
            depth_unit_m=None if one_unit is None else one_unit / 1000.0,
        )
        for one_fx, one_fy, one_cx, one_cy, one_distortion, one_unit in cameras
    ]
    if kinect_disparity and unit_mm:
        raise click.BadParameter("is not a unit of raw disparities; leave it out", param_hint="--unit-mm")
    looks: list[tuple[str, str]] = []
    with stdout.status("importing") as status:
        recording = import_recording(
            sources,
            out,
            stated=stated,
            format_name=format_name,
            sensor_names=sensor,
            offset=_offset(offset),
            box=_shown_box(box, box_seconds, box_source),
            seconds=_span(seconds, "--seconds"),
            overwrite=overwrite,
            progress=lambda name, count, total: status.update(f"{name}: {count}{f' of {total}' if total else ''}"),
            readings=lambda name, words: looks.append((name, words)),
        )
    _print_imported(recording)
    for name, words in looks:
        stdout.print(f"readings of {name}: {words}", highlight=False, soft_wrap=True)
    if extrinsics is not None:
        from capture.calibration.calibrate import write_calibration

        calibration = _known(recording, extrinsics)
        write_calibration(recording, calibration)
        _print_calibration(calibration)


def _for_each(values: tuple[T, ...], count: int, option: str) -> Sequence[T | None]:
    """One value for each of the sources: the only one that was given, or one each, or None."""
    if len(values) > 1 and len(values) != count:
        raise click.BadParameter(f"give it once, or once for each of {count} sources", param_hint=option)
    return values if len(values) > 1 else [values[0] if values else None] * count


def _axes(text: str | None) -> str | None:
    from capture.importers.axes import sensor_from_axes

    if text is not None:
        try:
            sensor_from_axes(text)
        except ValueError as error:
            raise click.BadParameter(str(error), param_hint="--axes") from None
    return text


def _depth_range(values: tuple[float, float]) -> tuple[float, float]:
    if not values[0] < values[1] < math.inf:
        raise click.BadParameter("the first must be nearer than the second", param_hint="--depth-range")
    return values


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


def _distortion(text: str) -> tuple[float, ...]:
    from capture.camera import DISTORTION_LENGTHS

    try:
        values = tuple(float(part) for part in text.split(",") if part.strip())
    except ValueError:
        raise click.BadParameter(f"{text!r} is not a list of numbers", param_hint="--distortion") from None
    if len(values) not in DISTORTION_LENGTHS:
        raise click.BadParameter(f"expected 4, 5, 8, 12 or 14 numbers, got {len(values)}", param_hint="--distortion")
    return values


def _print_imported(recording: Recording) -> None:
    for sensor in recording.sensors:
        camera = sensor.camera
        colour = "" if sensor.colour is None else f", {len(sensor.colour.frames)} colour images"
        box = f", {len(sensor.box_frames)} of the box" if sensor.box_frames else ""
        stdout.print(
            f"{recording.path}: {len(sensor.frames)} frames of {camera.width} x {camera.height} px, "
            f"unit {sensor.depth_unit_m * 1000:g} mm, fx {camera.fx:.1f} px{box}{colour}",
            highlight=False,
            soft_wrap=True,
        )
    stdout.print(recording.created_by, highlight=False, soft_wrap=True)


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
    shown = _shown_box(box, box_seconds)
    devices = connected(out)
    with stdout.status("waiting for frames") as status:
        recording = record(
            devices,
            out,
            seconds=seconds,
            sensor_names=sensor,
            box=shown,
            overwrite=overwrite,
            progress=lambda now, written, lost: status.update(f"{now:.1f} s: {written} frames, {lost} lost"),
        )
    _print_imported(recording)


@click.command("calibrate")
@click.argument("recording", type=_PATH)
@_extrinsics_option
def calibrate_command(recording: Path, extrinsics: Path | None) -> None:
    """Find where the sensors of RECORDING stand, from its images of the calibration box, or take known matrices."""
    from capture.calibration.calibrate import calibrate_recording, write_calibration
    from capture.recording import open_recording

    opened = open_recording(recording)
    with stdout.status("calibrating"):
        calibration = calibrate_recording(opened) if extrinsics is None else _known(opened, extrinsics)
    write_calibration(opened, calibration)
    _print_calibration(calibration)


def _known(recording: Recording, extrinsics: Path) -> Calibration:
    from capture.calibration.calibrate import known_calibration
    from capture.calibration.extrinsics import read_extrinsics

    poses = read_extrinsics(extrinsics, [sensor.name for sensor in recording.sensors])
    return known_calibration(recording, poses, where=extrinsics)


def _print_calibration(calibration: Calibration) -> None:
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


@click.command("fuse")
@click.argument("recording", type=_PATH)
@click.option("--frame", type=click.IntRange(0), required=True, help="Which instant, counted from 0.")
@click.option("--out", type=_PATH, required=True, help="The point cloud to write (.ply).")
@region_option
@near_option
def fuse_command(
    recording: Path, frame: int, out: Path, region: tuple[float, ...] | None, near: tuple[float, ...] | None
) -> None:
    """Write the point cloud of one instant of RECORDING: cleaned, culled, with normals."""
    import numpy as np

    from capture.cloud.fuse import fuse, write_ply
    from capture.recording import instants, open_recording
    from capture.settings import region_used, sensors_in_words

    opened = open_recording(recording)
    every = instants(opened)
    if frame >= len(every):
        raise RecordingError(f"has no frame {frame}", where=recording, remedy=f"its frames are 0 to {len(every) - 1}")
    chosen = region_near(opened, region, near)
    cloud = fuse(opened, every[frame], region=chosen)
    write_ply(cloud, out)
    for line in sensors_in_words(region_used(opened, chosen)):
        stdout.print(line, highlight=False, soft_wrap=True)
    if opened.common_frame_is_sensor:
        stdout.print("not calibrated: coordinates are the sensor's own (x right, y down, z forward)", highlight=False)
    stdout.print(
        f"{out}: {len(cloud.points)} points from {len(cloud.views)} sensor(s) at {every[frame].time_s:.3f} s, "
        f"{cloud.boundary.mean():.0%} on the scan's boundary",
        highlight=False,
        soft_wrap=True,
    )
    sides = " x ".join(f"{side:.2f}" for side in cloud.points.max(axis=0) - cloud.points.min(axis=0))
    stdout.print(f"extent {sides} m", highlight=False, soft_wrap=True)
    for number, view in enumerate(cloud.views):
        apart = cloud.points[cloud.sensor == number] - view.world_from_sensor[:3, 3]
        told = (
            f"{float(np.median(np.linalg.norm(apart, axis=1))):.2f} m away (median)"
            if len(apart)
            else "saw nothing of it"
        )
        stdout.print(f"{view.sensor}: {told}", highlight=False, soft_wrap=True)
