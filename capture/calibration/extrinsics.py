"""Where the sensors stand, as somebody else's calibration says: 4 x 4 matrices out of a JSON, text or OpenCV YAML file.

A matrix acts on column vectors, in metres, and its name tells which way it maps: ``world_from_left`` takes points of
the sensor ``left`` into the common frame, ``left_from_world`` the other way. A sensor's own axes are x right, y down,
z forward.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from capture.bounded import read_at_most
from capture.errors import CalibrationError
from capture.rigid import Floats, inverse, transform

_LARGEST_FILE = 2**20
_ROUNDED = 2e-3  # files with three decimals are this far from orthonormal
_FARTHEST_APART_M = 20.0
_REMEDY = "see docs/formats.md, known extrinsics"
_WORDS = ("world_from_", "_from_world")


def read_extrinsics(file: Path, names: Sequence[str]) -> dict[str, Floats]:
    """World from sensor (4, 4) for each of the named sensors.

    Raises:
        CalibrationError: unreadable, no such file, a sensor is missing or named twice, a name does not tell which way
            its matrix maps, or a matrix is not rigid.

    >>> from tempfile import TemporaryDirectory
    >>> away = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 2.5], [0, 0, 0, 1]]
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder, "rig.json")
    ...     _ = file.write_text(json.dumps({"left_from_world": away}))
    ...     read_extrinsics(file, ["left"])["left"][:3, 3].tolist()  # the inverse: where the sensor stands
    [0.0, 0.0, -2.5]
    """
    found: dict[str, Floats] = {}
    for label, values in _matrices(file).items():
        name, is_inverse = _meant(label, file)
        if name not in names:
            raise _fail(file, f"{label!r} is of a sensor that the recording does not have ({', '.join(names)})")
        if name in found:
            raise _fail(file, f"sensor {name!r} has two matrices")
        rigid = _rigid(values, label, file)
        found[name] = inverse(rigid) if is_inverse else rigid
    missing = [name for name in names if name not in found]
    if missing:
        raise _fail(file, f"does not say where sensor {missing[0]!r} stands (world_from_{missing[0]})")
    places = np.array([found[name][:3, 3] for name in names])
    apart = float(np.linalg.norm(places[:, None] - places[None], axis=-1).max())
    if apart > _FARTHEST_APART_M:
        raise _fail(file, f"puts sensors {apart:.0f} m apart; lengths must be metres, not millimetres")
    return found


def _matrices(file: Path) -> Mapping[str, Any]:
    """Label and values of each matrix in a file."""
    data = read_at_most(file, _LARGEST_FILE, remedy=_REMEDY, error=CalibrationError)
    try:
        text = data.decode("utf-8-sig").strip()
        if text.startswith("%YAML"):
            return _of_yaml(text)
        return _of_json(text) if text.startswith("{") else _of_text(text)
    except (ValueError, RecursionError, cv2.error, SystemError) as error:
        words = " ".join(str(error).split())[:120]
        raise _fail(file, f"is not a file of named 4 x 4 matrices ({words})") from error


def _of_json(text: str) -> dict[str, Any]:
    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        if len(dict(pairs)) < len(pairs):
            raise ValueError("a name stands twice")
        return dict(pairs)

    value = json.loads(text, object_pairs_hook=once)
    return dict(value)


def _of_text(text: str) -> dict[str, Any]:
    """A line with a name, four lines of four numbers, and so on; # begins a comment."""
    found: dict[str, Any] = {}
    rows: list[list[float]] = []
    for line in text.splitlines():
        words = re.sub(r"[,;:\[\]]", " ", line.partition("#")[0]).split()
        if len(words) == 1:
            if words[0] in found:
                raise ValueError(f"{words[0]} stands twice")
            rows = found[words[0]] = []
        elif words:
            rows.append([float(word) for word in words])
            if not found:
                raise ValueError("a matrix has no name")
    return found


def _of_yaml(text: str) -> dict[str, Any]:
    storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    try:
        root = storage.root()
        return {label: _four_by_four(root.getNode(label)) for label in (root.keys() if root.isMap() else [])}
    finally:
        storage.release()


def _four_by_four(node: cv2.FileNode) -> Any:
    """The matrix of a node; None if it claims another size, for which memory would be taken before it is read."""
    sizes = [node.getNode(key) for key in ("rows", "cols")] if node.isMap() else []
    return node.mat() if sizes and all(size.isInt() and size.real() == 4 for size in sizes) else None


def _meant(label: str, file: Path) -> tuple[str, bool]:
    """The sensor that a matrix's name is about, and whether it maps into the sensor's frame."""
    before, after = _WORDS
    if label.startswith(before):
        return label.removeprefix(before), False
    if label.endswith(after):
        return label.removesuffix(after), True
    raise _fail(file, f"{label!r} does not tell which way it maps; call it world_from_{label} or {label}_from_world")


def _rigid(values: Any, label: str, file: Path) -> Floats:
    """The rigid transform (4, 4) nearest to the values, which were rounded when they were written."""
    try:
        matrix = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        matrix = np.zeros(0)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise _fail(file, f"{label!r} is not 4 rows of 4 numbers")
    if np.abs(matrix[3] - (0.0, 0.0, 0.0, 1.0)).max() > 1e-6:
        turned = np.abs(matrix[:, 3] - (0.0, 0.0, 0.0, 1.0)).max() < 1e-6
        raise _fail(
            file,
            f"{label!r} is made for row vectors (its shift stands in the last row); write it transposed"
            if turned
            else f"{label!r} does not end with the row 0 0 0 1",
        )
    rotation = matrix[:3, :3]
    size = float(np.cbrt(abs(np.linalg.det(rotation))))
    if size > 0.0 and abs(size - 1.0) > _ROUNDED and np.abs(_gram(rotation / size)).max() < _ROUNDED:
        raise _fail(file, f"{label!r} scales by {size:.4g}; lengths must be metres, and stay what they are")
    if np.abs(_gram(rotation)).max() > 2.0 * _ROUNDED:
        raise _fail(file, f"{label!r} is not a rotation and a shift (its axes are not square and of length 1)")
    if np.linalg.det(rotation) < 0.0:
        raise _fail(file, f"{label!r} mirrors: its axes are left-handed, a sensor's are x right, y down, z forward")
    left, _, right = np.linalg.svd(rotation)
    return transform(left @ right, matrix[:3, 3])


def _gram(rotation: Floats) -> Floats:
    return np.asarray(rotation @ rotation.T - np.eye(3))


def _fail(file: Path, problem: str) -> CalibrationError:
    return CalibrationError(problem, where=file, remedy=_REMEDY)
