"""First poses set by hand: a small CSV file, the override of the automatic search."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.coordinate_columns import coordinate_column, refuse_outside_range, says_degrees
from adapt.model.body import make_body, rest_theta
from capture.errors import FitError


def read_first_poses(path: Path, anatomy: Anatomy) -> dict[int, Floats]:
    """Poses (n,) by frame number, from a CSV with a column ``frame`` and coordinates (rad, m) by name.

    Names that end in ``_deg`` are in degrees (``adapt.coordinate_columns``). Coordinates without a column stay at rest.

    Raises:
        FitError: the file is missing, has no such columns, holds something else than numbers, or a pose that no joint
            can take.

    >>> from tempfile import TemporaryDirectory
    >>> from adapt.anatomy_file import load_anatomy
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "first.csv")
    ...     _ = path.write_text("frame,elbow_flexion_deg\\n7,90\\n")
    ...     poses = read_first_poses(path, load_anatomy("upper-limb-right"))
    >>> {frame: round(float(theta[6]), 2) for frame, theta in poses.items()}  # rad
    {7: 1.57}
    """
    rows, comments = _rows(path)
    header = [name.strip() for name in rows[0]] if rows else []
    columns = {k: coordinate_column(anatomy, name, degrees=says_degrees(comments)) for k, name in enumerate(header)}
    poses: dict[int, Floats] = {}
    try:
        at = header.index("frame")
        if any(column is None for k, column in columns.items() if k != at):
            raise ValueError("a column that is no coordinate")
        for row in rows[1:]:
            theta = rest_theta(make_body(anatomy))
            if len(row) != len(header):
                raise ValueError("a row that is longer or shorter than the header")
            cells = dict(enumerate(row))
            for k, column in columns.items():
                if column is not None:
                    theta[column.index] = column.factor * float(cells[k])
            poses[int(cells[at])] = theta
    except (ValueError, KeyError, TypeError) as error:
        names = ", ".join(["frame", *(coordinate.name for coordinate in anatomy.coordinates)])
        raise FitError("not a table of first poses", where=path, remedy=f"name columns among {names}") from error
    if not poses or not all(np.isfinite(theta).all() for theta in poses.values()):
        raise FitError("holds no pose, or one that is not finite", where=path, remedy="give one row per pose")
    for column in columns.values():
        if column is not None:
            values = [theta[column.index] for theta in poses.values()]
            named = [f"frame {frame}" for frame in poses]
            refuse_outside_range(anatomy, column, values, error=FitError, where=path, row=named.__getitem__)
    return poses


def _rows(path: Path) -> tuple[list[list[str]], list[str]]:
    """A table's rows, the header first, and its comment lines.

    Raises:
        FitError: it cannot be read.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            lines = [line for line in file if line.strip()]
        comments = [line for line in lines if line.startswith("#")]
        return list(csv.reader(line for line in lines if not line.startswith("#"))), comments
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FitError("cannot be read", where=path, remedy="give a CSV file") from error
