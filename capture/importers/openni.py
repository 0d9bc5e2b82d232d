"""``.oni`` files of OpenNI 1 and 2 (PrimeSense Carmine, Asus Xtion, Kinect for Xbox 360, Orbbec Astra).

No library is needed. A file is a header and a chain of records: streams ("nodes") with their codec, properties of
streams, images. Intrinsics are told as two angles of view; the principal point is then the image's middle as OpenNI's
own conversion takes it, x = (u / width - 1/2) z 2 tan(angle / 2). Images are often mirrored (a right hand looks like a
left one): they are turned back here, and the camera with them.
Sources: ``OniDataRecords.h`` and ``OniRecorder.cpp`` of OpenNI 2 (Apache-2.0), for the layout of the records.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import cv2
import numpy as np
from numpy.typing import NDArray

from capture.camera import Camera
from capture.errors import RecordingError
from capture.importers.mirror import true_picture, unmirrored_camera
from capture.importers.openni_codec import decode, decode_with_table
from capture.importers.source import (
    ColourFrame,
    DepthFrame,
    Frames,
    Source,
    UserCamera,
    check_size,
    damaged,
    no_depth,
    the_only,
)
from capture.recording import Colour, Sensor, colour_image

_HEADER = struct.Struct("<4sBBHIQI")
_RECORD = {True: struct.Struct("<IIIIIQ"), False: struct.Struct("<IIIIII")}
_RECORD_MAGIC = int.from_bytes(b"NIR\0", "little")
_FIRST_LONG_VERSION = (1, 0, 1, 0)
"""From this version on a record's header has an eight-byte link."""

_ADDED = {0x02, 0x0C, 0x0D}
_PROPERTIES = {0x03, 0x04, 0x06}
_DATA, _END = 0x0A, 0x0B
_DEPTH, _COLOUR = 2, 3
_KINDS = {1: "device", 2: "depth", 3: "colour", 5: "infrared"}

_LARGEST_FIELDS = 2**20
_LARGEST_PAYLOAD = 2**27

_UNITS_M = {100: 0.001, 101: 0.0001}
"""Depth formats whose readings are depth; others are disparities of one sensor's own kind."""


@dataclass
class _Node:
    """One stream: its kind, its codec, and the latest of each of its properties."""

    kind: int
    codec: bytes
    properties: dict[str, bytes] = field(default_factory=dict)

    def whole(self, name: str, default: int) -> int:
        value = self.properties.get(name, b"")
        return int.from_bytes(value[:8], "little") if value else default

    @property
    def size(self) -> tuple[int, int]:
        """Width and height (px)."""
        width, height, _ = struct.unpack_from("<III", self.properties["xnMapOutputMode"])
        return width, height

    @property
    def mirrored(self) -> bool:
        return bool(self.whole("xnMirror", 0))


@dataclass(frozen=True)
class _Image:
    """An image record: the stream's number, time (us), the compressed image."""

    node: int
    time_us: int
    payload: bytes


def open_oni(path: Path, stated: UserCamera) -> Source:
    """A recording made with OpenNI.

    Raises:
        RecordingError: no such file; no depth; depth that is not in metric units; cropped; no angles of view and no
            focal length stated; damaged.
    """
    nodes: dict[int, _Node] = {}
    number = _until_depth(path, nodes)
    depth = nodes[number]
    the_only([node for node in nodes.values() if node.kind == _DEPTH], path)
    try:
        width, height = depth.size
        check_size(width, height, where=path)
        camera = _true(depth, stated.camera(width, height, own=_camera(depth), where=path))
        colour_number, colour = next(((n, node) for n, node in nodes.items() if node.kind == _COLOUR), (None, None))
        beside = _colour(colour)
    except (struct.error, KeyError) as error:
        raise damaged(path, "the depth stream does not say how large its images are") from error
    unit = _UNITS_M.get(depth.whole("oniPixelFormat", 100))
    if unit is None:
        raise RecordingError(
            "has raw disparities in place of depth", where=path, remedy="record with a depth format in mm or 0.1 mm"
        )
    if depth.codec not in _DEPTH_CODECS:
        raise RecordingError(
            f"has depth in a codec that is not known ({depth.codec!r})",
            where=path,
            remedy="record it as 16z or without compression",
        )
    sensor = Sensor("sensor", camera, stated.unit(unit), stated.depth_range_m, colour=beside, mirrored=depth.mirrored)
    frames = _frames(path, number, None if beside is None else colour_number)
    return Source(sensor, frames, times="the file (from its own beginning)", alone="begins its times at 0")


