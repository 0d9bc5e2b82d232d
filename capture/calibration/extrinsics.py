"""Where sensors stand, as a user's own calibration says: 4 x 4 matrices in a JSON, text or OpenCV YAML file.

Each is the rigid transform from the sensor's frame (x right, y down, z forward, metres) to one common frame, by the
sensor's name; ``sensor_from_world`` instead if the file says so. They are checked for being rigid and right-handed,
and by whether the sensors' clouds lie on each other.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np

from capture.calibration.calibrate import cloud_agreement
from capture.errors import CalibrationError
from capture.recording import Calibration, Recording, SensorCalibration
from capture.rigid import Floats, inverse

LARGEST_APART_M = 0.02
"""Clouds of one surface that lie farther apart than this are not where the matrices say."""
_LARGEST_FILE = 1 << 20
_RIGID = 1e-3
_MEET_M = 0.2  # clouds of one person, from whichever sides, come as near as this
_REMEDY = "give world_from_sensor, 4 x 4 in metres, by each sensor's name (docs/own-recording.md)"
_INVERSE = "sensor_from_world"


def calibrate_by_file(recording: Recording, file: Path) -> Calibration:
    """The calibration that a file of extrinsics gives a recording.

    Raises:
        CalibrationError: unreadable, sensors missing, not rigid, a mirror image, or the clouds lie apart.
    """
    poses = _refuse_strange(read_extrinsics(file), recording, file)
    sensors = {}
    for name, agreement in cloud_agreement(recording, poses).items():
        distance = agreement.apart
        far = distance is not None and distance.distance_m > LARGEST_APART_M + 2.0 * distance.deviation_m
        if far or agreement.score < 0.0 or agreement.gap_m > _MEET_M:
            told = "where they contradict each other"
            if distance is not None:
                told = f"{1e3 * distance.distance_m:.0f} mm apart"
            elif agreement.gap_m > _MEET_M:
                told = f"{agreement.gap_m:.2f} m apart"
            raise CalibrationError(
                f"puts the clouds of {name!r} and of the sensors before it {told}",
                where=file,
                remedy=f"are the matrices in metres, are they {_INVERSE} and say so, and did no sensor move since?",
            )
        details = {
            "apart_mm": None if distance is None else 1e3 * distance.distance_m,
            "apart_deviation_mm": None if distance is None else 1e3 * distance.deviation_m,
            "extrinsics": file.name,
        }
        sensors[name] = SensorCalibration(poses[name], 0.0, details)
    return Calibration(sensors)


def read_extrinsics(file: Path) -> dict[str, Floats]:
    """Matrices (4, 4) world_from_sensor by sensor; of a file without names, by "0", "1", ...

    Raises:
        CalibrationError: unreadable, or no matrices.
    """
    try:
        if file.stat().st_size > _LARGEST_FILE:
            raise CalibrationError("is too large for a few matrices", where=file, remedy=_REMEDY)
        text = file.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise CalibrationError("cannot be read", where=file, remedy=_REMEDY) from error
    try:
        named, inverted = _parsed(text, file)
    except (ValueError, TypeError, KeyError, RecursionError, cv2.error) as error:
        raise CalibrationError("holds no 4 x 4 matrices", where=file, remedy=_REMEDY) from error
    if not named:
        raise CalibrationError("holds no 4 x 4 matrices", where=file, remedy=_REMEDY)
    for name, matrix in named.items():
        _refuse_not_rigid(name, matrix, file)
    return {name: inverse(matrix) if inverted else matrix for name, matrix in named.items()}


def _parsed(text: str, file: Path) -> tuple[dict[str, Floats], bool]:
    """Matrices by name, and whether they are ``sensor_from_world``."""
    if text.lstrip().startswith(("%YAML", "%yaml")):
        return _yaml(text), _INVERSE in text
    if text.lstrip().startswith(("{", "[")):
        return _json(json.loads(text)), _INVERSE in text
    return _plain(text), _INVERSE in text


def _json(value: object) -> dict[str, Floats]:
    """Matrices of an object by sensor (each a matrix, or an object that holds one), or of a list."""
    if isinstance(value, dict) and isinstance(value.get("sensors"), (dict, list)):
        value = value["sensors"]
    entries = value.items() if isinstance(value, dict) else ((str(k), entry) for k, entry in enumerate(value))  # type: ignore[arg-type, var-annotated]
    found = {}
    for name, entry in entries:
        if isinstance(entry, dict):
            name = entry.get("name", name)
            entry = next(
                v for key, v in entry.items() if key in ("world_from_sensor", _INVERSE, "matrix", "extrinsics")
            )
        if isinstance(entry, list):
            found[str(name)] = np.array(entry, dtype=np.float64).reshape(4, 4)
    return found


def _yaml(text: str) -> dict[str, Floats]:
    storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    try:
        root = storage.root()
        nodes = {name: root.getNode(name) for name in root.keys()}  # noqa: SIM118 - a FileNode, no dictionary
        matrices = {name: node.mat() for name, node in nodes.items() if node.isMap()}
    finally:
        storage.release()
    return {
        name.removeprefix("world_from_").removeprefix("T_"): np.asarray(matrix, dtype=np.float64)
        for name, matrix in matrices.items()
        if matrix is not None and matrix.shape == (4, 4)
    }


def _plain(text: str) -> dict[str, Floats]:
    """Blocks of 16 numbers; a line with a word before a block is the sensor's name."""
    found: dict[str, list[float]] = {}
    name = "0"
    for line in text.splitlines():
        words = re.split(r"[\s,;]+", line.partition("#")[0].strip())
        if words == [""]:
            continue
        try:
            numbers = [float(word) for word in words if word]
        except ValueError:
            name = words[0].rstrip(":")
            continue
        if len(found.get(name, [])) == 16:
            name = str(len(found))
        found.setdefault(name, []).extend(numbers)
    return {sensor: np.array(values).reshape(4, 4) for sensor, values in found.items()}


def _refuse_not_rigid(name: str, matrix: Floats, file: Path) -> None:
    rotation = matrix[:3, :3]
    if not np.isfinite(matrix).all() or np.abs(matrix[3] - (0.0, 0.0, 0.0, 1.0)).max() > _RIGID:
        raise CalibrationError(f"the matrix of {name!r} is no rigid transform", where=file, remedy=_REMEDY)
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > _RIGID:
        scale = float(np.cbrt(abs(np.linalg.det(rotation))))
        raise CalibrationError(
            f"the matrix of {name!r} does not only turn: it scales by {scale:.3g} or shears", where=file, remedy=_REMEDY
        )
    if np.linalg.det(rotation) < 0.0:
        raise CalibrationError(
            f"the matrix of {name!r} is left-handed: it mirrors", where=file, remedy="use right-handed axes"
        )


def _refuse_strange(poses: Mapping[str, Floats], recording: Recording, file: Path) -> dict[str, Floats]:
    """The poses (4, 4) of just the recording's sensors, exactly rigid; unnamed ones in the recording's order."""
    names = [sensor.name for sensor in recording.sensors]
    if not set(names) <= set(poses) and list(poses) == [str(k) for k in range(len(names))]:
        poses = dict(zip(names, poses.values(), strict=True))
    missing = [name for name in names if name not in poses]
    if missing:
        raise CalibrationError(
            f"has no matrix of sensor {missing[0]!r} (it has {', '.join(poses)})", where=file, remedy=_REMEDY
        )
    exact = {}
    for name in names:
        u, _, v = np.linalg.svd(poses[name][:3, :3])
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = u @ v, poses[name][:3, 3]
        exact[name] = pose
    return exact
