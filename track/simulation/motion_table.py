"""Performances from tables: a CSV file with a subject's coordinates over time."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from adapt.coordinate_columns import coordinate_column, refuse_outside_range, says_degrees
from adapt.model.body import Body
from track.simulation.performance import Performance, PerformanceError, poses_with


def read_motion_table(path: Path, body: Body) -> Performance:
    """A performance from a CSV file: ``time`` (s) and coordinates (rad, m) by name; the rest stays at rest.

    Lines that begin with ``#`` are comments; columns that are no coordinates of the anatomy are passed over. Names that
    end in ``_deg`` are in degrees (``adapt.coordinate_columns``).

    Raises:
        PerformanceError: missing file, no time, no known coordinate, not numbers, times that do not increase, or values
            far outside a joint's range.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:  # spreadsheets begin with a byte order mark
            lines = [line for line in file if line.strip()]
            rows = list(csv.reader(line for line in lines if not line.startswith("#")))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise PerformanceError("cannot be read as a table", where=path, remedy="give a CSV file") from error
    header = [name.strip() for name in rows[0]] if rows else []
    degrees = says_degrees(line for line in lines if line.startswith("#"))
    found = [(k, coordinate_column(body.anatomy, name, degrees=degrees)) for k, name in enumerate(header)]
    columns = {k: column for k, column in found if column is not None}
    if "time" not in header or not columns:
        valid = ", ".join(coordinate.name for coordinate in body.anatomy.coordinates)
        raise PerformanceError(
            "no column `time`, or none that is a coordinate", where=path, remedy=f"name columns {valid}"
        )
    try:
        table = np.array([[float(cell) for _, cell in zip(header, row, strict=True)] for row in rows[1:]])
    except ValueError as error:
        raise PerformanceError(
            "a row is not all numbers, too short or too long", where=path, remedy="give one number per column"
        ) from error
    if not len(table):
        raise PerformanceError("has no rows", where=path, remedy="give one row per frame")
    times = table[:, header.index("time")]
    if not np.isfinite(table).all() or (np.diff(times) <= 0.0).any():
        raise PerformanceError("values must be finite and times increase", where=path, remedy="mend the table")
    values = {column.index: column.factor * table[:, k] for k, column in columns.items()}
    for column in columns.values():
        refuse_outside_range(
            body.anatomy,
            column,
            values[column.index],
            error=PerformanceError,
            where=path,
            row=lambda k: f"at {times[k]:g} s",
        )
    names = {column.index: body.anatomy.coordinates[column.index].name for column in columns.values()}
    return Performance(body, times, poses_with(body, {names[i]: value for i, value in values.items()}, len(table)))