def _until_depth(path: Path, nodes: dict[int, _Node]) -> int:
    """Read on to the first depth image, collecting streams and properties; the number of its stream."""
    for image in _images(path, nodes, lambda node: node.kind == _DEPTH):
        return image.node
    kinds = sorted({_KINDS.get(node.kind, f"kind {node.kind}") for node in nodes.values()})
    if any(node.kind == _DEPTH for node in nodes.values()):
        raise RecordingError("has no depth frames", where=path, remedy="record or copy it again")
    raise no_depth(path, f"it has {', '.join(kinds)}" if kinds else "it has no streams")


def _frames(path: Path, depth: int, colour: int | None) -> Frames:
    nodes: dict[int, _Node] = {}
    for image in _images(path, nodes, lambda node: node is nodes.get(depth) or node is nodes.get(colour or -1)):
        node = nodes[image.node]
        try:
            if image.node == depth:
                yield DepthFrame(image.time_us * 1e-6, _readings(node, image.payload))
            else:
                pixels = _pixels(node)
                if pixels is not None:
                    yield ColourFrame(image.time_us * 1e-6, pixels(node, image.payload, path))
        except (ValueError, struct.error, KeyError, cv2.error) as error:
            raise damaged(path, f"the image at {image.time_us * 1e-6:.3f} s: {error}") from error


def _images(path: Path, nodes: dict[int, _Node], wanted: Callable[[_Node], bool]) -> Iterator[_Image]:
    """All images of the wanted streams; ``nodes`` holds what the file has told up to each.

    Raises:
        RecordingError: not such a file, or damaged.
    """
    try:
        with path.open("rb") as file:
            record = _record_layout(file, path)
            while True:
                head = record.unpack(_exactly(file, record.size))
                magic, kind, number, fields_bytes, payload_bytes = head[:5]
                fields_bytes -= record.size
                if magic != _RECORD_MAGIC or not 0 <= fields_bytes <= _LARGEST_FIELDS:
                    raise ValueError("a record does not begin as it should")
                if payload_bytes > _LARGEST_PAYLOAD:
                    raise ValueError(f"a record claims {payload_bytes} bytes")
                if kind == _END:
                    return
                fields = _exactly(file, fields_bytes)
                if kind == _DATA and number in nodes and wanted(nodes[number]):
                    (time_us,) = struct.unpack_from("<Q", fields)
                    yield _Image(number, time_us, _exactly(file, payload_bytes))
                    continue
                file.seek(payload_bytes, 1)
                if kind in _ADDED:
                    _add(nodes, number, fields)
                elif kind in _PROPERTIES and number in nodes:
                    name, at = _text(fields)
                    (length,) = struct.unpack_from("<I", fields, at)
                    nodes[number].properties[name] = fields[at + 4 : at + 4 + length]
    except (ValueError, struct.error) as error:
        raise damaged(path, error) from error
    except OSError as error:
        problem = f"cannot be read ({error.strerror})"
        raise RecordingError(problem, where=path, remedy="check the file and its permissions") from error


def _record_layout(file: BinaryIO, path: Path) -> struct.Struct:
    magic, *version = _HEADER.unpack(_exactly(file, _HEADER.size))[:5]
    if magic != b"NI10":
        raise RecordingError("is not an OpenNI recording", where=path, remedy="name a file recorded with OpenNI")
    return _RECORD[tuple(version) >= _FIRST_LONG_VERSION]


