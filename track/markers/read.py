"""Marker trials as laboratories keep them: ``.trc`` and ``.c3d``."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from adapt.anatomy import Floats
from capture.errors import BonetrackError
from capture.files import UNREADABLE

_METRES = {"m": 1.0, "meters": 1.0, "metres": 1.0, "cm": 1e-2, "mm": 1e-3}
_NO_POINTS = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "REACTIONS", "SCALARS")
"""What C3D files keep among points though it is none, as lists of the labels."""
_FORMATS = "give a marker file: .trc or .c3d"


class MarkerError(BonetrackError):
    """A marker file cannot be read, or does not go with the motion it is put beside."""


@dataclass(frozen=True, eq=False)
class MarkerTrial:
    """Marker paths (T, 3) m by name, in the laboratory's frame, NaN where unknown; times (T,) s by its clock."""

    times: Floats
    points: dict[str, Floats] = field(repr=False)


def read_markers(path: Path) -> MarkerTrial:
    """Read a marker file.

    Raises:
        MarkerError: it is missing, not a marker file, without a marker, or of an unknown unit; or ezc3d is missing.
    """
    if not path.is_file():
        raise MarkerError("no file is here", where=path, remedy=_FORMATS)
    readers = {".trc": _read_trc, ".c3d": _read_c3d}
    if path.suffix.lower() not in readers:
        raise MarkerError("is no marker file by its name", where=path, remedy=_FORMATS)
    try:
        times, points, unit = readers[path.suffix.lower()](path)
    except (*UNREADABLE, IndexError) as error:
        problem = f"cannot be read as a {path.suffix.lower()} file"
        raise MarkerError(problem, where=path, remedy="write it again from the program that made it") from error
    if unit.lower() not in _METRES:
        raise MarkerError(f"is in {unit or 'no unit'}", where=path, remedy="write it in mm or m")
    for at in points.values():  # programs write an unknown marker in different ways, one of them zeros
        at[(at == 0.0).all(axis=1) | ~np.isfinite(at).all(axis=1)] = np.nan
    known = {name: _METRES[unit.lower()] * at for name, at in points.items() if np.isfinite(at).any()}
    if not known:
        raise MarkerError("holds no marker that is ever known", where=path, remedy="give another trial")
    if len(times) < 2 or not (np.diff(times) > 0.0).all():
        raise MarkerError("has times that do not go up", where=path, remedy="write it again with times")
    return MarkerTrial(times, known)


def _read_trc(path: Path) -> tuple[Floats, dict[str, Floats], str]:
    """A table with tabs between its cells, of which those of unknown markers may be empty."""
    lines = path.read_text(encoding="utf-8-sig").splitlines()
    header = dict(zip(re.split(r"\s+", lines[1].strip()), re.split(r"\s+", lines[2].strip()), strict=False))
    names = [name.strip() for name in lines[3].split("\t")[2::3] if name.strip()]
    rows = [line.split("\t") for line in lines[5:] if line.strip()]
    width = 2 + 3 * len(names)
    table = np.array([[float(cell) if cell.strip() else np.nan for cell in _filled(row, width)] for row in rows])
    at = table[:, 2:].reshape(len(table), len(names), 3)
    return table[:, 1], {name: at[:, k] for k, name in enumerate(names)}, header["Units"]


def _filled(row: list[str], width: int) -> list[str]:
    """A row's cells as many as there are columns: programs leave out empty ones at the end."""
    if len(row) > width and any(cell.strip() for cell in row[width:]):
        raise ValueError("a row with more cells than there are markers")
    return (row + [""] * width)[:width]


def _read_c3d(path: Path) -> tuple[Floats, dict[str, Floats], str]:
    try:
        import ezc3d
    except ImportError as error:
        raise MarkerError("C3D needs ezc3d", where=path, remedy="pip install 'bonetrack[c3d]'") from error
    file = ezc3d.c3d(str(path))
    point, at = file["parameters"]["POINT"], file["data"]["points"][:3]  # NaN where the residual is below 0
    lists = sorted((key for key in point if re.fullmatch(r"LABELS\d*", key)), key=lambda key: (len(key), key))
    labels = [label.strip() for key in lists for label in point[key]["value"]][: at.shape[1]]
    others = {label.strip() for key in _NO_POINTS if key in point for label in point[key]["value"]}
    times = np.arange(at.shape[2]) / float(point["RATE"]["value"][0])
    points = {label: at[:, k].T.copy() for k, label in enumerate(labels) if label and label not in others}
    units = point["UNITS"]["value"] if "UNITS" in point else []
    return times, points, units[0].strip() if units else ""


def read_point_pairs(path: Path) -> tuple[Floats, Floats]:
    """Points that were measured in both frames: a table whose rows are x, y, z there and x, y, z here, in metres.

    Raises:
        MarkerError: it cannot be read, has other than six columns, or fewer than three rows.
    """
    remedy = "a row for each point: x,y,z in the laboratory's frame, then x,y,z in the recording's, in metres"
    try:
        lines = [line for line in path.read_text(encoding="utf-8-sig").splitlines() if line.strip()]
        titled = bool(lines) and not re.match(r"\s*[-+.\d]", lines[0])
        table = np.array([[float(cell) for cell in re.split(r"[,;\s]+", line.strip())] for line in lines[titled:]])
    except UNREADABLE as error:
        raise MarkerError("is no table of numbers", where=path, remedy=remedy) from error
    if table.ndim != 2 or table.shape[1] != 6 or len(table) < 3 or not np.isfinite(table).all():
        raise MarkerError("does not hold three points or more, of six numbers each", where=path, remedy=remedy)
    return table[:, :3], table[:, 3:]
