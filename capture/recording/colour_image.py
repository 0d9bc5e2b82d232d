"""Colour images as a recording keeps them: JPEG and PNG files, checked by their headers, never decoded here.

Sources: ITU-T T.81 (JPEG), annex B, for the markers; the PNG specification (W3C), section 11, for the header.
"""

from __future__ import annotations

import struct
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from capture.errors import RecordingError
from capture.recording.depth_png import LARGEST_PIXELS

_PNG = b"\x89PNG\r\n\x1a\n"
_JPEG = b"\xff\xd8\xff"
_START_OF_FRAME = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}
"""Markers that carry the image's size: all of C0-CF but tables (C4, CC) and the reserved C8."""


def encoded(image: NDArray[np.uint8] | bytes, *, where: Path) -> tuple[str, bytes]:
    """The file suffix and the bytes of an image: pixels (H, W, 3) blue-green-red become PNG, files stay as they are.

    Raises:
        RecordingError: pixels of another shape or type; bytes that are no JPEG or PNG or claim an impossible size.

    >>> suffix, data = encoded(np.zeros((2, 3, 3), dtype=np.uint8), where=Path("colour"))
    >>> suffix, size(data, where=Path("colour"))
    ('.png', (3, 2))
    """
    if isinstance(image, bytes):
        size(image, where=where)
        return (".png" if image.startswith(_PNG) else ".jpg"), image
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3 or not image.size:
        raise RecordingError(
            f"expected (H, W, 3) bytes of colour, got {image.dtype} {image.shape}",
            where=where,
            remedy="give blue, green and red of 8 bits",
        )
    done, data = cv2.imencode(".png", image)
    if not done:
        raise RecordingError(
            "a colour image could not be encoded as PNG", where=where, remedy="give blue, green and red of 8 bits"
        )
    return ".png", data.tobytes()


def size(data: bytes, *, where: Path) -> tuple[int, int]:
    """Width and height (px) that the header of a JPEG or PNG file claims.

    Raises:
        RecordingError: it is neither, has no size, or claims an impossible one.

    >>> size(b"GIF89a", where=Path("a.gif"))
    Traceback (most recent call last):
        ...
    capture.errors.RecordingError: a.gif: holds a colour image that is no whole JPEG or PNG; ...
    """
    claimed = _png_size(data) if data.startswith(_PNG) else _jpeg_size(data) if data.startswith(_JPEG) else None
    if claimed is None:
        raise RecordingError(
            "holds a colour image that is no whole JPEG or PNG", where=where, remedy="record or copy it again"
        )
    width, height = claimed
    if not (width > 0 and height > 0 and width * height <= LARGEST_PIXELS):
        raise RecordingError(
            f"holds a colour image of an impossible size, {width} x {height} px",
            where=where,
            remedy="record or copy it again",
        )
    return width, height


def _png_size(data: bytes) -> tuple[int, int] | None:
    if len(data) < 33 or data[12:16] != b"IHDR":
        return None
    width, height = struct.unpack(">II", data[16:24])
    return int(width), int(height)


def _jpeg_size(data: bytes) -> tuple[int, int] | None:
    at = 2
    while at + 9 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if marker in _START_OF_FRAME:
            height, width = struct.unpack(">HH", data[at + 5 : at + 9])
            return int(width), int(height)
        at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return None
