"""First poses set by hand: a small CSV file, the override of the automatic search."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.model.body import make_body, rest_theta
from capture.errors import FitError


def read_first_poses(path: Path, anatomy: Anatomy) -> dict[int, Floats]:
    """Poses (n,) by frame number, from a CSV with a column ``frame`` and coordinates (rad, m) by name.

    Coordinates that have no column stay at rest.

    Raises:
        FitError: the file is missing, has no such columns, or holds something else than numbers.
    """
    valid = [coordinate.name for coordinate in anatomy.coordinates]
    poses: dict[int, Floats] = {}
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            for row in csv.DictReader(file):
                theta = rest_theta(make_body(anatomy))
                for name, cell in row.items():
                    if name != "frame":
                        theta[valid.index(name)] = float(cell)
                poses[int(row["frame"])] = theta
    except OSError as error:
        raise FitError("cannot be read", where=path, remedy="give a CSV file") from error
    except (ValueError, KeyError, TypeError) as error:
        columns = ", ".join(["frame", *valid])
        raise FitError("not a table of first poses", where=path, remedy=f"name columns among {columns}") from error
    if not poses or not all(np.isfinite(theta).all() for theta in poses.values()):
        raise FitError("holds no pose, or one that is not finite", where=path, remedy="give one row per pose")
    return poses
