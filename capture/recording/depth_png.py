"""16-bit grey PNG images of depth readings, read with more suspicion than image libraries have.

A decoder may return a partly filled image for a truncated or damaged file, and believes whatever size the header
claims. So the header, every chunk's checksum and the end are checked here before anything is decoded.
Source of the layout: the PNG specification (W3C), sections 5 and 11.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from capture.bounded import read_head
from capture.errors import RecordingError
from capture.files import replaced_when_complete

Readings = NDArray[np.uint16]

LARGEST_SIDE = 16384
"""No depth sensor has more rows or columns than this."""

LARGEST_PIXELS = 2**25
"""No sensor has more pixels than this; what claims to is refused before memory is reserved for it."""

_LARGEST_RATIO = 1032
"""Deflate cannot shrink anything further than this (RFC 1951: 258 bytes in 2 bits)."""

_LARGEST_OVERHEAD = 2**20
"""Text and other chunks beside the image take no more bytes than this."""

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_GREY = 0
_DAMAGED = "record or copy it again, or remove it from the list of frames"


def image_size(path: Path) -> tuple[int, int]:
    """Width and height (px) that the header of a 16-bit grey PNG claims, without decoding it.

    Raises:
        RecordingError: missing, not a PNG, not 16-bit grey, or of an impossible size.
    """
    return _claimed_size(read_head(path, 33), path)


def read_readings(path: Path, *, width: int, height: int) -> Readings:
    """The raw readings (height, width) of one image file.

    Raises:
        RecordingError: missing, truncated, damaged, not 16-bit grey, or not of the size asked for.
    """
    claimed = _claimed_size(read_head(path, 33), path)
    if claimed != (width, height):
        raise _other_size(claimed, (width, height), path)
    return decode(read_head(path, _LARGEST_OVERHEAD + 4 * width * height), width=width, height=height, where=path)


def decode(data: bytes, *, width: int, height: int, where: Path) -> Readings:
    """The readings (height, width) of an image in memory; ``where`` names it in errors.

    Raises:
        RecordingError: as ``read_readings``.

    >>> _, file = cv2.imencode(".png", np.array([[0, 1000], [1001, 65535]], dtype=np.uint16))
    >>> decode(file.tobytes(), width=2, height=2, where=Path("000000.png")).tolist()
    [[0, 1000], [1001, 65535]]
    >>> decode(file.tobytes()[:-20], width=2, height=2, where=Path("000000.png"))
    Traceback (most recent call last):
        ...
    capture.errors.RecordingError: 000000.png: is truncated: the image's end is missing; ...
    """
    from capture.recording.png_rows import rows_of  # compiled: imported where work begins

    claimed = _claimed_size(data, where)
    if claimed != (width, height):
        raise _other_size(claimed, (width, height), where)
    stream, plain = _checked_stream(data, where)
    if len(stream) * _LARGEST_RATIO < 2 * width * height:
        raise RecordingError("is damaged (too short for the size it claims)", where=where, remedy=_DAMAGED)
    image = rows_of(stream, width=width, height=height) if plain else _by_library(data)
    if image is None or image.dtype != np.uint16 or image.shape != (height, width):
        raise RecordingError("cannot be decoded as a 16-bit grey PNG", where=where, remedy=_DAMAGED)
    return image


def _by_library(data: bytes) -> Readings | None:
    image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    return None if image is None else np.asarray(image)


def write_readings(path: Path, readings: Readings) -> None:
    """Write readings (H, W) uint16 as a PNG that never stands half-written under its name.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "000000.png")
    ...     write_readings(path, np.array([[0, 1000, 65535]], dtype=np.uint16))
    ...     image_size(path), read_readings(path, width=3, height=1).tolist()
    ((3, 1), [[0, 1000, 65535]])
    """
    done, encoded = cv2.imencode(".png", readings)
    if not done:
        raise RecordingError("could not be encoded as PNG", where=path, remedy="give 16-bit readings")
    with replaced_when_complete(path) as partial:
        partial.write_bytes(encoded.tobytes())


def _other_size(claimed: tuple[int, int], wanted: tuple[int, int], path: Path) -> RecordingError:
    return RecordingError(
        f"is {claimed[0]} x {claimed[1]} px, but the camera has {wanted[0]} x {wanted[1]}",
        where=path,
        remedy="give the camera of this very image size",
    )


def _claimed_size(data: bytes, path: Path) -> tuple[int, int]:
    if not data:
        raise RecordingError("is an empty file", where=path, remedy=_DAMAGED)
    if data[:8] != _SIGNATURE:
        raise RecordingError("is not a PNG file", where=path, remedy="depth frames are 16-bit grey PNG images")
    if len(data) < 33 or data[12:16] != b"IHDR":
        raise RecordingError("is truncated or damaged (its header is not whole)", where=path, remedy=_DAMAGED)
    width, height, bits, colour = struct.unpack(">IIBB", data[16:26])
    if not (0 < width <= LARGEST_SIDE and 0 < height <= LARGEST_SIDE and width * height <= LARGEST_PIXELS):
        raise RecordingError(f"claims an impossible size of {width} x {height} px", where=path, remedy=_DAMAGED)
    if bits != 16 or colour != _GREY:
        kind = "grey" if colour == _GREY else "colour"
        raise RecordingError(
            f"is a {bits}-bit {kind} PNG", where=path, remedy="depth frames are 16-bit PNG images with one grey channel"
        )
    return int(width), int(height)


def _checked_stream(data: bytes, path: Path) -> tuple[bytes, bool]:
    """Walk the chunks (length, type, content, CRC) up to IEND; their image data, and whether that is plain rows.

    Interlaced rows, and readings that mean "transparent", are left to the image library.
    """
    at, stream = len(_SIGNATURE), list[bytes]()
    plain = data[26:29] == bytes(3)
    while True:
        if at + 12 > len(data):
            raise RecordingError("is truncated: the image's end is missing", where=path, remedy=_DAMAGED)
        length = int.from_bytes(data[at : at + 4], "big")
        kind, end = data[at + 4 : at + 8], at + 12 + length
        if end > len(data):
            raise RecordingError("is truncated: the image's end is missing", where=path, remedy=_DAMAGED)
        if zlib.crc32(data[at + 4 : end - 4]) != int.from_bytes(data[end - 4 : end], "big"):
            raise RecordingError("is damaged (a checksum does not match)", where=path, remedy=_DAMAGED)
        if kind == b"IEND":
            return b"".join(stream), plain
        if kind == b"IDAT":
            stream.append(data[at + 8 : end - 4])
        plain = plain and kind != b"tRNS"
        at = end
