"""Points out of ``.pcd`` and ``.ply`` files: their coordinates and nothing else.

Sources: the Point Cloud Library's page on the PCD format, version 0.7; G. Turk's description of PLY, version 1.0.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from capture.errors import RecordingError
from capture.importers.axes import AXES_OF_SCREENS
from capture.importers.source import damaged
from capture.recording.depth_png import LARGEST_PIXELS
from capture.rigid import Floats

_LARGEST_HEADER = 2**16
_LARGEST_POINT_BYTES = 512
_REALSENSE = b"saved from Realsense"
_PCD_CODINGS: dict[str, Literal["text", "bytes", "packed"]] = {
    "ascii": "text", "binary": "bytes", "binary_compressed": "packed",
}  # fmt: skip
_PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Points:
    """Coordinates (N, 3) in the file's unit, NaN where there is no point; (width, height) if they are an image's;
    which way their axes point, if the header tells."""

    xyz: Floats
    size: tuple[int, int] | None
    axes: str | None = None


def read_points(file: Path) -> Points:
    """The points of a ``.pcd`` or ``.ply`` file.

    Raises:
        RecordingError: neither of them, without x, y and z, truncated, or damaged.
    """
    try:
        with file.open("rb") as opened:
            head = opened.read(_LARGEST_HEADER)
            if head.startswith(b"ply"):
                layout, begin = _ply_layout(head)
            else:
                layout, begin = _pcd_layout(head)
            opened.seek(begin)
            data = opened.read(layout.count * _LARGEST_POINT_BYTES)
        xyz = layout.coordinates(data)
        return Points(xyz, layout.size, AXES_OF_SCREENS if _by_realsense(head, xyz) else None)
    except (ValueError, KeyError, IndexError, TypeError) as error:
        raise damaged(file, error) from error
    except OSError as error:
        problem = f"cannot be read ({error.strerror})"
        raise RecordingError(problem, where=file, remedy="check the file and its permissions") from error


def _by_realsense(head: bytes, xyz: Floats) -> bool:
    """Whether a cloud is in the axes in which RealSense's SDK exports; programs that only copied its header keep z."""
    with np.errstate(invalid="ignore"):
        return _REALSENSE in head and bool((xyz[:, 2] <= 0.0).sum() > (xyz[:, 2] > 0.0).sum())


@dataclass(frozen=True)
class _Layout:
    """How points stand in a file: names and numpy types of their fields, how many, as text, in bytes, or packed."""

    fields: tuple[tuple[str, str], ...]
    count: int
    coding: Literal["text", "bytes", "packed"]
    size: tuple[int, int] | None

    def coordinates(self, data: bytes) -> Floats:
        names = [name for name, _ in self.fields]
        columns = [names.index(axis) for axis in ("x", "y", "z")]
        if self.coding == "packed":
            return self._unpacked(data, columns)
        if self.coding == "bytes":
            # Unnamed fields may repeat (padding), which numpy does not allow.
            kind = np.dtype([(f"{number}", kind) for number, (_, kind) in enumerate(self.fields)])
            if len(data) < self.count * kind.itemsize:
                raise ValueError("its end is missing")
            points = np.frombuffer(data, kind, count=self.count)
            return np.stack([points[f"{column}"].astype(np.float64) for column in columns], axis=-1)
        # By words, not by lines: RealSense's SDK writes the colour of each point into a line of its own.
        words = data.split(None, self.count * len(names))[: self.count * len(names)]
        if len(words) < self.count * len(names):
            raise ValueError("its end is missing")
        return np.asarray(np.array(words).reshape(self.count, -1)[:, columns].astype(np.float64))

    def _unpacked(self, data: bytes, columns: list[int]) -> Floats:
        """Packed points stand field by field: all x, all y, ...; before them how long they are, packed and unpacked."""
        packed, size = struct.unpack_from("<II", data)
        ends = np.cumsum([np.dtype(kind).itemsize * self.count for _, kind in self.fields])
        if len(data) < 8 + packed or size != ends[-1]:
            raise ValueError("its end is missing, or its points are not as long as its header says")
        from capture.importers.lzf import unpacked

        plain = unpacked(data[8 : 8 + packed], size)
        each = [
            np.frombuffer(plain, self.fields[i][1], self.count, ends[i - 1] if i else 0).astype(np.float64)
            for i in columns
        ]
        return np.stack(each, axis=-1)


def _layout(
    fields: list[tuple[str, str]],
    count: int,
    *,
    coding: Literal["text", "bytes", "packed"],
    size: tuple[int, int] | None,
) -> _Layout:
    """Checked before anything is read: a sane number of points, of sane size, with coordinates."""
    if not 0 < count <= LARGEST_PIXELS:
        raise ValueError(f"it claims {count} points")
    if sum(np.dtype(kind).itemsize for _, kind in fields) > _LARGEST_POINT_BYTES:
        raise ValueError("its points claim too many bytes")
    if not {"x", "y", "z"} <= {name for name, _ in fields}:
        raise ValueError("its points have no x, y and z")
    return _Layout(tuple(fields), count, coding, size)


def _header(head: bytes, last: bytes) -> tuple[list[list[str]], int]:
    """The words of a header's lines, and where the line that begins with ``last`` ends."""
    lines, at = [], 0
    while (end := head.find(b"\n", at)) >= 0:
        line = head[at:end].strip()
        at = end + 1
        if line and not line.startswith(b"#"):
            lines.append(line.decode("ascii").split())
        if line.startswith(last):
            return lines, at
    raise ValueError("its header has no end, or it is neither a .pcd nor a .ply file")


def _pcd_layout(head: bytes) -> tuple[_Layout, int]:
    lines, begin = _header(head, b"DATA")
    said = {line[0]: line[1:] for line in lines}
    counts = [int(count) for count in said.get("COUNT", ["1"] * len(said["FIELDS"]))]
    kinds = [f"<{kind.lower()}{size}" for kind, size in zip(said["TYPE"], said["SIZE"], strict=True)]
    fields = [
        (name, kind)
        for name, kind, count in zip(said["FIELDS"], kinds, counts, strict=True)
        for _ in range(min(max(count, 0), _LARGEST_POINT_BYTES + 1))
    ]
    coding = said["DATA"][0]
    if coding not in _PCD_CODINGS:
        raise ValueError(f"its coding {coding} is none of {', '.join(_PCD_CODINGS)}")
    width, height = int(said["WIDTH"][0]), int(said["HEIGHT"][0])
    size = (width, height) if height > 1 else None
    return _layout(fields, width * height, coding=_PCD_CODINGS[coding], size=size), begin


def _ply_layout(head: bytes) -> tuple[_Layout, int]:
    lines, begin = _header(head, b"end_header")
    coding = {line[0]: line[1:] for line in lines}["format"][0]
    order = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}[coding]
    elements = [number for number, line in enumerate(lines) if line[0] == "element"]
    first = elements[0]
    if lines[first][1] != "vertex":
        raise ValueError("its first element is not the vertices")
    end = elements[1] if len(elements) > 1 else len(lines)
    properties = [line for line in lines[first + 1 : end] if line[0] == "property"]
    fields = [(line[2], order + _PLY_TYPES[line[1]]) for line in properties]
    return _layout(fields, int(lines[first][2]), coding="text" if coding == "ascii" else "bytes", size=None), begin
