"""RealSense recordings: what the ``.bag`` and the ``.db3`` files of the SDK have in common.

Both name things the same way: ``/device_0/sensor_0/Depth_0/...``. The SDK's own player is not used: it loses frames of
truncated files without a word, and some damaged files end the whole process.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from capture.camera import Camera
from capture.errors import RecordingError
from capture.importers.source import Frames, Source, UserCamera
from capture.recording import Colour, Sensor
from capture.rigid import Floats, inverse

DEPTH_TOPIC = r"/device_\d+/sensor_\d+/Depth_\d+"
COLOUR_TOPIC = r"/device_\d+/sensor_\d+/Color_\d+"

_FORWARD = {"Brown Conrady", "Modified Brown Conrady", "plumb_bob"}
_BACKWARD = {"Inverse Brown Conrady"}
_LARGEST_MISFIT_PX = 0.5
_OWN = "Hardware Clock"
_CLOCKS = {
    _OWN: " (the camera's own clock, which no other camera shares)",
    "System Time": " (the computer's time when the frames arrived)",
    "Global Time": " (the camera's clock in the computer's time)",
}
"""By the SDK's name: whose times they are."""


@dataclass(frozen=True)
class Lens:
    """A camera as the SDK tells it: intrinsics (px), the name of the distortion model, its five coefficients."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    model: str
    coefficients: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Streams:
    """What a file tells beside its frames; ``depth_unit_m`` None if it does not say; poses map from one reference.

    ``clock`` is what the SDK calls the domain of the times, as "Hardware Clock"; empty if it does not say.
    """

    depth: Lens
    depth_unit_m: float | None
    colour: Lens | None
    depth_from_reference: Floats | None
    colour_from_reference: Floats | None
    clock: str = ""


def as_source(streams: Streams, frames: Frames, path: Path, stated: UserCamera, *, count: int) -> Source:
    """The source that a file's streams and frames make.

    Raises:
        RecordingError: no usable camera in the file and none stated.
    """
    lens = streams.depth
    own = None if stated.fx is not None else camera_of(lens, path)
    camera = stated.camera(lens.width, lens.height, own=own, where=path)
    colour = None
    if streams.colour is not None:
        poses = streams.depth_from_reference, streams.colour_from_reference
        moved = None if poses[0] is None or poses[1] is None else poses[1] @ inverse(poses[0])
        colour = Colour(_camera_or_none(streams.colour, path), moved)
    sensor = Sensor("sensor", camera, stated.unit(streams.depth_unit_m), stated.depth_range_m, colour=colour)
    clock = _CLOCKS.get(streams.clock, "")
    alone = "has times by the camera's own clock" if streams.clock == _OWN else ""
    return Source(sensor, frames, times=f"the file{clock}", count=count, alone=alone)


def camera_of(lens: Lens, path: Path) -> Camera:
    """The camera in OpenCV's model.

    >>> camera_of(Lens(848, 480, 420.0, 420.0, 424.0, 240.0, "Kannala Brandt", (0.0,) * 5), Path("a.bag")).distortion
    ()
    >>> camera_of(Lens(848, 480, 420.0, 420.0, 424.0, 240.0, "Kannala Brandt", (0.1,) * 5), Path("a.bag"))
    Traceback (most recent call last):
        ...
    capture.errors.RecordingError: a.bag: has a lens model that cannot be used (Kannala Brandt); ...

    Raises:
        RecordingError: a model that cannot be told in OpenCV's, or numbers that no lens has.
    """
    numbers = (lens.fx, lens.fy, lens.cx, lens.cy, *lens.coefficients)
    if not np.isfinite(numbers).all() or lens.fx <= 0.0 or lens.fy <= 0.0:
        raise RecordingError("has a camera without a focal length", where=path, remedy="state it with --fx (px)")
    plain = Camera(lens.width, lens.height, lens.fx, lens.fy, lens.cx, lens.cy)
    if not any(lens.coefficients):
        return plain
    if len(lens.coefficients) == 5 and lens.model in _FORWARD:
        return _with(plain, lens.coefficients)
    if len(lens.coefficients) == 5 and lens.model in _BACKWARD:
        return _inverted(plain, lens.coefficients, path)
    raise RecordingError(
        f"has a lens model that cannot be used ({lens.model})",
        where=path,
        remedy="state the camera with --fx and --distortion",
    )


def _camera_or_none(lens: Lens, path: Path) -> Camera | None:
    try:
        return camera_of(lens, path)
    except RecordingError:
        return None  # colour images are kept all the same


def _with(camera: Camera, coefficients: Sequence[float]) -> Camera:
    distortion = tuple(float(value) for value in coefficients)
    return Camera(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy, distortion)


def _inverted(camera: Camera, coefficients: Sequence[float], path: Path) -> Camera:
    """The forward distortion that undoes an inverse one.

    The inverse model is a polynomial from pixels to rays, as in the SDK's point cloud and its documentation (its
    ``rs2_deproject_pixel_to_point`` bends the other way: docs/formats.md), so the ray of each pixel is known exactly;
    the forward model is linear in its five coefficients, so those that send all rays back to their pixels are least
    squares.

    Raises:
        RecordingError: some pixel is missed by more than half a pixel.
    """
    v, u = np.mgrid[0 : camera.height : 8, 0 : camera.width : 8].astype(np.float64)
    x, y = ((u - camera.cx) / camera.fx).ravel(), ((v - camera.cy) / camera.fy).ravel()
    ray = np.stack([x, y]) + _terms(x, y) @ np.asarray(coefficients)
    terms = _terms(*ray)
    wanted = np.stack([x, y]) - ray
    forward = np.linalg.lstsq(terms.reshape(-1, 5), wanted.ravel(), rcond=None)[0]
    missed = np.abs(terms @ forward - wanted) * [[camera.fx], [camera.fy]]
    if not missed.max() <= _LARGEST_MISFIT_PX:
        raise RecordingError(
            f"has an inverse distortion that no forward one undoes (off by {missed.max():.2f} px)",
            where=path,
            remedy="state the camera with --fx and --distortion",
        )
    return _with(camera, forward)


def _terms(x: Floats, y: Floats) -> Floats:
    """What each of (k1, k2, p1, p2, k3) moves a point by, (2, N, 5): OpenCV's equations."""
    r2 = x * x + y * y
    along_x = np.stack([x * r2, x * r2**2, 2.0 * x * y, r2 + 2.0 * x * x, x * r2**3], axis=-1)
    along_y = np.stack([y * r2, y * r2**2, r2 + 2.0 * y * y, 2.0 * x * y, y * r2**3], axis=-1)
    return np.stack([along_x, along_y])
