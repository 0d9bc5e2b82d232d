"""The rows of a 16-bit grey PNG: inflated, and each freed of the filter it was written with.

Image libraries take four fifths of the time that reading a depth image takes: they inflate byte by byte what is mostly
the same. So the stream is inflated by libdeflate, whole and with its checksum, and the filters are undone by one
compiled loop. Source of the filters: the PNG specification (W3C), section 9.
"""

from __future__ import annotations

import zlib

import deflate
import numpy as np
from numpy.typing import NDArray

from capture.compiled import compiled

Bytes = NDArray[np.uint8]
Readings = NDArray[np.uint16]


def rows_of(stream: bytes, *, width: int, height: int) -> Readings | None:
    """The readings (height, width) of an image's compressed stream; None if it does not hold just that.

    >>> rows = bytes([0, 0, 5, 1, 0, 1, 1, 0, 4, 0, 2])  # a plain row of 5 and 256, one that tells differences: 4 and 6
    >>> stream = zlib.compress(rows[:5] + bytes([1]) + rows[7:])
    >>> rows_of(stream, width=2, height=2).tolist()
    [[5, 256], [4, 6]]
    >>> rows_of(stream, width=2, height=3) is None  # there is no third row
    True
    """
    size = height * (1 + 2 * width)
    rows = _inflated(stream, size)
    if rows is None or len(rows) != size:
        return None
    readings = np.zeros((height, width), dtype=np.uint16)
    told = np.frombuffer(rows, dtype=np.uint8).reshape(height, 1 + 2 * width)
    return readings if unfilter(told, readings) else None


def _inflated(stream: bytes, size: int) -> bytes | bytearray | None:
    """What a stream holds, not more than ``size`` bytes of it; None if it is damaged.

    libdeflate refuses what holds more; libpng, and so whoever wrote the file, does not mind.
    """
    try:
        return deflate.zlib_decompress(stream, size)
    except deflate.DeflateError:
        pass
    try:
        return zlib.decompressobj().decompress(stream, size)
    except zlib.error:
        return None


@compiled
def unfilter(told: Bytes, readings: Readings) -> bool:
    """Fills the readings (H, W) from rows (H, 1 + 2 W) of a filter's number and filtered bytes; whether all are known.

    Each byte was written less a prediction from the bytes to its left (a), above (b) and above that (c): nothing, a,
    b, their mean, or whichever of the three is nearest to a + b - c.
    """
    for row in range(told.shape[0]):
        kind = told[row, 0]
        if kind > 4:
            return False
        if kind == 1:  # apart from the others, for nearly every depth camera's program writes nothing else
            high, low = 0, 0
            for column in range(readings.shape[1]):
                high = (high + told[row, 1 + 2 * column]) & 255
                low = (low + told[row, 2 + 2 * column]) & 255
                readings[row, column] = high << 8 | low
            continue
        for column in range(readings.shape[1]):
            before = int(readings[row, column - 1]) if column else 0
            above = int(readings[row - 1, column]) if row else 0
            corner = int(readings[row - 1, column - 1]) if row and column else 0
            high = (told[row, 1 + 2 * column] + _predicted(kind, before >> 8, above >> 8, corner >> 8)) & 255
            low = (told[row, 2 + 2 * column] + _predicted(kind, before & 255, above & 255, corner & 255)) & 255
            readings[row, column] = high << 8 | low
    return True


@compiled
def _predicted(kind: int, a: int, b: int, c: int) -> int:
    if kind == 0:
        return 0
    if kind == 1:
        return a
    if kind == 2:
        return b
    if kind == 3:
        return (a + b) >> 1
    to_a, to_b, to_c = abs(b - c), abs(a - c), abs(a + b - 2 * c)
    if to_a <= to_b and to_a <= to_c:
        return a
    return b if to_b <= to_c else c


@compiled
def metres_of(readings: Readings, unit_m: np.float32, nearest: int, farthest: int, depth: NDArray[np.float32]) -> None:
    """Fills depth (H, W) (m) from readings (H, W) within a range."""
    for row in range(depth.shape[0]):
        for column in range(depth.shape[1]):
            reading = readings[row, column]
            depth[row, column] = np.float32(reading) * unit_m if nearest <= reading <= farthest else np.float32(0.0)
