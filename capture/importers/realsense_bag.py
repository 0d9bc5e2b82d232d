"""RealSense ``.bag`` files, as SDK 2.55 writes them: version 2.0 bags of ROS 1, read with PyPI ``rosbags``.

Source of the topics: files that the SDK's recorder wrote. An image's header carries the frame's own time.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.errors import BonetrackError
from capture.importers.realsense import COLOUR_TOPIC, DEPTH_TOPIC, Lens, Streams, as_source
from capture.importers.source import (
    ColourFrame,
    DepthFrame,
    Frames,
    Source,
    UserCamera,
    check_size,
    damaged,
    no_depth,
    optional_module,
    the_only,
)
from capture.rigid import Floats, transform

_DEPTH_ENCODINGS = {"mono16", "16UC1", "Z16"}
_METADATA_LOOKED_AT = 200
_COLOUR_CHANNELS = {"rgb8": (3, [2, 1, 0]), "bgr8": (3, [0, 1, 2]), "rgba8": (4, [2, 1, 0]), "bgra8": (4, [0, 1, 2])}
"""Encodings that are kept: bytes a pixel, and where blue, green and red stand."""


def open_bag(path: Path, stated: UserCamera) -> Source:
    """A recording by a RealSense SDK or its Viewer.

    Raises:
        RecordingError: no such file; no depth; no calibration and no focal length stated; damaged.
    """
    with _reader(path) as reader:
        names = {connection.topic: connection for connection in reader.connections}
        depth = the_only(_matching(names, DEPTH_TOPIC + "/image/data"), path)
        if depth is None:
            kinds = sorted({name.split("/")[3] for name in names if name.endswith("/image/data")})
            raise no_depth(path, f"it has {', '.join(kinds)}" if kinds else "and no images at all")
        lens = _lens(reader, depth.removesuffix("/image/data"), names)
        if lens is None:
            raise damaged(path, "it does not say what the depth camera is")
        check_size(lens.width, lens.height, where=path)
        colour = _find(names, COLOUR_TOPIC + "/image/data")
        if colour is not None and not _kept(reader, names[colour]):
            colour = None
        streams = Streams(
            depth=lens,
            depth_unit_m=_depth_unit(reader, depth, names),
            colour=None if colour is None else _lens(reader, colour.removesuffix("/image/data"), names),
            depth_from_reference=_pose(reader, depth, names),
            colour_from_reference=None if colour is None else _pose(reader, colour, names),
            clock=_clock(reader, names.get(depth.removesuffix("/data") + "/metadata")),
        )
        count = int(names[depth].msgcount)
    wanted = {depth} if streams.colour is None or colour is None else {depth, colour}
    return as_source(streams, _frames(path, depth, wanted, lens), path, stated, count=count)


def _frames(path: Path, depth: str, topics: set[str], lens: Lens) -> Frames:
    with _reader(path) as reader:
        connections = [connection for connection in reader.connections if connection.topic in topics]
        for connection, _, raw in reader.messages(connections):
            time_s, width, height, encoding, step, data = _image(raw)
            if connection.topic == depth:
                if encoding not in _DEPTH_ENCODINGS or (width, height) != (lens.width, lens.height):
                    raise damaged(path, f"a depth image is {width} x {height} {encoding}")
                yield DepthFrame(time_s, _rows(data, height, step, 2 * width).view("<u2").astype(np.uint16))
            elif encoding in _COLOUR_CHANNELS:
                check_size(width, height, where=path)
                channels, order = _COLOUR_CHANNELS[encoding]
                pixels = _rows(data, height, step, channels * width).reshape(height, width, channels)
                yield ColourFrame(time_s, np.ascontiguousarray(pixels[..., order]))


@contextmanager
def _reader(path: Path) -> Iterator[Any]:
    """The opened file; whatever the library raises inside the block becomes one line about the file."""
    rosbag1 = optional_module("rosbags.rosbag1", extra="realsense", where=path)
    try:
        with rosbag1.Reader(path) as reader:
            yield reader
    except BonetrackError:
        raise
    except Exception as error:
        # A damaged file raises nearly anything in the library: its own errors, struct's, lz4's, KeyError, ...
        raise damaged(path, error) from error


def _matching(names: dict[str, Any], pattern: str) -> list[str]:
    return [name for name in sorted(names) if re.fullmatch(pattern, name)]


def _find(names: dict[str, Any], pattern: str) -> str | None:
    return next(iter(_matching(names, pattern)), None)


def _first(reader: Any, connection: Any) -> bytes | None:
    return next((bytes(raw) for _, _, raw in reader.messages([connection])), None)


def _message(reader: Any, connection: Any) -> Any:
    """The first message of a topic, or None."""
    raw = _first(reader, connection)
    return None if raw is None else _types().deserialize_ros1(raw, connection.msgtype)


@cache
def _types() -> Any:
    """The messages of ROS 1; making them takes a tenth of a second."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS1_NOETIC)


