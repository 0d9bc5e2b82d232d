"""Depth images written as text, or in the plainest of image formats: tables of numbers, and PGM.

A table has one row of the image a line, numbers apart by blanks, commas, semicolons or tabs. Whole numbers are
readings; numbers with decimals need a stated unit and are kept in tenths of a millimetre.
Source of PGM (P2 as text, P5 as big-endian bytes): the format's manual page of the Netpbm project.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from capture.bounded import read_at_most
from capture.errors import RecordingError
from capture.importers.images import source_files, source_of
from capture.importers.names import NamedTimes, named_times
from capture.importers.source import (
    LARGEST_READING,
    DepthFrame,
    Source,
    UserCamera,
    check_size,
    damaged,
    fine_unit,
)
from capture.recording import Sensor
from capture.rigid import Floats

Image = TypeVar("Image", Floats, NDArray[np.uint16])

_LARGEST_TEXT = 2**27
_SMALLEST_SIDE = 8
_SEPARATORS = re.compile(rb"[,;]")
_TABLE = re.compile(rb"[\s,;0-9eE+.\-naifNAIF]+")
_PGM_HEADER = re.compile(rb"P([25])\s+(?:#[^\n]*\n\s*)*(\d+)\s+(?:#[^\n]*\n\s*)*(\d+)\s+(?:#[^\n]*\n\s*)*(\d+)\s")


def is_table(head: bytes) -> bool:
    """Whether a file that begins so is a table of numbers.

    >>> is_table(b"0, 812, 813, nan"), is_table(b"x y z"), is_table(b", ,")
    (True, False, False)
    """
    return bool(_TABLE.fullmatch(head)) and any(byte in b"0123456789" for byte in head)


def open_text(source: Path, stated: UserCamera) -> Source:
    """A table of depth, or a folder of them.

    Raises:
        RecordingError: there is none; the first is no table, or of points; no focal length, or no unit, is known.
    """
    named = named_times(source_files(source, stated.pattern or "*"), stated.fps)
    first = _table(named.files[0])
    height, width = first.shape
    camera = stated.camera(width, height, own=None, where=source)
    whole = _is_whole(first)
    unit = stated.unit(None) if whole else fine_unit(stated.depth_range_m[1])
    if not whole and stated.depth_unit_m is None:
        raise RecordingError(
            "has numbers with decimals, which are not millimetres for sure",
            where=named.files[0],
            remedy="state what 1 is worth: --unit-mm 1000 for metres, 1 for millimetres",
        )
    scale = 1.0 if whole else stated.unit(None) / unit
    sensor = Sensor("sensor", camera, unit, stated.depth_range_m)
    return source_of(named, sensor, _tables(named, first.shape, scale))


def open_pgm(source: Path, stated: UserCamera) -> Source:
    """A PGM image, or a folder of them.

    Raises:
        RecordingError: there is none, the first is no PGM image of depth, or no focal length is stated.
    """
    named = named_times(source_files(source, stated.pattern or "*.pgm"), stated.fps)
    height, width = _pgm(named.files[0]).shape
    sensor = Sensor(
        "sensor", stated.camera(width, height, own=None, where=source), stated.unit(None), stated.depth_range_m
    )
    files = zip(named.files, named.times_s, strict=True)
    frames = (DepthFrame(time_s, _sized(_pgm(file), (height, width), file)) for file, time_s in files)
    return source_of(named, sensor, frames)


def _tables(named: NamedTimes, shape: tuple[int, ...], scale: float) -> Iterator[DepthFrame]:
    for file, time_s in zip(named.files, named.times_s, strict=True):
        table = _sized(_table(file), shape, file)
        if scale == 1.0 and not _is_whole(table):
            raise RecordingError(
                "has numbers with decimals, which the first table has not",
                where=file,
                remedy="leave out what comes before it with --pattern, and state --unit-mm",
            )
        readings = np.rint(np.nan_to_num(table, nan=0.0, posinf=0.0, neginf=0.0) * scale)
        kept = np.where((readings > 0) & (readings <= LARGEST_READING), readings, 0)
        yield DepthFrame(time_s, kept.astype(np.uint16))


def _is_whole(table: Floats) -> bool:
    known = table[np.isfinite(table)]
    return bool((known == np.rint(known)).all())


def _sized(image: Image, shape: tuple[int, ...], file: Path) -> Image:
    if image.shape != shape:
        raise RecordingError(
            f"has {image.shape[1]} x {image.shape[0]} px, the first image {shape[1]} x {shape[0]}",
            where=file,
            remedy="name the images of one sensor with --pattern",
        )
    return image


def _table(file: Path) -> Floats:
    """The numbers (H, W) of a table."""
    lines = [line for line in _SEPARATORS.sub(b" ", _content(file)).splitlines() if line.strip()]
    width = len(lines[0].split()) if lines else 0
    check_size(width, len(lines), where=file)
    if min(width, len(lines)) < _SMALLEST_SIDE:
        raise RecordingError(
            f"is a table of {width} x {len(lines)} numbers, no image",
            where=file,
            remedy="points, one a line, come in as .ply or .pcd; images as one row of pixels a line",
        )
    try:
        return np.array([line.split() for line in lines]).astype(np.float64)
    except ValueError as error:
        raise damaged(file, f"as a table of numbers: {error}") from error


def _pgm(file: Path) -> NDArray[np.uint16]:
    """The readings (H, W) of a PGM image."""
    data = _content(file)
    header = _PGM_HEADER.match(data)
    if header is None:
        raise damaged(file, "it does not begin as a PGM image does")
    kind, width, height, largest = (int(part) for part in header.groups())
    check_size(width, height, where=file)
    if not 255 < largest <= LARGEST_READING:
        raise RecordingError(
            f"has values up to {largest}, which is a picture, not depth", where=file, remedy="name 16-bit images"
        )
    body = data[header.end() :]
    count = width * height
    if kind == 5:
        if len(body) < 2 * count:
            raise damaged(file, "its end is missing")
        return np.frombuffer(body, ">u2", count).reshape(height, width).astype(np.uint16)
    words = body.split(None, count)[:count]
    try:
        values = np.array(words).astype(np.int64)
    except ValueError as error:
        raise damaged(file, error) from error
    if len(values) < count or values.min() < 0 or values.max() > largest:
        raise damaged(file, "its end is missing, or its values are not what its header says")
    return values.reshape(height, width).astype(np.uint16)


def _content(file: Path) -> bytes:
    return read_at_most(file, _LARGEST_TEXT, remedy="write one image into each file")
