"""What a recording is made of: plain data, and the names of the files that hold it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from capture.camera import Camera
from capture.rigid import Floats

FORMAT = "bonetrack-recording"
CALIBRATION_FORMAT = "bonetrack-calibration"
VERSION = 1

HEADER_FILE = "recording.json"
UNFINISHED_FILE = "recording.unfinished.json"
CALIBRATION_FILE = "calibration.json"
TRUTH_FILE = "truth.npz"
FRAMES_FILE = "frames.csv"
BOX_FRAMES_FILE = "box.csv"
COLOUR_FRAMES_FILE = "colour.csv"


@dataclass(frozen=True)
class FrameFile:
    """One depth image on disk and when it was taken (s)."""

    path: Path
    time_s: float


@dataclass(frozen=True, eq=False)
class Colour:
    """The colour camera beside a depth camera: intrinsics and (4, 4) pose relative to it (None: not known), images."""

    camera: Camera | None = None
    colour_from_depth: Floats | None = None
    frames: tuple[FrameFile, ...] = ()


@dataclass(frozen=True)
class Sensor:
    """One depth sensor: readings are multiples of ``depth_unit_m``, trusted inside ``depth_range_m`` (m).

    The images of a recording are always true ones; ``mirrored`` tells that the driver had mirrored them, left for
    right, and that they and the camera were turned back when they came in.
    """

    name: str
    camera: Camera
    depth_unit_m: float = 0.001
    depth_range_m: tuple[float, float] = (0.4, 4.0)
    frames: tuple[FrameFile, ...] = ()
    box_frames: tuple[FrameFile, ...] = ()
    colour: Colour | None = None
    mirrored: bool = False


@dataclass(frozen=True, eq=False)
class Region:
    """An axis-aligned box of the common frame: corners (3,) and (3,), metres."""

    minimum: Floats
    maximum: Floats


@dataclass(frozen=True, eq=False)
class SensorCalibration:
    """Where one sensor stands: (4, 4) rigid transform, residual of the box (mm; None if no box told), and whatever
    else was recorded about it."""

    world_from_sensor: Floats
    residual_mm: float | None
    details: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Calibration:
    """Where all sensors of a recording stand, by name."""

    sensors: Mapping[str, SensorCalibration]


@dataclass(frozen=True, eq=False)
class Recording:
    """A recording folder that has been checked: sensors, calibration box (m), region, calibration, who made it.

    ``mended`` says in words what was wrong with the folder and could be mended as it was opened.
    """

    path: Path
    sensors: tuple[Sensor, ...]
    box_size_m: tuple[float, float, float] | None = None
    region: Region | None = None
    calibration: Calibration | None = None
    created_by: str = ""
    mended: tuple[str, ...] = ()

    @property
    def common_frame_is_sensor(self) -> bool:
        """True if nobody calibrated and the only sensor's own frame serves as the common frame."""
        return self.calibration is None and len(self.sensors) == 1

    @property
    def truth_path(self) -> Path | None:
        """The known truth of a simulated recording, if it has one."""
        path = self.path / TRUTH_FILE
        return path if path.is_file() else None

    def sensor(self, name: str) -> Sensor:
        """The sensor of that name.

        Raises:
            KeyError: there is none.
        """
        for sensor in self.sensors:
            if sensor.name == name:
                return sensor
        raise KeyError(f"no sensor {name!r}; there are {', '.join(s.name for s in self.sensors)}")


@dataclass(frozen=True)
class Instant:
    """What the sensors saw at one time: a frame for each sensor that has one, by name."""

    time_s: float
    frames: Mapping[str, FrameFile]
