"""Folders laid out as two well-known data sets are: TUM's RGB-D benchmark, and Redwood's (Open3D's) scans.

TUM: ``depth.txt`` and ``rgb.txt`` list images with their times; a reading is 1/5000 m; depth lies over colour; the
camera stands on the data set's page, not in the folder, so it is asked for.
Redwood: folders ``depth`` and ``color`` (or ``image``, ``rgb``) of images in the same order; Open3D's JSON of a pinhole
camera beside them, with ``depth_scale`` readings a metre (1000 if it does not say), ``fps`` and ``stream_length_usec``;
the names may carry microseconds (``000012-000000400407.png``).
Sources: the benchmark's page on file formats; Open3D's ``PinholeCameraIntrinsic`` and ``RGBDVideoMetadata``.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

import numpy as np

from capture.bounded import read_at_most
from capture.camera import Camera
from capture.errors import RecordingError
from capture.importers.images import source_files
from capture.importers.names import NamedTimes, named_times
from capture.importers.source import NO_CLOCK, ColourFrame, DepthFrame, Frames, Source, UserCamera
from capture.recording import Colour, Sensor, depth_png
from capture.recording.checked_json import Checked

_TUM_UNIT_M = 1.0 / 5000.0
_CAMERA_FILES = ("intrinsic.json", "camera_intrinsic.json", "intrinsics.json", "camera_primesense.json", "camera.json")
_COLOUR_FOLDERS = ("color", "image", "rgb", "colour")
_LENGTH_AGREES = 0.1
_LARGEST_TEXT = 2**24
_LARGEST_COLOUR = 2**26
_LAYOUT = "name a folder that holds what its layout says"

Timed = list[tuple[Path, float]]


def is_tum(folder: Path) -> bool:
    """Whether a folder lists its depth images as TUM's benchmark does."""
    return (folder / "depth.txt").is_file()


def is_redwood(folder: Path) -> bool:
    """Whether a folder has depth images in a folder of their own."""
    return (folder / "depth").is_dir()


def open_tum(folder: Path, stated: UserCamera) -> Source:
    """A sequence of TUM's RGB-D benchmark, or of a data set in its layout.

    Raises:
        RecordingError: a list or an image is missing or wrong, or no focal length is stated.
    """
    depth = _listed(folder, "depth.txt")
    colour = _listed(folder, "rgb.txt") if (folder / "rgb.txt").is_file() else []
    unit_m = _TUM_UNIT_M if stated.depth_unit_m is None else stated.depth_unit_m
    return _source(folder, stated, depth, colour, own=None, unit_m=unit_m, times="the file")


def open_redwood(folder: Path, stated: UserCamera) -> Source:
    """A scan in Redwood's layout, or one that Open3D's recorder was made to write.

    Raises:
        RecordingError: images are missing or wrong, or there is neither a camera in the folder nor a stated one.
    """
    files = source_files(folder / "depth", stated.pattern or "*.png")
    camera_file = next((folder / name for name in _CAMERA_FILES if (folder / name).is_file()), None)
    told = None if camera_file is None else _json(camera_file)
    own = None if told is None else _pinhole(told)
    scale = 1000.0 if told is None or "depth_scale" not in told.value else told.number("depth_scale", above=0.0)
    if told is not None and not 1.0 <= scale <= 1e6:
        raise told.fail(f"depth_scale is {scale:g}; it must be readings a metre")
    rate = None if told is None or "fps" not in told.value else told.number("fps", above=0.0)
    named = _named(files, stated.fps, rate, "" if camera_file is None else camera_file.name)
    home = next((folder / name for name in _COLOUR_FOLDERS if (folder / name).is_dir()), None)
    pictures = _named([] if home is None else [*home.glob("*.png"), *home.glob("*.jpg")], stated.fps, rate, "")
    depth, colour = (list(zip(each.files, each.times_s, strict=True)) for each in (named, pictures))
    times = named.words if told is None or named.clock else f"{named.words}{_against_length(told, depth)}"
    alone = "" if named.clock else NO_CLOCK
    unit_m = stated.unit(1.0 / scale)
    return _source(folder, stated, depth, colour, own=own, unit_m=unit_m, times=times, alone=alone)


def _named(files: list[Path], fps: float | None, own_fps: float | None, told_by: str) -> NamedTimes:
    """The times of images by their names, else by the stated rate, else by the folder's own."""
    named = named_times(files, fps)
    if named.clock or fps is not None or own_fps is None:
        return named
    return named_times(files, own_fps, told_by=f"as {told_by} tells")