def _lens(reader: Any, stream: str, names: dict[str, Any]) -> Lens | None:
    connection = names.get(f"{stream}/info/camera_info")
    told = None if connection is None else _message(reader, connection)
    if told is None:
        return None
    fx, cx, fy, cy = (float(told.K[i]) for i in (0, 2, 4, 5))
    coefficients = tuple(float(value) for value in told.D)
    return Lens(int(told.width), int(told.height), fx, fy, cx, cy, str(told.distortion_model), coefficients)


def _depth_unit(reader: Any, depth: str, names: dict[str, Any]) -> float | None:
    sensor = "/".join(depth.split("/")[:3])
    connection = names.get(f"{sensor}/option/Depth_Units/value") or names.get(f"{sensor}/option/Depth Units/value")
    told = None if connection is None else _message(reader, connection)
    # Single precision in the file: 0.001 reads 0.0010000000475.
    return float(f"{told.data:.7g}") if told is not None and 1e-6 <= told.data <= 1.0 else None


def _clock(reader: Any, metadata: Any) -> str:
    """The domain of the times, as the first image's metadata tell it; empty if they do not."""
    if metadata is None:
        return ""
    for count, (_, _, raw) in enumerate(reader.messages([metadata])):
        told = _types().deserialize_ros1(bytes(raw), metadata.msgtype)
        if told.key == "timestamp_domain":
            return str(told.value)
        if count == _METADATA_LOOKED_AT:
            break
    return ""


def _pose(reader: Any, image: str, names: dict[str, Any]) -> Floats | None:
    """The (4, 4) transform from the file's reference to the stream that the image is of."""
    topic = _find(names, re.escape(image.removesuffix("/image/data")) + r"/tf/\d+")
    told = None if topic is None else _message(reader, names[topic])
    if told is None:
        return None
    x, y, z, w = told.rotation.x, told.rotation.y, told.rotation.z, told.rotation.w
    length = np.sqrt(x * x + y * y + z * z + w * w)
    move = np.array([told.translation.x, told.translation.y, told.translation.z])
    if not (abs(length - 1.0) < 1e-3 and np.isfinite(move).all()):
        return None
    x, y, z, w = np.array([x, y, z, w]) / length
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return transform(np.eye(3) + 2.0 * (w * cross + cross @ cross), move)


def _kept(reader: Any, connection: Any) -> bool:
    """Whether the colour images have an encoding that is kept."""
    raw = _first(reader, connection)
    return raw is not None and _image(raw)[3] in _COLOUR_CHANNELS


def _image(raw: bytes) -> tuple[float, int, int, str, int, memoryview]:
    """Time (s), width, height, encoding, bytes a row and the rows of a ``sensor_msgs/Image``.

    Raises:
        struct.error, ValueError: the message is too short for what it says.
    """
    _, seconds, nanoseconds, length = struct.unpack_from("<IIII", raw)
    at = 16 + length
    height, width, length = struct.unpack_from("<III", raw, at)
    encoding = bytes(raw[at + 12 : at + 12 + length]).decode("ascii")
    at += 12 + length
    big_endian, step, length = struct.unpack_from("<BII", raw, at)
    data = memoryview(raw)[at + 9 : at + 9 + length]
    if big_endian or len(data) < length:
        raise ValueError("an image is cut short, or big-endian")
    return seconds + nanoseconds * 1e-9, width, height, encoding, step, data


def _rows(data: memoryview, height: int, step: int, row_bytes: int) -> NDArray[np.uint8]:
    """The rows (height, row_bytes) of an image whose rows are ``step`` bytes apart."""
    if step < row_bytes or len(data) < step * height:
        raise ValueError("an image is too short for its size")
    return np.ascontiguousarray(np.frombuffer(data, np.uint8, count=step * height).reshape(height, step)[:, :row_bytes])
