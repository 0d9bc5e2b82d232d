"""A motion as plain tables, for CSV and for Parquet: the same names, numbers and units in both.

``angles`` and ``centres`` are wide (a row a frame), ``bones`` is long (a row for every frame and bone). What is not
known is ``nan`` in CSV and null in Parquet.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from adapt.anatomy import Anatomy, Floats
from adapt.model.pose_space import reported_coordinates
from capture.own import Mark, replaced_if_own, table_of, tail
from track.motion import Motion, MotionError
from track.observed_bones import known_thetas

Table = Mapping[str, NDArray[Any]]
"""Columns (N,) by name, all equally long: numbers, or text."""


_KEY = "bonetrack.table"
PARQUET = Mark(re.compile(rb"%b.*PAR1\Z" % _KEY.encode(), re.DOTALL), tail)


def motion_tables(motion: Motion, anatomy: Anatomy) -> dict[str, Table]:
    """The tables of a motion by name: ``angles`` (deg, m), ``centres`` (m) and ``bones`` (m, unit quaternions)."""
    angles = reported_coordinates(anatomy, known_thetas(anatomy, motion.thetas, motion.shown))
    centres = {f"{name}_{c}_m": at[:, k] for name, at in motion.centres.items() for k, c in enumerate("xyz")}
    return {
        "angles": {"time_s": motion.times} | angles,
        "centres": {"time_s": motion.times} | centres,
        "bones": _bones(motion),
    }


def write_csv(path: Path, table: Table) -> Path:
    """Write a table as CSV, numbers with eight decimals.

    Raises:
        OutputError: something stands there that is no table of these columns.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     table = {"frame": np.array([0, 1]), "knee_m": np.array([0.25, np.nan])}
    ...     write_csv(Path(folder, "centres.csv"), table).read_text().splitlines()
    ['frame,knee_m', '0,0.25000000', '1,nan']
    """
    with (
        replaced_if_own(path, table_of(list(table))) as partial,
        partial.open("w", newline="", encoding="utf-8") as file,
    ):
        writer = csv.writer(file)
        writer.writerow(table)
        for row in zip(*table.values(), strict=True):
            writer.writerow([f"{value:.8f}" if isinstance(value, np.floating) else value for value in row])
    return path


def write_parquet(path: Path, table: Table) -> Path:
    """Write a table as Parquet.

    Raises:
        MotionError: pyarrow is not installed.
        OutputError: something stands there that bonetrack did not write.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise MotionError("Parquet needs pyarrow", remedy="pip install 'bonetrack[tables]'") from error
    columns = {name: pyarrow.array(values, from_pandas=True) for name, values in table.items()}  # nan becomes null
    with replaced_if_own(path, PARQUET) as partial:
        pyarrow.parquet.write_table(pyarrow.table(columns, metadata={_KEY: "motion"}), str(partial))
    return path


def _bones(motion: Motion) -> Table:
    """Where each frame puts each bone: turn (unit quaternion), then shift (m), from the exported rest surface."""
    names, count = list(motion.transforms), len(motion.times)
    moved = np.stack([motion.transforms[name] for name in names], axis=1).reshape(-1, 4, 4)
    known = np.isfinite(moved).all(axis=(1, 2))
    turns = np.full((len(moved), 4), np.nan)
    if known.any():
        turns[known] = Rotation.from_matrix(moved[known, :3, :3]).as_quat(canonical=True)
    return {
        "frame": np.repeat(np.arange(count), len(names)),
        "time_s": np.repeat(motion.times, len(names)),
        "bone": np.tile(np.array(names), count),
        "shows": known.astype(int),
        **_columns("t", "xyz", moved[:, :3, 3], "_m"),
        **_columns("q", "xyzw", turns),
    }


def _columns(prefix: str, axes: str, values: Floats, unit: str = "") -> dict[str, Floats]:
    return {f"{prefix}{axis}{unit}": values[:, k] for k, axis in enumerate(axes)}
