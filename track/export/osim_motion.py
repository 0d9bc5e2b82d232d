"""Motions for the exported OpenSim model: every one of its coordinates has a column."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from adapt.anatomy import Anatomy, Floats
from capture.own import Mark, replaced_if_own
from track.export.osim_joints import coupled_coordinates, joints_of_coordinates

_WRITER = "writer=bonetrack"
STATES = Mark(re.compile(rb"\n%b\n(.*\n)*?endheader\n" % _WRITER.encode()))


def with_coupled(anatomy: Anatomy, columns: Mapping[str, Floats]) -> dict[str, Floats]:
    """Reported columns (T,) in degrees, and those of the model's coupled coordinates in RADIANS.

    OpenSim converts only coordinates that turn in proportion, so its own files have coupled ones in radians even where
    they say ``inDegrees=yes``.

    >>> from adapt.anatomy_file import load_anatomy
    >>> columns = with_coupled(load_anatomy("lower-limb-right"), {"knee_angle_r": np.array([90.0])})
    >>> {name: values.round(4).tolist() for name, values in columns.items()}
    {'knee_angle_r': [90.0], 'knee_angle_r_beta': [1.5708]}
    """
    return {**columns, **{name: np.deg2rad(columns[of]) for name, of in coupled_coordinates(anatomy).items()}}


def in_si_with_coupled(anatomy: Anatomy, columns: Mapping[str, Floats]) -> dict[str, Floats]:
    """Reported columns (T,) in radians and metres, with the model's coupled coordinates.

    >>> from adapt.anatomy_file import load_anatomy
    >>> degrees = {"knee_angle_r": np.array([90.0]), "hip_tx": np.array([0.2])}
    >>> in_si = in_si_with_coupled(load_anatomy("lower-limb-right"), degrees)
    >>> {name: values.round(4).tolist() for name, values in in_si.items()}  # hip_tx is in metres already
    {'knee_angle_r': [1.5708], 'hip_tx': [0.2], 'knee_angle_r_beta': [1.5708]}
    """
    lengths = {coordinate.name for coordinate in anatomy.coordinates if coordinate.unit == "m"}
    in_si = {name: values if name in lengths else np.deg2rad(values) for name, values in columns.items()}
    return in_si | {name: in_si[of] for name, of in coupled_coordinates(anatomy).items()}


def write_states(path: Path, times: Floats, anatomy: Anatomy, columns: Mapping[str, Floats]) -> None:
    """Write reported columns (T,), of degrees and metres, as OpenSim's states table (``.sto``): radians and metres.

    Columns are named by the state's whole path, as ``/jointset/elbow/elbow_flexion/value``, with coupled coordinates;
    columns that are no coordinates of the model are passed over. OpenSim's reader takes the first ``nan`` for the end
    of a file, so coordinates that are never known are left out, and then frames in which one is not.
    """
    in_si = in_si_with_coupled(anatomy, columns)
    joints = joints_of_coordinates(anatomy)
    known = [name for name in joints if np.isfinite(in_si[name]).any()]
    table = np.column_stack([times, *(in_si[name] for name in known)])
    table = table[np.isfinite(table).all(axis=1)]
    labels = ["time", *(f"/jointset/{joints[name]}/{name}/value" for name in known)]
    header = (
        f"coordinates\nDataType=double\nversion=3\nOpenSimVersion=4.6\n{_WRITER}\ninDegrees=no\n"
        f"nRows={len(table)}\nnColumns={table.shape[1]}\nendheader\n"
    )
    rows = ["\t".join(f"{value:.9f}" for value in row) for row in table]
    with replaced_if_own(path, STATES) as partial:
        partial.write_text(header + "\t".join(labels) + "\n" + "\n".join(rows) + "\n", encoding="utf-8")