def _exactly(file: BinaryIO, count: int) -> bytes:
    data = file.read(count)
    if len(data) < count:
        raise ValueError("its end is missing")
    return data


def _text(fields: bytes) -> tuple[str, int]:
    """The text at the beginning of a record's fields, and where it ends."""
    (length,) = struct.unpack_from("<I", fields)
    return fields[4 : 4 + length].rstrip(b"\0").decode("ascii"), 4 + length


def _add(nodes: dict[int, _Node], number: int, fields: bytes) -> None:
    _, at = _text(fields)
    kind, codec = struct.unpack_from("<I4s", fields, at)
    nodes[number] = _Node(kind, codec)


def _camera(node: _Node) -> Camera | None:
    """The camera of a stream's images that the angles of view and their size make; None if the file tells none."""
    width, height = node.size
    told = node.properties.get("xnFOV", b"")
    if len(told) != 16:
        return None
    across, down = struct.unpack("<dd", told)
    if not (0.0 < across < math.pi and 0.0 < down < math.pi):
        return None
    return Camera(
        width,
        height,
        fx=width / 2.0 / math.tan(across / 2.0),
        fy=height / 2.0 / math.tan(down / 2.0),
        cx=width / 2.0,
        cy=height / 2.0,
    )


def _true(node: _Node, camera: Camera) -> Camera:
    """The camera of a stream's images once they are turned back."""
    return unmirrored_camera(camera) if node.mirrored else camera


def _colour(node: _Node | None) -> Colour | None:
    """What the file tells of the colour camera; None if its images are not read."""
    if node is None or _pixels(node) is None:
        return None
    camera = _camera(node)
    return Colour(None if camera is None else _true(node, camera))


def _readings(node: _Node, payload: bytes) -> NDArray[np.uint16]:
    width, height = node.size
    cropping = node.properties.get("xnCropping", b"")
    if cropping[:4].strip(b"\0"):
        raise ValueError("it is cropped, record whole images")
    image = _DEPTH_CODECS[node.codec](payload, width * height).reshape(height, width)
    return np.ascontiguousarray(image[:, ::-1]) if node.mirrored else image


def _uncompressed(payload: bytes, count: int) -> NDArray[np.uint16]:
    if len(payload) != 2 * count:
        raise ValueError(f"a depth image has {len(payload)} bytes, not {2 * count}")
    return np.frombuffer(payload, "<u2").astype(np.uint16)


_DEPTH_CODECS: dict[bytes, Callable[[bytes, int], NDArray[np.uint16]]] = {
    b"16zT": decode_with_table,
    b"16zP": decode,
    b"NONE": _uncompressed,
}


def _pixels(node: _Node) -> Callable[[_Node, bytes, Path], NDArray[np.uint8] | bytes] | None:
    """How to read the colour images of a stream; None: not a way that is known, they are left out."""
    if node.codec == b"JPEG":
        return _jpeg
    is_rgb = node.whole("oniPixelFormat", 0) == 200 or node.whole("xnPixelFormat", 0) == 1
    return _rgb if node.codec == b"NONE" and is_rgb else None


def _jpeg(node: _Node, payload: bytes, path: Path) -> NDArray[np.uint8] | bytes:
    if colour_image.size(payload, where=path) != node.size:
        raise ValueError("a colour image is not of the stream's size")
    return true_picture(payload, path) if node.mirrored else payload


def _rgb(node: _Node, payload: bytes, _: Path) -> NDArray[np.uint8]:
    width, height = node.size
    if len(payload) != 3 * width * height:
        raise ValueError(f"a colour image has {len(payload)} bytes, not {3 * width * height}")
    image = np.frombuffer(payload, np.uint8).reshape(height, width, 3)[..., ::-1]
    return np.ascontiguousarray(image[:, ::-1] if node.mirrored else image)
