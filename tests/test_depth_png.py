"""Depth images as any program may write them: each filter, several pieces, interlaced, and what is damaged within."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from capture.errors import RecordingError
from capture.recording.depth_png import decode

_HERE = Path("000000.png")


def _filtered(bytes_of_row: np.ndarray, above: np.ndarray, kind: int) -> bytes:
    before, corner = np.r_[0, 0, bytes_of_row[:-2]], np.r_[0, 0, above[:-2]]
    to_a, to_b, to_c = abs(above - corner), abs(before - corner), abs(before + above - 2 * corner)
    nearest = np.where((to_a <= to_b) & (to_a <= to_c), before, np.where(to_b <= to_c, above, corner))
    predicted = [np.zeros_like(above), before, above, (before + above) // 2, nearest][kind]
    return bytes([kind]) + ((bytes_of_row - predicted) & 255).astype(np.uint8).tobytes()


def _rows(readings: np.ndarray, kinds: list[int]) -> bytes:
    rows = readings.astype(">u2").view(np.uint8).reshape(len(readings), -1).astype(np.int64)
    above = np.vstack([np.zeros_like(rows[:1]), rows[:-1]])
    return b"".join(
        _filtered(row, over, kinds[k % len(kinds)]) for k, (row, over) in enumerate(zip(rows, above, strict=True))
    )


def _png(readings: np.ndarray, stream: bytes, *, more: bytes = b"", cut: int = 20) -> bytes:
    def chunk(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    height, width = readings.shape
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 16, 0, 0, 0, 0))
    pieces = chunk(b"IDAT", stream[:cut]) + chunk(b"IDAT", stream[cut:])
    transparent = chunk(b"tRNS", more) if more else b""
    return b"\x89PNG\r\n\x1a\n" + header + transparent + pieces + chunk(b"IEND", b"")


def _noise() -> np.ndarray:
    return np.random.default_rng(3).integers(0, 65536, (17, 23)).astype(np.uint16)


@pytest.mark.parametrize("kinds", [[0], [1], [2], [3], [4], [0, 1, 2, 3, 4], [4, 3, 2, 1, 0]])
def test_rows_of_every_filter_are_read_as_opencv_reads_them(kinds: list[int]) -> None:
    readings = _noise()
    file = _png(readings, zlib.compress(_rows(readings, kinds)))
    np.testing.assert_array_equal(decode(file, width=23, height=17, where=_HERE), readings)
    np.testing.assert_array_equal(cv2.imdecode(np.frombuffer(file, np.uint8), cv2.IMREAD_UNCHANGED), readings)


def test_what_follows_the_rows_is_not_minded() -> None:
    readings = _noise()
    file = _png(readings, zlib.compress(_rows(readings, [1]) + bytes(5)))
    np.testing.assert_array_equal(decode(file, width=23, height=17, where=_HERE), readings)


@pytest.mark.parametrize("kind", ["too few rows", "a filter that there is not", "damaged", "cut off"])
def test_a_stream_that_does_not_hold_the_image_is_refused_though_its_checksum_is_right(kind: str) -> None:
    readings = _noise()
    rows = _rows(readings, [1])
    whole = zlib.compress(rows)
    streams = {
        "too few rows": zlib.compress(rows[:-47]),
        "a filter that there is not": zlib.compress(b"\x05" + rows[1:]),
        "damaged": whole[:200] + bytes([whole[200] ^ 255]) + whole[201:],
        "cut off": whole[:-300],
    }
    with pytest.raises(RecordingError, match="cannot be decoded"):
        decode(_png(readings, streams[kind]), width=23, height=17, where=_HERE)


def test_readings_that_mean_transparent_are_left_to_the_library() -> None:
    readings = _noise()
    file = _png(readings, zlib.compress(_rows(readings, [1])), more=b"\0\5")
    library = cv2.imdecode(np.frombuffer(file, np.uint8), cv2.IMREAD_UNCHANGED)
    if library is not None and library.shape == readings.shape and library.dtype == np.uint16:
        np.testing.assert_array_equal(decode(file, width=23, height=17, where=_HERE), library)
    else:
        with pytest.raises(RecordingError, match="cannot be decoded"):
            decode(file, width=23, height=17, where=_HERE)
