"""Joint coordinates in other people's tables: columns by name, in rad and m or, where the table says so, in degrees.

A column ``elbow_flexion`` is in rad, ``elbow_flexion_deg`` in degrees; a comment line ``# inDegrees=yes``, as OpenSim's
files have it, makes degrees of all that turn. A value far outside a joint's range is no pose but another unit.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from adapt.anatomy import Anatomy, Floats
from capture.errors import BonetrackError

_SUFFIX = "_deg"
_IN_DEGREES = re.compile(r"in_?degrees\s*[=:,]\s*(yes|true|1)\b", re.IGNORECASE)
_SLACK = {"rad": np.deg2rad(30.0), "m": 5.0}
"""How far outside its range a value may be: recorded people go beyond a model's, and root positions start anywhere."""


@dataclass(frozen=True)
class CoordinateColumn:
    """Which coordinate of theta a column holds, and what a value is multiplied by to be in rad or m."""

    name: str
    index: int
    factor: float


def says_degrees(comments: Iterable[str]) -> bool:
    """Whether one of a table's comment lines says that angles are in degrees.

    >>> says_degrees(["# inDegrees=yes"]), says_degrees(["# inDegrees=no"])
    (True, False)
    """
    return any(_IN_DEGREES.search(line) for line in comments)


def coordinate_column(anatomy: Anatomy, name: str, *, degrees: bool = False) -> CoordinateColumn | None:
    """What a column of that name holds; None if it is no coordinate of the anatomy.

    >>> from adapt.anatomy_file import load_anatomy
    >>> arm = load_anatomy("upper-limb-right")
    >>> coordinate_column(arm, "elbow_flexion_deg")
    CoordinateColumn(name='elbow_flexion_deg', index=6, factor=0.017453292519943295)
    >>> coordinate_column(arm, "elbow_flexion").factor, coordinate_column(arm, "knee_angle_r")
    (1.0, None)
    """
    for index, coordinate in enumerate(anatomy.coordinates):
        turns = coordinate.unit == "rad"
        if name == coordinate.name:
            return CoordinateColumn(name, index, np.pi / 180.0 if turns and degrees else 1.0)
        if turns and name == coordinate.name + _SUFFIX:
            return CoordinateColumn(name, index, np.pi / 180.0)
    return None


def refuse_outside_range(
    anatomy: Anatomy,
    column: CoordinateColumn,
    values: Sequence[float] | Floats,
    *,
    error: Callable[..., BonetrackError],
    where: Path,
    row: Callable[[int], str],
) -> None:
    """Raise ``error`` for the first value (rad, m) far outside the coordinate's range; ``row`` names its row."""
    coordinate = anatomy.coordinates[column.index]
    slack = _SLACK[coordinate.unit]
    low, high = coordinate.low - slack, coordinate.high + slack
    outside = np.flatnonzero(~((np.asarray(values) >= low) & (np.asarray(values) <= high)))
    if not len(outside):
        return
    value = float(np.asarray(values)[outside[0]])
    if coordinate.unit == "m":
        said, limits, remedy = f"{value:g} m", f"{coordinate.low:g} to {coordinate.high:g} m", "give metres"
    else:
        limits = f"{np.rad2deg(coordinate.low):.0f} to {np.rad2deg(coordinate.high):.0f} degrees"
        said = f"{np.rad2deg(value):.0f} degrees ({value:.4g} rad)"
        remedy = f"call the column {coordinate.name}{_SUFFIX} if it is in degrees; check its sign (docs/coordinates.md)"
    raise error(f"{row(int(outside[0]))}: {column.name} is {said}, its range is {limits}", where=where, remedy=remedy)
