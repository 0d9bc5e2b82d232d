"""Writing a recording folder frame by frame, so that one that was never finished cannot be mistaken for whole."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from capture.errors import RecordingError
from capture.files import naming, replaced_when_complete
from capture.own import json_of, refuse_foreign
from capture.recording import colour_image, depth_png
from capture.recording.read import open_recording
from capture.recording.room import make_room
from capture.recording.types import (
    BOX_FRAMES_FILE,
    CALIBRATION_FILE,
    CALIBRATION_FORMAT,
    COLOUR_FRAMES_FILE,
    FORMAT,
    FRAMES_FILE,
    HEADER_FILE,
    TRUTH_FILE,
    UNFINISHED_FILE,
    VERSION,
    Calibration,
    Colour,
    Region,
    Sensor,
)

_LARGEST_READING = 65535


class RecordingWriter:
    """Writes a recording; a context manager.

    ``recording.json`` is written last, when the block ends without an error: until then a file of another name
    marks the folder as unfinished, and ``open_recording`` says so. Frames reach the disk as they are added.

    Args:
        path: the folder to make.
        sensors: what the sensors are; their frames are ignored (``add_frame`` gives them).
        created_by: which program or person made the recording.
        overwrite: replace a recording that stands there already; one that was never finished is replaced anyway.

    Raises:
        RecordingError, OutputError: the folder holds something already that may not be replaced.
    """

    def __init__(
        self, path: Path | str, *, sensors: Sequence[Sensor], created_by: str, overwrite: bool = False
    ) -> None:
        self.path = Path(path)
        self._sensors = {sensor.name: sensor for sensor in sensors}
        self._last_times: dict[tuple[str, str], tuple[int, float]] = {}
        self._header: dict[str, Any] = {
            "format": FORMAT,
            "version": VERSION,
            "created_by": created_by,
            "sensors": [_sensor_entry(sensor) for sensor in sensors],
            "box": None,
            "region": None,
        }
        make_room(self.path, list(self._sensors), overwrite=overwrite)

    def __enter__(self) -> Self:
        _write_json(self.path / UNFINISHED_FILE, self._header)
        for name in self._sensors:
            (self.path / name).mkdir(exist_ok=True)
            (self.path / name / FRAMES_FILE).write_text("file,time_s\n", encoding="utf-8")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if kind is not None:
            return
        _write_json(self.path / HEADER_FILE, self._header)
        (self.path / UNFINISHED_FILE).unlink()
        open_recording(self.path)

    def add_frame(self, sensor: str, depth: NDArray[np.generic], time_s: float) -> None:
        """Add the next frame of a sensor: (H, W), raw readings if uint16, metres if floating point.

        In metres, values that are not finite, not positive or too large to be written become 0 (no reading).

        Raises:
            RecordingError: the image does not fit the camera, or time does not increase.
        """
        self._add(sensor, depth, time_s, list_name=FRAMES_FILE, prefix="")

    def add_box_frame(self, sensor: str, depth: NDArray[np.generic], time_s: float) -> None:
        """Add the next frame that shows the calibration box; as ``add_frame``."""
        self._add(sensor, depth, time_s, list_name=BOX_FRAMES_FILE, prefix="box-")

    def add_colour(self, sensor: str, image: NDArray[np.uint8] | bytes, time_s: float) -> None:
        """Add the next colour image of a sensor: (H, W, 3) in blue, green, red, or the bytes of a JPEG or PNG file.

        Raises:
            RecordingError: it is no such image, or time does not increase.
        """
        home = self.path / sensor
        suffix, data = colour_image.encoded(image, where=home / COLOUR_FRAMES_FILE)
        index = self._next_index(sensor, COLOUR_FRAMES_FILE, time_s)
        file = f"colour-{index:06d}{suffix}"
        with replaced_when_complete(home / file) as partial:
            partial.write_bytes(data)
        self._list(sensor, COLOUR_FRAMES_FILE, index, file, time_s)

    def tell(self, words: str) -> None:
        """Add to what is said of who made the recording, and how."""
        self._header["created_by"] += f"; {words}"

    def set_box(self, size_m: tuple[float, float, float]) -> None:
        """Tell the size of the calibration box (m)."""
        self._header["box"] = {"size_m": [float(side) for side in size_m]}

    def set_region(self, region: Region) -> None:
        """Tell where in the common frame the person is."""
        self._header["region"] = {"min": list(map(float, region.minimum)), "max": list(map(float, region.maximum))}

    def set_truth(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Keep the known truth of a simulated recording: arrays by name, units in the names."""
        with replaced_when_complete(self.path / TRUTH_FILE) as partial:
            np.savez_compressed(partial, allow_pickle=False, **dict(arrays))

    def _add(self, name: str, depth: NDArray[np.generic], time_s: float, *, list_name: str, prefix: str) -> None:
        sensor = self._sensors[name]
        index = self._next_index(name, list_name, time_s)
        readings = _readings(depth, sensor, where=self.path / name / list_name, index=index)
        file = f"{prefix}{index:06d}.png"
        depth_png.write_readings(self.path / name / file, readings)
        self._list(name, list_name, index, file, time_s)

    def _next_index(self, name: str, list_name: str, time_s: float) -> int:
        index, last = self._last_times.get((name, list_name), (0, -math.inf))
        if not (math.isfinite(time_s) and time_s > last):
            raise RecordingError(
                f"frame {index}: time {time_s:g} s does not come after {last:g} s",
                where=self.path / name / list_name,
                remedy="add frames in the order of time",
            )
        return index

    def _list(self, name: str, list_name: str, index: int, file: str, time_s: float) -> None:
        file_list = self.path / name / list_name
        with naming(file_list), file_list.open("a", encoding="utf-8") as frames:
            if index == 0 and frames.tell() == 0:
                frames.write("file,time_s\n")
            frames.write(f"{file},{float(time_s)!r}\n")
        self._last_times[name, list_name] = (index + 1, time_s)


