"""OpenSim's text formats: ``.mot`` for coordinates, ``.trc`` for points."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from adapt.anatomy import Floats
from capture.own import Mark, replaced_if_own, words

_UNKNOWN = "What is not known is nan.\nendheader\n"
MOT = words(_UNKNOWN)
TRC = Mark(re.compile(rb"\APathFileType\t4\t\(X/Y/Z\)\tbonetrack/"))


def write_mot(path: Path, times: Floats, columns: Mapping[str, Floats]) -> None:
    """Write coordinates (T,) over time (s): rotations in degrees, translations in metres; NaN stays ``nan``.

    Coordinates that OpenSim counts as coupled, named ``..._beta``, are given and written in radians.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "angles.mot")
    ...     write_mot(path, np.array([0.0, 0.1]), {"knee_angle_r": np.array([10.0, np.nan])})
    ...     [row.split() for row in path.read_text().splitlines()[-3:]]
    [['time', 'knee_angle_r'], ['0.00000000', '10.00000000'], ['0.10000000', 'nan']]
    """
    said = "Coupled coordinates (..._beta) are in radians, as OpenSim has them.\nRotations are in degrees"
    _write_coordinates(path, times, columns, "yes", said)


def write_mot_in_radians(path: Path, times: Floats, columns: Mapping[str, Floats]) -> None:
    """Write coordinates (T,) over time (s): all rotations in radians, translations in metres; NaN stays ``nan``.

    Readers do not agree on coupled coordinates in files of degrees; here they have nothing to convert.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "angles_rad.mot")
    ...     write_mot_in_radians(path, np.array([0.0]), {"knee_angle_r": np.array([np.pi / 2.0])})
    ...     [line.split() for line in path.read_text().splitlines() if line.startswith(("inDegrees", "0."))]
    [['inDegrees=no'], ['0.00000000', '1.57079633']]
    """
    _write_coordinates(path, times, columns, "no", "Rotations are in radians")


def _write_coordinates(path: Path, times: Floats, columns: Mapping[str, Floats], in_degrees: str, said: str) -> None:
    table = np.column_stack([times, *columns.values()])
    header = (
        f"Coordinates\nversion=1\nnRows={len(table)}\nnColumns={table.shape[1]}\ninDegrees={in_degrees}\n\n"
        f"{said}, translations in metres. {_UNKNOWN}"
    )
    rows = ["\t".join(f"{value:.8f}" for value in row) for row in table]
    _write(path, MOT, header + "\t".join(["time", *columns]) + "\n" + "\n".join(rows) + "\n")


def write_trc(path: Path, times: Floats, points: Mapping[str, Floats]) -> None:
    """Write points (T, 3) in metres as a marker file in millimetres; what is not known (NaN) is ``nan``.

    Not an empty cell: OpenSim's table reader then counts too few columns where a row ends in one and refuses the file,
    and nimblephysics passes over it, so that the markers after it stand under their neighbours' names.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "centres.trc")
    ...     write_trc(path, np.array([0.0, 0.1]), {"knee": np.array([[0.1, 0.2, 0.3], [0.1, 0.2, np.nan]])})
    ...     [line.split() for line in path.read_text().splitlines()[-2:]]
    [['1', '0.000000', '100.00000', '200.00000', '300.00000'], ['2', '0.100000', '100.00000', '200.00000', 'nan']]
    """
    rate = 1.0 / float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    names = "\t\t\t".join(points)
    axes = "\t".join(f"{c}{k}" for k in range(1, len(points) + 1) for c in "XYZ")
    fields = f"{rate:.4f}\t{rate:.4f}\t{len(times)}\t{len(points)}\tmm\t{rate:.4f}\t1\t{len(times)}"
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\tbonetrack/{path.name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        fields,
        f"Frame#\tTime\t{names}\t\t",
        f"\t\t{axes}",
        "",
    ]
    for frame, time in enumerate(times):
        cells = [f"{1e3 * value:.5f}" for series in points.values() for value in series[frame]]
        lines.append("\t".join([str(frame + 1), f"{time:.6f}", *cells]))
    _write(path, TRC, "\n".join(lines) + "\n")


def _write(path: Path, mark: Mark, text: str) -> None:
    with replaced_if_own(path, mark) as partial:
        partial.write_text(text, encoding="utf-8")