def _against_length(told: Checked, depth: Timed) -> str:
    """What the recording's own length, if Open3D's reader noted one, says of times by a rate; nothing if they agree."""
    length_s = told.number("stream_length_usec") * 1e-6 if "stream_length_usec" in told.value else 0.0
    if length_s <= 0.0 or len(depth) < 2:
        return ""
    made_s = depth[-1][1] - depth[0][1]
    if abs(made_s - length_s) <= _LENGTH_AGREES * length_s:
        return f", and its length of {length_s:.2f} s agrees"
    return (
        f"; warning: the recording was {length_s:.2f} s long and these images make {made_s:.2f} s, so that frames were "
        "lost or left out, and nobody knows when"
    )


def _source(
    folder: Path,
    stated: UserCamera,
    depth: Timed,
    colour: Timed,
    *,
    own: Camera | None,
    unit_m: float,
    times: str,
    alone: str = "",
) -> Source:
    width, height = depth_png.image_size(depth[0][0])
    if own is not None and (own.width, own.height) != (width, height):
        raise RecordingError(
            f"has depth of {width} x {height} px, but its camera has {own.width} x {own.height}",
            where=folder,
            remedy="state the camera of these images with --fx",
        )
    camera = stated.camera(width, height, own=own, where=folder)
    beside = Colour(camera, np.eye(4)) if colour else None  # both layouts lay depth over colour
    sensor = Sensor("sensor", camera, unit_m, stated.depth_range_m, colour=beside)
    return Source(sensor, _frames(depth, colour, camera), times=times, count=len(depth), alone=alone)


def _frames(depth: Timed, colour: Timed, camera: Camera) -> Frames:
    for file, time_s in depth:
        yield DepthFrame(time_s, depth_png.read_readings(file, width=camera.width, height=camera.height))
    for file, time_s in colour:
        yield ColourFrame(time_s, read_at_most(file, _LARGEST_COLOUR, remedy=_LAYOUT))


def _listed(folder: Path, name: str) -> Timed:
    """The images that a list names: lines of a time (s) and a file inside the folder; # begins a comment."""
    try:
        text = read_at_most(folder / name, _LARGEST_TEXT, remedy=_LAYOUT).decode("utf-8")
    except UnicodeDecodeError as error:
        raise RecordingError(
            "is not a list of images (it is not text)", where=folder / name, remedy="each line must be 'time file'"
        ) from error
    listed = [_line(folder, name, number, line) for number, line in _lines(text)]
    if not listed:
        raise RecordingError("lists no images", where=folder / name, remedy="each line must be 'time file'")
    return listed


def _lines(text: str) -> Iterator[tuple[int, str]]:
    for number, line in enumerate(text.splitlines(), start=1):
        if line.strip() and not line.lstrip().startswith("#"):
            yield number, line


def _line(folder: Path, name: str, number: int, line: str) -> tuple[Path, float]:
    parts = line.split()
    try:
        time_s, relative = float(parts[0]), PurePosixPath(parts[1])
    except (ValueError, IndexError):
        time_s, relative = math.nan, PurePosixPath()
    inside = not relative.is_absolute() and ".." not in relative.parts and "\0" not in line
    if len(parts) != 2 or not math.isfinite(time_s) or not inside:
        raise RecordingError(
            f"line {number}: expected a time (s) and a file in this folder",
            where=folder / name,
            remedy="write 'time file'",
        )
    if not (folder / relative).is_file():
        raise RecordingError(
            f"line {number}: image {relative} is missing",
            where=folder / name,
            remedy="copy it there, or take the line out",
        )
    return folder / relative, time_s


def _json(file: Path) -> Checked:
    try:
        value = json.loads(read_at_most(file, _LARGEST_TEXT, remedy=_LAYOUT))
    except (ValueError, RecursionError) as error:
        raise RecordingError(f"is not valid JSON ({error})", where=file, remedy="state the camera with --fx") from error
    if not isinstance(value, dict):
        raise RecordingError("is not a JSON object", where=file, remedy="state the camera with --fx")
    return Checked(value, file)


def _pinhole(told: Checked) -> Camera:
    """Open3D's pinhole camera; the matrix stands column by column."""
    fx, *zeros, cx, cy, one = told.numbers("intrinsic_matrix", count=9)
    fy = zeros.pop(3)
    if fx <= 0.0 or fy <= 0.0 or any(zeros) or one != 1.0:
        raise told.fail("'intrinsic_matrix' is not that of a pinhole camera, column by column")
    width, height = (told.whole(key, low=1, high=depth_png.LARGEST_SIDE) for key in ("width", "height"))
    return Camera(width, height, fx, fy, cx, cy)
