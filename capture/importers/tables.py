"""Depth images as text: portable grey maps (PGM, plain or binary) and tables of numbers, one row a line.

Sources: the Netpbm project's page on the PGM format; tables as spreadsheets and numpy's ``savetxt`` write them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from capture.errors import RecordingError
from capture.importers.images import natural_order, source_files
from capture.importers.source import DEPTH_RANGE_M, NOMINAL_FPS, DepthFrame, Source, Stated, check_size, damaged
from capture.recording import Sensor
from capture.recording.depth_png import LARGEST_PIXELS, refuse_lfs_pointer

_MOST_BYTES_A_PIXEL = 24
_LARGEST_READING = 65535
_FINE_M = 1e-4
"""What a reading is worth of tables that hold fractions."""


def open_tables(source: Path, stated: Stated) -> Source:
    """A text image, or a folder of them.

    Raises:
        RecordingError: there is none, the first is damaged or of impossible size, or no focal length is stated.
    """
    pattern = stated.pattern or next((p for p in ("*.pgm", "*.csv", "*.tsv", "*.txt") if any(source.glob(p))), "*.pgm")
    files = natural_order(source_files(source, pattern))
    first = _values(files[0])
    height, width = first.shape
    camera = stated.camera(width, height, own=None, where=source)
    fps = stated.fps or NOMINAL_FPS
    whole = bool((first == np.rint(first)).all())
    if not whole and stated.depth_unit_m is None:
        raise RecordingError(
            "holds numbers that are no whole readings", where=files[0], remedy="state their unit: --unit-mm 1000 for m"
        )
    unit = stated.unit(None)
    worth = unit if whole else _FINE_M
    sensor = Sensor("sensor", camera, worth, DEPTH_RANGE_M)
    frames = _frames(files, (height, width), unit / worth, fps)
    return Source(sensor, frames, times=f"a nominal rate of {fps:g} Hz", count=len(files))


def _frames(files: Sequence[Path], size: tuple[int, int], steps: float, fps: float) -> Iterator[DepthFrame]:
    for index, file in enumerate(files):
        values = _values(file)
        if values.shape != size:
            raise RecordingError(
                f"is {values.shape[1]} x {values.shape[0]} px, the first image {size[1]} x {size[0]}",
                where=file,
                remedy="import images of different sizes into recordings of their own",
            )
        readings = np.rint(values * steps)
        sound = np.isfinite(readings) & (readings > 0) & (readings <= _LARGEST_READING)
        yield DepthFrame(index / fps, np.where(sound, readings, 0.0).astype(np.uint16))


def _values(file: Path) -> NDArray[np.float64]:
    """The numbers (H, W) of a text image; what is no number is NaN."""
    refuse_lfs_pointer(file)
    try:
        if file.stat().st_size > LARGEST_PIXELS * _MOST_BYTES_A_PIXEL:
            raise RecordingError("is too large for a depth image", where=file, remedy="give one file for each image")
        data = file.read_bytes()
    except OSError as error:
        problem = f"cannot be read ({error.strerror})"
        raise RecordingError(problem, where=file, remedy="check the file and its permissions") from error
    return _grey_map(data, file) if data[:2] in (b"P2", b"P5") else _table(data, file)


def _grey_map(data: bytes, file: Path) -> NDArray[np.float64]:
    words = b" ".join(line.partition(b"#")[0] for line in data[:4096].split(b"\n")).split()
    try:
        width, height = int(words[1]), int(words[2])
    except (IndexError, ValueError) as error:
        raise damaged(file, "its header is no grey map's") from error
    check_size(width, height, where=file)
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None or image.ndim != 2:
        raise damaged(file, "it is no grey map")
    return np.asarray(image, dtype=np.float64)


def _table(data: bytes, file: Path) -> NDArray[np.float64]:
    try:
        lines = [line for line in data.decode("utf-8-sig").splitlines() if line.strip() and line[0] != "#"]
        separator = next((mark for mark in (",", ";", "\t") if mark in lines[0]), None)
        rows = [[float(cell) if cell.strip() else np.nan for cell in line.split(separator)] for line in lines]
        values = np.array(rows, dtype=np.float64)
    except (UnicodeDecodeError, ValueError, IndexError) as error:
        raise RecordingError(
            "is no table of readings, one row of the image a line",
            where=file,
            remedy="name depth images, or state the --format",
        ) from error
    check_size(values.shape[1] if values.ndim == 2 else 0, len(values), where=file)
    return values
