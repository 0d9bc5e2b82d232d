"""What every reader gives: one sensor and its frames, one by one, however large the file is."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from capture.camera import Camera
from capture.errors import RecordingError
from capture.recording import Sensor
from capture.recording.depth_png import LARGEST_PIXELS, LARGEST_SIDE

T = TypeVar("T")

LARGEST_READING = 65535
"""Readings have 16 bits."""

DEPTH_RANGE_M = (0.2, 4.0)
"""Readings of imported recordings are trusted in this range unless another is stated."""

NOMINAL_FPS = 30.0
"""The rate assumed when nobody knows when the frames were taken (Hz)."""

NO_CLOCK = "has times by a nominal rate"
"""Why such a source shares a clock with no other."""


@dataclass(frozen=True, eq=False)
class DepthFrame:
    """One depth image: readings (H, W) uint16 in the sensor's unit, time (s) on the file's own clock."""

    time_s: float
    readings: NDArray[np.uint16]


@dataclass(frozen=True, eq=False)
class ColourFrame:
    """One colour image: (H, W, 3) blue-green-red, or the bytes of a JPEG or PNG file; time as that of depth."""

    time_s: float
    image: NDArray[np.uint8] | bytes


Frames = Iterator[DepthFrame | ColourFrame]


@dataclass(frozen=True, eq=False)
class Source:
    """One sensor's file that has been opened.

    Attributes:
        sensor: what the sensor is; it is given its final name by who writes the recording.
        frames: depth and colour frames in the file's order, each kind in order of time; can be read once.
        times: where the times come from, to be told to people.
        count: how many depth frames there will be, if the file tells.
        alone: why its times are on no clock that another file could share; empty if they may be.
    """

    sensor: Sensor
    frames: Frames
    times: str
    count: int | None = None
    alone: str = ""


@dataclass(frozen=True)
class UserCamera:
    """What the user states of a camera and its files, to fill what a file does not tell or override what it does.

    Where a value is None, nothing is stated.

    Attributes:
        fx, fy, cx, cy: focal lengths and principal point (px) of the depth camera.
        distortion: OpenCV's coefficients in OpenCV's order.
        size: columns and rows of a raw image.
        depth_unit_m: what one step of a reading is worth.
        fps: nominal frame rate (Hz) of files without times.
        pattern: which files of a folder.
        mirrored: whether the images are mirrored, left for right; the camera is stated of the images as they are.
        axes: which way the axes of point clouds point, as ``x-right,y-up,z-back``.
        disparity: whether the readings are raw disparities of a Kinect for Xbox 360.
        depth_range_m: nearest and farthest depth to be trusted.
    """

    fx: float | None = None
    fy: float | None = None
    cx: float | None = None
    cy: float | None = None
    distortion: tuple[float, ...] = ()
    size: tuple[int, int] | None = None
    depth_unit_m: float | None = None
    fps: float | None = None
    pattern: str | None = None
    mirrored: bool = False
    axes: str | None = None
    disparity: bool = False
    depth_range_m: tuple[float, float] = DEPTH_RANGE_M

    def camera(self, width: int, height: int, *, own: Camera | None, where: Path) -> Camera:
        """The depth camera: as stated if a focal length is, else the file's own.

        Raises:
            RecordingError: neither is known, or the image size is impossible.
        """
        check_size(width, height, where=where)
        if self.fx is None:
            if own is None:
                raise RecordingError(
                    "does not tell the camera's focal length", where=where, remedy="state it with --fx (px)"
                )
            return own
        return Camera(
            width=width,
            height=height,
            fx=self.fx,
            fy=self.fx if self.fy is None else self.fy,
            cx=(width - 1) / 2.0 if self.cx is None else self.cx,
            cy=(height - 1) / 2.0 if self.cy is None else self.cy,
            distortion=self.distortion,
        )

    def unit(self, own: float | None) -> float:
        """One reading's worth (m): as stated, else the file's own, else a millimetre."""
        if self.depth_unit_m is not None:
            return self.depth_unit_m
        return 0.001 if own is None else own


def fine_unit(farthest_m: float) -> float:
    """The unit (m) in which depth that comes in other numbers than readings is kept: 0.1 mm, or more where that ends.

    >>> fine_unit(4.0), fine_unit(10.0)
    (0.0001, 0.001)
    """
    return 0.0001 if farthest_m <= 0.0001 * LARGEST_READING else 0.001


def check_size(width: int, height: int, *, where: Path) -> None:
    """Refuse an image size that no sensor has.

    >>> check_size(640, 0, where=Path("frame.raw"))
    Traceback (most recent call last):
        ...
    capture.errors.RecordingError: frame.raw: claims an impossible size of 640 x 0 px; ...

    Raises:
        RecordingError: it is impossible.
    """
    if not (0 < width <= LARGEST_SIDE and 0 < height <= LARGEST_SIDE and width * height <= LARGEST_PIXELS):
        raise RecordingError(
            f"claims an impossible size of {width} x {height} px",
            where=where,
            remedy="check --width and --height, or copy the file again",
        )


def optional_module(name: str, *, extra: str, where: Path) -> ModuleType:
    """Import a library that only some formats need.

    >>> optional_module("no_such_module", extra="import", where=Path("a.mkv"))
    Traceback (most recent call last):
        ...
    capture.errors.RecordingError: a.mkv: needs the Python package no_such_module, which is not installed; ...

    Raises:
        RecordingError: it is not installed; says how to install it.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise RecordingError(
            f"needs the Python package {name.partition('.')[0]}, which is not installed",
            where=where,
            remedy=f"pip install 'bonetrack[{extra}]'",
        ) from error


def damaged(where: Path, why: object = "") -> RecordingError:
    """The error to raise about a file that cannot be read as what it seems to be.

    >>> print(damaged(Path("a.oni"), "chunk 7"))
    a.oni: is truncated or damaged (chunk 7); record or copy it again
    """
    words = " ".join(str(why).split())[:120]
    return RecordingError(
        f"is truncated or damaged{f' ({words})' if words else ''}", where=where, remedy="record or copy it again"
    )


def the_only(streams: Sequence[T], where: Path) -> T | None:
    """The depth stream of a file, None if it has none.

    >>> the_only(["Depth_0"], Path("a.bag")), the_only([], Path("a.bag"))
    ('Depth_0', None)
    >>> the_only(["Depth_0", "Depth_1"], Path("a.bag"))
    Traceback (most recent call last):
        ...
    capture.errors.RecordingError: a.bag: has 2 depth streams; record each sensor into a file of its own

    Raises:
        RecordingError: it has several, and which is meant cannot be known.
    """
    if len(streams) > 1:
        raise RecordingError(
            f"has {len(streams)} depth streams", where=where, remedy="record each sensor into a file of its own"
        )
    return streams[0] if streams else None


def no_depth(where: Path, found: str) -> RecordingError:
    """The error to raise about a file that has other streams only."""
    return RecordingError(
        f"has no depth stream ({found})", where=where, remedy="record depth, too, or name another file"
    )
