"""RealSense ``.db3`` files, as SDK 2.59 writes them: an SQLite file of ROS 2 messages; needs no library.

Source of the layout: files that the SDK's recorder wrote. Depth is a 16-bit PNG in each message; what the camera is,
its unit and the frame's own time stand in text messages of ``key=value`` pairs.
"""

from __future__ import annotations

import re
import sqlite3
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from capture.errors import RecordingError
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
    the_only,
)
from capture.recording import depth_png
from capture.rigid import Floats, transform

_DEPTH_IMAGE = "/image/data/compressedDepth"
_COLOUR_IMAGE = "/image/data/compressed"
_DEPTH_HEADER_BYTES = 12
"""ROS puts a header of its own before the PNG of a compressed depth image."""

_LARGEST_MESSAGE = 2**28


def open_db3(path: Path, stated: UserCamera) -> Source:
    """A recording by a RealSense SDK or its Viewer.

    Raises:
        RecordingError: no such file; no depth; no calibration and no focal length stated; damaged.
    """
    with _database(path) as database:
        topics = {str(name): int(key) for key, name in database.execute("SELECT id, name FROM topics")}
        depth = the_only(_streams(topics, DEPTH_TOPIC, _DEPTH_IMAGE), path)
        if depth is None:
            kinds = sorted({name.split("/")[3] for name in topics if "/image/data" in name})
            raise no_depth(path, f"it has {', '.join(kinds)}" if kinds else "and no images at all")
        lens = _lens(_text(database, topics, f"{depth}/camera_info"))
        check_size(lens.width, lens.height, where=path)
        colour = next(iter(_streams(topics, COLOUR_TOPIC, _COLOUR_IMAGE)), None)
        unit = _text(database, topics, "/".join(depth.split("/")[:3]) + "/option/Depth_Units/value")
        streams = Streams(
            depth=lens,
            depth_unit_m=_unit(unit),
            colour=None if colour is None else _lens(_text(database, topics, f"{colour}/camera_info")),
            depth_from_reference=_pose(database, topics, depth),
            colour_from_reference=None if colour is None else _pose(database, topics, colour),
            clock=_pairs(_text(database, topics, f"{depth}/image/metadata") or "").get("timestamp_domain", ""),
        )
        (count,) = database.execute(
            "SELECT COUNT(*) FROM messages WHERE topic_id = ?", (topics[depth + _DEPTH_IMAGE],)
        ).fetchone()
    return as_source(streams, _frames(path, topics, depth, colour, lens), path, stated, count=int(count))


def _frames(path: Path, topics: dict[str, int], depth: str, colour: str | None, lens: Lens) -> Frames:
    with _database(path) as database:
        for time_s, message in _images(database, topics, depth, _DEPTH_IMAGE):
            png = _compressed(message)[_DEPTH_HEADER_BYTES:]
            yield DepthFrame(time_s, depth_png.decode(png, width=lens.width, height=lens.height, where=path))
        if colour is not None:
            for time_s, message in _images(database, topics, colour, _COLOUR_IMAGE):
                yield ColourFrame(time_s, _compressed(message))


def _images(
    database: sqlite3.Connection, topics: dict[str, int], stream: str, image: str
) -> Iterator[tuple[float, bytes]]:
    """Time (s) and message of each image of a stream; the time stands in the metadata that share its stamp."""
    query = (
        "SELECT image.data, told.data FROM messages image LEFT JOIN messages told "
        "ON told.topic_id = ? AND told.timestamp = image.timestamp WHERE image.topic_id = ? ORDER BY image.timestamp"
    )
    for message, told in database.execute(query, (topics[f"{stream}/image/metadata"], topics[stream + image])):
        yield float(_pairs(_string(told))["timestamp"]) / 1000.0, message


@contextmanager
def _database(path: Path) -> Iterator[sqlite3.Connection]:
    """The opened file, never written to; whatever is wrong with it or its messages becomes one line about the file."""
    try:
        database = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro&immutable=1", uri=True)
        try:
            database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, _LARGEST_MESSAGE)
            database.execute("PRAGMA trusted_schema = OFF")
            kinds = dict(database.execute("SELECT name, type FROM sqlite_master"))
            if any(kinds.get(name) != "table" for name in ("topics", "messages")):
                raise RecordingError(
                    "is not a RealSense recording (it has no table of messages)",
                    where=path,
                    remedy="record or copy it again",
                )
            yield database
        finally:
            database.close()
    except (sqlite3.Error, struct.error, ValueError, KeyError, TypeError, OverflowError) as error:
        raise damaged(path, f"{type(error).__name__}: {error}") from error


def _streams(topics: dict[str, int], pattern: str, image: str) -> list[str]:
    """The streams that have such images, by the part of their names that is common to their topics."""
    streams = (name.removesuffix(image) for name in sorted(topics) if name.endswith(image))
    return [stream for stream in streams if re.fullmatch(pattern, stream)]


def _text(database: sqlite3.Connection, topics: dict[str, int], topic: str) -> str | None:
    """The first text message of a topic."""
    if topic not in topics:
        return None
    row = database.execute("SELECT data FROM messages WHERE topic_id = ? LIMIT 1", (topics[topic],)).fetchone()
    return None if row is None else _string(row[0])


def _lens(told: str | None) -> Lens:
    pairs = _pairs(told or "")
    return Lens(
        width=int(pairs["width"]),
        height=int(pairs["height"]),
        fx=float(pairs["fx"]),
        fy=float(pairs["fy"]),
        cx=float(pairs["ppx"]),
        cy=float(pairs["ppy"]),
        model=pairs["model"],
        coefficients=_numbers(pairs["coeffs"]),
    )


def _pose(database: sqlite3.Connection, topics: dict[str, int], stream: str) -> Floats | None:
    """The (4, 4) transform from the file's reference to a stream; the rotation stands column by column."""
    topic = next((name for name in sorted(topics) if name.startswith(f"{stream}/tf/")), "")
    told = _text(database, topics, topic)
    if told is None:
        return None
    pairs = _pairs(told)
    rotation, move = np.array(_numbers(pairs["rotation"])), np.array(_numbers(pairs["translation"]))
    if rotation.shape != (9,) or move.shape != (3,) or not np.isfinite([*rotation, *move]).all():
        return None
    rotation = rotation.reshape(3, 3).T
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-3 or np.linalg.det(rotation) < 0.0:
        return None
    u, _, vt = np.linalg.svd(rotation)  # six digits in the file
    return transform(u @ vt, move)


def _unit(told: str | None) -> float | None:
    value = None if told is None else float(told)
    return value if value is not None and 1e-6 <= value <= 1.0 else None


def _pairs(text: str) -> dict[str, str]:
    return dict(part.split("=", 1) for part in text.split(";") if "=" in part)


def _numbers(text: str) -> tuple[float, ...]:
    return tuple(float(part) for part in text.split(","))


def _string(message: bytes) -> str:
    """The text of a ``std_msgs/String``: after four bytes of encapsulation its length, then itself and a zero."""
    (length,) = struct.unpack_from("<I", message, 4)
    return message[8 : 8 + length].rstrip(b"\0").decode("utf-8")


def _compressed(message: bytes) -> bytes:
    """The data of a ``sensor_msgs/CompressedImage``: header (time, text), format (text), bytes; all in steps of 4."""
    at = 4 + 8
    for _ in range(2):
        (length,) = struct.unpack_from("<I", message, at)
        at += 4 + (length + 3) // 4 * 4
    (length,) = struct.unpack_from("<I", message, at)
    data = message[at + 4 : at + 4 + length]
    if len(data) < length:
        raise ValueError("an image is cut short")
    return data