def write_calibration_file(path: Path, calibration: Calibration) -> None:
    """Write the calibration of a recording into its folder ``path``.

    Raises:
        OutputError: something else than a calibration stands there.

    >>> from tempfile import TemporaryDirectory
    >>> from capture.recording import SensorCalibration
    >>> with TemporaryDirectory() as folder:
    ...     write_calibration_file(Path(folder), Calibration({"left": SensorCalibration(np.eye(4), 0.8)}))
    ...     json.loads(Path(folder, CALIBRATION_FILE).read_text())["sensors"]["left"]["residual_mm"]
    0.8
    """
    refuse_foreign(path / CALIBRATION_FILE, json_of(CALIBRATION_FORMAT))
    sensors = {
        name: {
            "world_from_sensor": sensor.world_from_sensor.tolist(),
            "residual_mm": None if sensor.residual_mm is None else float(sensor.residual_mm),
            **sensor.details,
        }
        for name, sensor in calibration.sensors.items()
    }
    content = {"format": CALIBRATION_FORMAT, "version": VERSION, "sensors": sensors}
    _write_json(path / CALIBRATION_FILE, content)


def _sensor_entry(sensor: Sensor) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "name": sensor.name,
        "camera": asdict(sensor.camera),
        "depth_unit_m": sensor.depth_unit_m,
        "depth_range_m": list(sensor.depth_range_m),
    }
    if sensor.mirrored:
        entry["mirrored"] = True
    if sensor.colour is not None:
        entry["colour"] = _colour_entry(sensor.colour)
    return entry


def _colour_entry(colour: Colour) -> dict[str, Any]:
    return {
        "camera": None if colour.camera is None else asdict(colour.camera),
        "colour_from_depth": None if colour.colour_from_depth is None else colour.colour_from_depth.tolist(),
    }


def _readings(depth: NDArray[np.generic], sensor: Sensor, *, where: Path, index: int) -> depth_png.Readings:
    """Raw readings (H, W) of an image given as readings or in metres."""
    camera = sensor.camera
    if depth.shape != (camera.height, camera.width):
        raise RecordingError(
            f"frame {index}: expected an image of {camera.height} x {camera.width} values, got {depth.shape}",
            where=where,
            remedy="give images of the camera's size",
        )
    if depth.dtype == np.uint16:
        return np.ascontiguousarray(depth, dtype=np.uint16)
    if not np.issubdtype(depth.dtype, np.floating):
        raise RecordingError(
            f"frame {index}: expected uint16 or floating point, got {depth.dtype}",
            where=where,
            remedy="give readings, or metres",
        )
    scaled = np.rint(depth.astype(np.float64) / sensor.depth_unit_m)
    return np.where((scaled > 0.0) & (scaled <= _LARGEST_READING), scaled, 0.0).astype(np.uint16)


def _write_json(path: Path, content: dict[str, Any]) -> None:
    with replaced_when_complete(path) as partial:
        partial.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
