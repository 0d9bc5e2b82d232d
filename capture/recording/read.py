"""Opening a recording folder: everything that is cheap to check is checked here, once."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable
from pathlib import Path, PurePosixPath
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from capture.camera import DISTORTION_LENGTHS, Camera
from capture.errors import RecordingError
from capture.recording import depth_png
from capture.recording.checked_json import Checked, read_json
from capture.recording.clocks import Clock, restarts_in_words
from capture.recording.types import (
    BOX_FRAMES_FILE,
    CALIBRATION_FILE,
    CALIBRATION_FORMAT,
    COLOUR_FRAMES_FILE,
    FORMAT,
    FRAMES_FILE,
    HEADER_FILE,
    UNFINISHED_FILE,
    VERSION,
    Calibration,
    Colour,
    FrameFile,
    Recording,
    Region,
    Sensor,
    SensorCalibration,
)

T = TypeVar("T")

_SENSOR_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")
_RIGID_TOLERANCE = 1e-4


def open_recording(path: Path | str) -> Recording:
    """Read and check a recording folder; depth images are only checked to exist.

    Raises:
        RecordingError: not a recording, written by a newer version, or anything in it missing or invalid.

    >>> from tempfile import TemporaryDirectory
    >>> from capture.recording import RecordingWriter, Sensor
    >>> sensor = Sensor("left", Camera(4, 3, 5.0, 5.0, 2.0, 1.5))
    >>> with TemporaryDirectory() as folder:
    ...     with RecordingWriter(folder, sensors=[sensor], created_by="my own program") as writer:
    ...         writer.add_frame("left", np.full((3, 4), 1.5), 0.0)  # metres
    ...     [(sensor.name, len(sensor.frames)) for sensor in open_recording(folder).sensors]
    [('left', 1)]
    """
    path = Path(path)
    header_file = path / HEADER_FILE
    if not header_file.is_file():
        raise _no_header(path)
    header = read_json(header_file, format_name=FORMAT, newest_version=VERSION)
    mended: list[str] = []
    sensors = tuple(_sensor(entry, path, mended) for entry in header.objects("sensors"))
    names = [sensor.name for sensor in sensors]
    if len(set(names)) < len(names):
        raise header.fail(f"two sensors have the same name ({', '.join(names)})")
    if not any(sensor.frames or sensor.box_frames for sensor in sensors):
        raise RecordingError("has no frames", where=path, remedy=f"list depth images in <sensor>/{FRAMES_FILE}")
    return Recording(
        path=path,
        sensors=sensors,
        box_size_m=_optional(header, "box", _box_size),
        region=_optional(header, "region", _region),
        calibration=read_calibration(path / CALIBRATION_FILE, names),
        created_by=str(header.value.get("created_by", "")),
        mended=tuple(mended),
    )


def read_depth(sensor: Sensor, frame: FrameFile) -> NDArray[np.float32]:
    """Depth image (H, W) in metres; 0 where there is no reading, or one outside the sensor's range.

    Raises:
        RecordingError: the image is missing, truncated, damaged, not 16-bit grey, or not of the camera's size.

    >>> from tempfile import TemporaryDirectory
    >>> from capture.recording import FrameFile, Sensor
    >>> sensor = Sensor("left", Camera(3, 1, 5.0, 5.0, 1.0, 0.0), depth_unit_m=0.001, depth_range_m=(0.4, 4.0))
    >>> with TemporaryDirectory() as folder:
    ...     frame = FrameFile(Path(folder, "000000.png"), 0.0)
    ...     depth_png.write_readings(frame.path, np.array([[200, 1500, 4500]], dtype=np.uint16))
    ...     read_depth(sensor, frame).astype(float).round(6).tolist()
    [[0.0, 1.5, 0.0]]
    """
    from capture.recording.png_rows import metres_of  # compiled: imported where work begins

    camera = sensor.camera
    readings = depth_png.read_readings(frame.path, width=camera.width, height=camera.height)
    nearest, farthest = np.array(sensor.depth_range_m) / sensor.depth_unit_m
    depth = np.zeros(readings.shape, dtype=np.float32)
    metres_of(readings, np.float32(sensor.depth_unit_m), round(nearest), round(farthest), depth)
    return depth


def read_calibration(file: Path, sensor_names: list[str]) -> Calibration | None:
    """The calibration that stands in a file, or None if there is no such file.

    Raises:
        RecordingError: invalid, or it speaks of sensors that the recording does not have.
    """
    if not file.is_file():
        return None
    checked = read_json(file, format_name=CALIBRATION_FORMAT, newest_version=VERSION)
    sensors = {}
    for name, entry in checked.object("sensors").items():
        if name not in sensor_names:
            raise checked.fail(f"calibrates sensor {name!r}, which the recording does not have")
        details = {key: entry.value[key] for key in entry.value if key not in {"world_from_sensor", "residual_mm"}}
        residual = None if entry.value.get("residual_mm") is None else entry.number("residual_mm")
        sensors[name] = SensorCalibration(_rigid(entry, "world_from_sensor"), residual, details)
    return Calibration(sensors)


def _no_header(path: Path) -> RecordingError:
    if not path.exists():
        return RecordingError("does not exist", where=path, remedy="name the folder of a recording")
    if not path.is_dir():
        return RecordingError(
            "is not a recording folder", where=path, remedy="bring other formats in with `bonetrack import`"
        )
    if (path / UNFINISHED_FILE).is_file():
        return RecordingError("writing this recording never finished", where=path, remedy="make it again")
    return RecordingError(
        f"is not a recording folder (it has no {HEADER_FILE})",
        where=path,
        remedy="bring other formats in with `bonetrack import`",
    )


def _optional(header: Checked, key: str, read: Callable[[Checked], T]) -> T | None:
    return None if header.value.get(key) is None else read(header.object(key))


def _box_size(box: Checked) -> tuple[float, float, float]:
    a, b, c = box.numbers("size_m", count=3, above=0.0)
    return a, b, c


def _region(region: Checked) -> Region:
    minimum, maximum = (np.array(region.numbers(key, count=3)) for key in ("min", "max"))
    if (minimum >= maximum).any():
        raise region.fail("the region's min must be smaller than its max in each coordinate")
    return Region(minimum, maximum)


def _sensor(entry: Checked, folder: Path, mended: list[str]) -> Sensor:
    """A sensor and its frames; what was wrong with its times and could be mended is added to ``mended``."""
    name = entry.text("name")
    if not _SENSOR_NAME.fullmatch(name):
        raise entry.fail(f"sensor name {name!r} must be letters, digits, '-' and '_' only")
    nearest, farthest = entry.numbers("depth_range_m", count=2)
    if not 0.0 <= nearest < farthest:
        raise entry.fail(f"sensor {name!r}: depth_range_m must be [near, far] with 0 <= near < far")
    home = folder / name
    if not (home / FRAMES_FILE).is_file():
        raise RecordingError(
            f"sensor {name!r} has no list of frames",
            where=home / FRAMES_FILE,
            remedy="list its depth images there, or take the sensor out of recording.json",
        )
    box_list = home / BOX_FRAMES_FILE
    clock = Clock()
    frames = read_frame_list(home / FRAMES_FILE, clock)
    mended += restarts_in_words(name, clock.restarts)
    return Sensor(
        name=name,
        camera=_camera(entry.object("camera")),
        depth_unit_m=entry.number("depth_unit_m", above=0.0),
        depth_range_m=(nearest, farthest),
        frames=frames,
        box_frames=read_frame_list(box_list) if box_list.is_file() else (),
        colour=None if entry.value.get("colour") is None else _colour(entry.object("colour"), home),
        mirrored="mirrored" in entry.value and entry.flag("mirrored"),
    )


def _colour(entry: Checked, home: Path) -> Colour:
    list_file = home / COLOUR_FRAMES_FILE
    return Colour(
        camera=_optional(entry, "camera", _camera),
        colour_from_depth=None if entry.value.get("colour_from_depth") is None else _rigid(entry, "colour_from_depth"),
        frames=read_frame_list(list_file) if list_file.is_file() else (),
    )


def _camera(entry: Checked) -> Camera:
    distortion = entry.numbers("distortion") if "distortion" in entry.value else ()
    if len(distortion) not in DISTORTION_LENGTHS:
        raise entry.fail(f"'{entry.keys}.distortion' must have {DISTORTION_LENGTHS} numbers, got {len(distortion)}")
    return Camera(
        width=entry.whole("width", low=1, high=depth_png.LARGEST_SIDE),
        height=entry.whole("height", low=1, high=depth_png.LARGEST_SIDE),
        fx=entry.number("fx", above=0.0),
        fy=entry.number("fy", above=0.0),
        cx=entry.number("cx"),
        cy=entry.number("cy"),
        distortion=distortion,
    )


def _rigid(entry: Checked, key: str) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    rows = entry.get(key)
    if not isinstance(rows, list) or len(rows) != 4:
        raise entry.fail(f"'{entry.keys}.{key}' must have 4 rows of 4 numbers")
    checked_rows = [Checked({f"{key}[{i}]": row}, entry.file, entry.keys) for i, row in enumerate(rows)]
    matrix = np.array([row.numbers(f"{key}[{i}]", count=4) for i, row in enumerate(checked_rows)])
    rotation = matrix[:3, :3]
    orthonormal = np.abs(rotation @ rotation.T - np.eye(3)).max() < _RIGID_TOLERANCE
    if not orthonormal or np.linalg.det(rotation) < 0.0 or np.abs(matrix[3] - (0, 0, 0, 1)).max() > 1e-9:
        raise entry.fail(f"'{entry.keys}.{key}' is not a rigid transform (rotation and translation)")
    return matrix


def read_frame_list(list_file: Path, clock: Clock | None = None) -> tuple[FrameFile, ...]:
    """The frames that a list names: columns file, time_s; times strictly increasing on the clock; files there.

    Raises:
        RecordingError: it is not such a list.
    """
    clock = Clock() if clock is None else clock
    try:
        with list_file.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.reader(file))
    except (OSError, ValueError, csv.Error) as error:
        raise RecordingError(
            f"cannot be read as a list of frames ({error})",
            where=list_file,
            remedy="check the file and its permissions",
        ) from error
    if not rows or [cell.strip() for cell in rows[0]] != ["file", "time_s"]:
        raise RecordingError("the first line must be 'file,time_s'", where=list_file, remedy="write it so")
    frames: list[FrameFile] = []
    for line, row in enumerate(rows[1:], start=2):
        if not row:
            continue
        frame = _frame(row, list_file, line)
        frame = FrameFile(frame.path, clock(frame.time_s))
        if frames:
            _refuse_before(frames[-1], frame, list_file, line)
        frames.append(frame)
    return tuple(frames)


def _refuse_before(last: FrameFile, frame: FrameFile, list_file: Path, line: int) -> None:
    """Raise RecordingError for a frame that does not come after the last."""
    if frame.time_s > last.time_s:
        return
    if frame.time_s == last.time_s:
        raise RecordingError(
            f"line {line}: the time {frame.time_s:g} s stands twice, for {last.path.name} and {frame.path.name}",
            where=list_file,
            remedy="state when each was taken, or take one of the two lines out",
        )
    raise RecordingError(
        f"line {line}: time {frame.time_s:g} s does not come after {last.time_s:g} s",
        where=list_file,
        remedy="list the images in the order in which they were taken, with their true times",
    )


def _frame(row: list[str], list_file: Path, line: int) -> FrameFile:
    if len(row) != 2:
        raise RecordingError(
            f"line {line}: expected 'file,time_s', got {','.join(row)!r}", where=list_file, remedy="write it so"
        )
    name = row[0].strip()
    relative = PurePosixPath(name)
    if not name or relative.is_absolute() or ".." in relative.parts or "\\" in name or ":" in name or "\0" in name:
        raise RecordingError(
            f"line {line}: {name!r} is not a file inside the sensor's folder", where=list_file, remedy="use plain names"
        )
    try:
        time_s = float(row[1])
    except ValueError:
        time_s = math.nan
    if not math.isfinite(time_s):
        raise RecordingError(
            f"line {line}: time {row[1]!r} is not a finite number of seconds",
            where=list_file,
            remedy="write it in digits",
        )
    path = list_file.parent / relative
    if not path.is_file():
        raise RecordingError(f"line {line}: depth image {name!r} is missing", where=list_file, remedy="copy it there")
    return FrameFile(path, time_s)
