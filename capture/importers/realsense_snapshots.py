"""Snapshots of RealSense's viewer: for each a dump ``NAME_Depth.raw`` and beside it ``NAME_Depth_metadata.csv``.

The table tells when the frame was taken and by which camera; the ``NAME_Depth.png`` that the viewer writes, too, is a
coloured picture. Neither the unit of depth stands there (a millimetre, unless stated) nor the lens's coefficients, of
which depth of D400 cameras ("Brown Conrady") has none.
Source: ``stream_model::snapshot_frame`` and ``frame_metadata_to_csv`` of the SDK's viewer, which write lines of a key
and a value, "Distorsion" so spelled.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from capture.bounded import read_at_most, read_head
from capture.camera import Camera
from capture.errors import RecordingError
from capture.importers.images import source_files
from capture.importers.names import named_times
from capture.importers.source import NO_CLOCK, DepthFrame, Frames, Source, UserCamera, check_size, damaged
from capture.recording import Sensor

_SIDE = "_metadata.csv"
_HEAD = b"Frame Info:"
_LARGEST_TABLE = 2**16
_UNDISTORTED = ("None", "Brown Conrady")
_UNNAMED_CLOCK = "has times by a clock that its files do not name"


@dataclass(frozen=True)
class _Snapshot:
    """A dump, when it was taken (s), its image size and its camera in numbers and by the name of its lens model."""

    file: Path
    time_s: float
    size: tuple[int, int]
    lens: tuple[float, float, float, float]
    model: str


def is_snapshots(folder: Path) -> bool:
    """Whether a folder has dumps with the viewer's tables beside them."""
    return any(_of(table).is_file() and read_head(table, len(_HEAD)) == _HEAD for table in folder.glob(f"*{_SIDE}"))


def open_snapshots(folder: Path, stated: UserCamera) -> Source:
    """The depth snapshots of a folder, in the order of their times, or of their names if a rate is stated.

    Raises:
        RecordingError: a table or a dump is missing or wrong, they are of several cameras, or the lens is not told.
    """
    files = source_files(folder, stated.pattern or "*.raw")
    told = [snapshot for file in files if (snapshot := _snapshot(file)) is not None]
    told.sort(key=lambda snapshot: snapshot.time_s)
    if not told:
        raise RecordingError("has no depth among its snapshots", where=folder, remedy="save one of the depth stream")
    first = told[0]
    for other in told:
        if (other.size, other.lens, other.model) != (first.size, first.lens, first.model):
            raise RecordingError(
                f"is of another camera, or mode, than {first.file.name}",
                where=other.file,
                remedy="name the snapshots of one with --pattern",
            )
    width, height = first.size
    own = None if stated.fx is not None else _camera(first)
    sensor = Sensor(
        "sensor", stated.camera(width, height, own=own, where=folder), stated.unit(None), stated.depth_range_m
    )
    if stated.fps is not None:
        named = named_times([snapshot.file for snapshot in told], stated.fps)
        frames = _frames(zip(named.files, named.times_s, strict=True), first.size)
        return Source(sensor, frames, times=named.words, count=len(told), alone=NO_CLOCK)
    frames = _frames(((snapshot.file, snapshot.time_s) for snapshot in told), first.size)
    return Source(sensor, frames, times="the tables beside the images", count=len(told), alone=_UNNAMED_CLOCK)


def _beside(dump: Path) -> Path:
    """The table of a dump."""
    return dump.with_name(f"{dump.stem}{_SIDE}")


def _of(table: Path) -> Path:
    """The dump of a table."""
    return table.with_name(f"{table.name.removesuffix(_SIDE)}.raw")


def _snapshot(file: Path) -> _Snapshot | None:
    """What the table beside a dump tells; None of a stream that is not depth."""
    table = _beside(file)
    if not table.is_file():
        raise RecordingError(
            f"has no {table.name} beside it, as the others have theirs",
            where=file,
            remedy="copy it there, or leave the dump out with --pattern",
        )
    text = read_at_most(table, _LARGEST_TABLE, remedy="name snapshots that RealSense's viewer wrote").decode(
        "utf-8", errors="replace"
    )
    told = {key.strip(): value.strip() for key, _, value in (line.partition(",") for line in text.splitlines())}
    if not told.get("Type", "").startswith("Depth"):
        return None
    if told.get("Format") != "Z16":
        raise RecordingError(
            f"has depth in the format {told.get('Format', '(none)')}", where=table, remedy="save it as Z16, 16 bits"
        )
    try:
        numbers = [float(told[key]) for key in ("Timestamp (ms)", "Fx", "Fy", "PPx", "PPy")]
        size = int(told["Resolution x"]), int(told["Resolution y"])
    except (KeyError, ValueError) as error:
        raise damaged(table, error) from error
    check_size(*size, where=table)
    time_ms, fx, fy, cx, cy = numbers
    if not all(math.isfinite(number) for number in numbers) or fx <= 0.0 or fy <= 0.0:
        raise damaged(table, "its numbers are those of no camera")
    return _Snapshot(file, 1e-3 * time_ms, size, (fx, fy, cx, cy), told.get("Distorsion", "None"))


def _camera(snapshot: _Snapshot) -> Camera:
    """The camera; refuses a lens whose coefficients would be needed."""
    if snapshot.model not in _UNDISTORTED:
        raise RecordingError(
            f"names a lens model ({snapshot.model}) without its coefficients",
            where=_beside(snapshot.file),
            remedy="state the camera with --fx and --distortion",
        )
    return Camera(*snapshot.size, *snapshot.lens)


def _frames(timed: Iterable[tuple[Path, float]], size: tuple[int, int]) -> Frames:
    width, height = size
    for file, time_s in timed:
        data = read_at_most(file, 2 * width * height, remedy="it must be one image of the size that its table tells")
        if len(data) < 2 * width * height:
            raise damaged(file, f"less than {width} x {height} readings of 16 bits")
        yield DepthFrame(time_s, np.frombuffer(data, "<u2").reshape(height, width).astype(np.uint16))
