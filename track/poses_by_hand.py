"""Poses that a person set by hand, for single frames of a recording: a small JSON file (docs/view.md).

The viewer writes it, tracking reads it. In the file turns are in degrees and lengths in metres, each with its unit;
in memory a pose is theta (n,) in rad and m.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from adapt.anatomy import Anatomy, Coordinate, Floats
from capture.errors import BonetrackError
from capture.own import json_of, replaced_if_own

FORMAT = "bonetrack-poses"
VERSION = 1
UNITS = {"rad": "deg", "m": "m"}
"""Unit in the file, by the coordinate's unit in memory."""
_SLACK = 1e-9  # a limit that went through degrees and back is still inside
_REMEDY = "see docs/view.md, or save the pose again in `bonetrack view`"


class PosesError(BonetrackError):
    """A file of poses set by hand is not what it should be."""


@dataclass(frozen=True, eq=False)
class HandPose:
    """A pose set by hand: its name, the frame (index of the recording's instant) it belongs to, and theta (n,)."""

    name: str
    frame: int
    theta: Floats = field(repr=False)


def write_poses(path: Path, anatomy: Anatomy, poses: Iterable[HandPose]) -> None:
    """Write poses, in order of their frames.

    Raises:
        PosesError: two of one name or frame, or a pose that ``read_poses`` would refuse.
        OutputError: something else than such a file stands there.

    >>> from tempfile import TemporaryDirectory
    >>> from adapt.anatomy_file import load_anatomy
    >>> anatomy = load_anatomy("upper-limb-right")
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "poses.json")
    ...     write_poses(path, anatomy, [HandPose("start", 3, np.full(len(anatomy.coordinates), 0.25))])
    ...     json.loads(path.read_text())["poses"][0]["coordinates"]["shoulder_tx"]
    ...     [(pose.name, pose.frame, float(pose.theta[0])) for pose in read_poses(path, anatomy)]
    {'value': 0.25, 'unit': 'm'}
    [('start', 3, 0.25)]
    """
    written = {
        "format": FORMAT,
        "version": VERSION,
        "anatomy": anatomy.name,
        "poses": [
            {"name": pose.name, "frame": pose.frame, "coordinates": _coordinates(anatomy, pose.theta)}
            for pose in sorted(poses, key=lambda pose: pose.frame)
        ],
    }
    _poses(written, path, anatomy, frames=None)
    with replaced_if_own(path, json_of(FORMAT)) as partial:
        partial.write_text(json.dumps(written, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def read_poses(path: Path, anatomy: Anatomy, *, frames: int | None = None) -> tuple[HandPose, ...]:
    """Read poses of an anatomy, in order of their frames; ``frames`` is how many the recording has, if known.

    Raises:
        PosesError: unreadable, not such a file, of another anatomy, or a pose lacks a coordinate, has an unknown one,
            a wrong unit, or a value that is not a number inside the coordinate's range.
    """
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise PosesError(f"cannot be read ({error.strerror})", where=path, remedy="check the file's name") from error
    except (ValueError, RecursionError) as error:
        raise PosesError("is not JSON", where=path, remedy=_REMEDY) from error
    return _poses(value, path, anatomy, frames=frames)


def as_shown(coordinate: Coordinate, value: float) -> float:
    """A value (rad or m) in the unit that people see (deg or m).

    >>> turn, shift = Coordinate("elbow_flexion", "rad", 0.0, 2.6, 0.0), Coordinate("hip_tx", "m", -9.0, 9.0, 0.0)
    >>> as_shown(turn, math.pi / 2.0), as_shown(shift, 0.5)
    (90.0, 0.5)
    """
    return math.degrees(value) if coordinate.unit == "rad" else value


def from_shown(coordinate: Coordinate, value: float) -> float:
    """A value that people see (deg or m) in rad or m.

    >>> from_shown(Coordinate("elbow_flexion", "rad", 0.0, 2.6, 0.0), 90.0) == math.pi / 2.0
    True
    """
    return math.radians(value) if coordinate.unit == "rad" else value


def _coordinates(anatomy: Anatomy, theta: Floats) -> dict[str, dict[str, Any]]:
    return {
        coordinate.name: {"value": as_shown(coordinate, float(value)), "unit": UNITS[coordinate.unit]}
        for coordinate, value in zip(anatomy.coordinates, theta, strict=True)
    }


def _poses(value: Any, path: Path, anatomy: Anatomy, *, frames: int | None) -> tuple[HandPose, ...]:
    document = _keys(value, ("format", "version", "anatomy", "poses"), path, "the file")
    if document["format"] != FORMAT:
        raise PosesError(f"is not a {FORMAT} file", where=path, remedy=_REMEDY)
    if not _is_whole(document["version"]) or document["version"] < 1:
        raise PosesError(f"version {document['version']!r} is no version", where=path, remedy=_REMEDY)
    if document["version"] > VERSION:
        newer = f"format version {document['version']} is newer than {VERSION}"
        raise PosesError(newer, where=path, remedy="update bonetrack")
    if document["anatomy"] != anatomy.name:
        other = f"holds poses of anatomy {document['anatomy']!r}, not {anatomy.name!r}"
        raise PosesError(other, where=path, remedy="name another file with --poses")
    if not isinstance(document["poses"], list):
        raise PosesError("'poses' must be a list", where=path, remedy=_REMEDY)
    poses = [_pose(entry, k, path, anatomy, frames) for k, entry in enumerate(document["poses"])]
    _refuse_twice("name", [pose.name for pose in poses], path)
    _refuse_twice("frame", [pose.frame for pose in poses], path)
    return tuple(sorted(poses, key=lambda pose: pose.frame))


def _refuse_twice(what: str, values: Sequence[Any], path: Path) -> None:
    twice = [value for k, value in enumerate(values) if value in values[:k]]
    if twice:
        raise PosesError(f"two poses have the {what} {twice[0]!r}", where=path, remedy="keep one of them")


def _pose(value: Any, number: int, path: Path, anatomy: Anatomy, frames: int | None) -> HandPose:
    where = f"poses[{number}]"
    entry = _keys(value, ("name", "frame", "coordinates"), path, where)
    name, frame = entry["name"], entry["frame"]
    if not isinstance(name, str) or not name.strip():
        raise PosesError(f"{where}.name must be text, got {name!r}", where=path, remedy=_REMEDY)
    if not _is_whole(frame) or frame < 0:
        raise PosesError(f"{where}.frame must be a whole number from 0, got {frame!r}", where=path, remedy=_REMEDY)
    if frames is not None and frame >= frames:
        problem = f"pose {name!r} is of frame {frame}"
        raise PosesError(problem, where=path, remedy=f"frames run from 0 to {frames - 1}")
    names = tuple(coordinate.name for coordinate in anatomy.coordinates)
    given = _keys(entry["coordinates"], names, path, f"{where}.coordinates")
    of_frame = f"{where} (frame {frame})"
    theta = [_value(given[coordinate.name], coordinate, path, of_frame) for coordinate in anatomy.coordinates]
    return HandPose(name, frame, np.array(theta))


def _value(value: Any, coordinate: Coordinate, path: Path, where: str) -> float:
    keys = f"{where}: {coordinate.name}"
    entry = _keys(value, ("value", "unit"), path, keys)
    number, unit = entry["value"], UNITS[coordinate.unit]
    if entry["unit"] != unit:
        raise PosesError(f"{keys}.unit must be {unit!r}, got {entry['unit']!r}", where=path, remedy=_REMEDY)
    if isinstance(number, bool) or not isinstance(number, (int, float)) or not math.isfinite(number):
        raise PosesError(f"{keys}.value must be a finite number, got {number!r}", where=path, remedy=_REMEDY)
    inside = from_shown(coordinate, float(number))
    if not coordinate.low - _SLACK <= inside <= coordinate.high + _SLACK:
        low, high = as_shown(coordinate, coordinate.low), as_shown(coordinate, coordinate.high)
        problem = f"{keys} is {number:g} {unit}"
        raise PosesError(problem, where=path, remedy=f"its range is {low:.4g} to {high:.4g} {unit}")
    return inside


def _keys(value: Any, keys: tuple[str, ...], path: Path, where: str) -> Mapping[str, Any]:
    """The value, if it is an object with just these keys."""
    if not isinstance(value, dict):
        raise PosesError(f"{where} must be an object", where=path, remedy=_REMEDY)
    missing, unknown = [key for key in keys if key not in value], sorted(set(value) - set(keys))
    if missing:
        raise PosesError(f"{where} lacks {missing[0]!r}", where=path, remedy=_REMEDY)
    if unknown:
        raise PosesError(f"{where} has an unknown key {unknown[0]!r}", where=path, remedy=f"use {', '.join(keys)}")
    return value


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)
