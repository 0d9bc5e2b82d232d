"""Azure Kinect's ``.mkv`` recordings: a DEPTH track of big-endian 16-bit millimetres, the factory's calibration inside.

Times of images are those of the device's clock less what it said at the start, which a tag tells: with it, files of
devices that a sync cable joined are on one clock.
Sources: the recording file format and ``k4a_calibration`` of the Azure Kinect Sensor SDK's documentation; which part
of the sensor an image mode shows is in its ``mode_specific_calibration.c``. The lens model is OpenCV's rational one
(k1 to k6, p1, p2), which ``Camera`` knows: depth keeps its pixels, and rays are undistorted where points are made.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.camera import Camera, ray_slopes
from capture.errors import RecordingError
from capture.importers.source import (
    ColourFrame,
    DepthFrame,
    Frames,
    Source,
    UserCamera,
    check_size,
    damaged,
    no_depth,
    optional_module,
)
from capture.recording import Colour, Sensor
from capture.recording.checked_json import Checked
from capture.rigid import Floats, inverse, transform

_DEPTH_MODES = {
    (320, 288): (512, 96, 90),
    (640, 576): (1024, 192, 180),
    (512, 512): (512, 0, 0),
    (1024, 1024): (1024, 0, 0),
}
"""Image size: side of the whole (binned) sensor's image, and where in it the image begins (px)."""

_COLOUR_ASPECT = 3.0 / 4.0
"""The colour sensor is 4:3; wider images are cut out of its middle."""

_HEADER, _SEGMENT = b"\x1a\x45\xdf\xa3", b"\x18\x53\x80\x67"

_LARGEST_CALIBRATION = 2**20

_START = re.compile(r"[0-9]{1,18}")


def open_mkv(path: Path, stated: UserCamera) -> Source:
    """A recording made by ``k4arecorder`` or another program on the Sensor SDK.

    Raises:
        RecordingError: no such recording; no depth; no calibration and no focal length stated; damaged.
    """
    _check_whole(path)
    with _container(path) as container:
        depth = _track(container, "DEPTH")
        if depth is None:
            titles = ", ".join(sorted(str(stream.metadata.get("title", stream.type)) for stream in container.streams))
            raise no_depth(path, f"its tracks are {titles}" if titles else "it has no tracks")
        width, height = int(depth.width), int(depth.height)
        if depth.codec_context.format is None or depth.codec_context.format.name != "gray16be":
            raise RecordingError(
                "has a depth track that is not 16-bit grey (b16g)", where=path, remedy="record it with k4arecorder"
            )
        check_size(width, height, where=path)
        calibration = _calibration(container, path)
        own = None if calibration is None else _depth_camera(calibration, width, height)
        camera = stated.camera(width, height, own=own, where=path)
        radius = math.inf if own is None or camera is not own or calibration is None else _radius(calibration)
        colour = _colour(_track(container, "COLOR"), calibration)
        clock = _clock(container)
    sensor = Sensor("sensor", camera, stated.unit(None), stated.depth_range_m, colour=colour)
    frames = _frames(path, camera, radius, start_s=clock.start_s, with_colour=colour is not None)
    return Source(sensor, frames, times=clock.words, alone=clock.alone)


@dataclass(frozen=True)
class _Clock:
    """The device's clock: what it said (s) when the file's times were 0, and what its wired synchronisation was."""

    start_s: float
    sync: str

    @property
    def words(self) -> str:
        sync = f", wired sync {self.sync}" if self.sync else ""
        return f"the file (the device's clock from {self.start_s:.6f} s on{sync})"

    @property
    def alone(self) -> str:
        """Why no other file shares the clock; a file that does not say may have been synchronised."""
        return "was recorded STANDALONE, by a clock of its own" if self.sync == "STANDALONE" else ""


def _clock(container: Any) -> _Clock:
    """What the tags say; times of images hold the delays between cameras already, so that their tags add nothing."""
    tags = container.metadata
    start = tags.get("K4A_START_OFFSET_NS", "")
    sync = tags.get("K4A_WIRED_SYNC_MODE", "")
    known = sync in {"STANDALONE", "MASTER", "SUBORDINATE"}
    return _Clock(int(start) * 1e-9 if _START.fullmatch(start) else 0.0, sync if known else "")


def _frames(path: Path, camera: Camera, radius: float, *, start_s: float, with_colour: bool) -> Frames:
    width, height = camera.width, camera.height
    blind = ~has_rays(camera, radius)
    with _container(path) as container:
        depth = _track(container, "DEPTH")
        colour = _track(container, "COLOR") if with_colour else None
        for packet in container.demux([stream for stream in (depth, colour) if stream is not None]):
            if packet.pts is None or not packet.size:
                continue
            time_s = start_s + float(packet.pts * packet.time_base)
            data = bytes(packet)
            if packet.stream.index != depth.index:
                yield ColourFrame(time_s, data)
            elif len(data) != 2 * width * height:
                raise damaged(path, f"the depth image at {time_s:.3f} s has {len(data)} bytes")
            else:
                readings = np.frombuffer(data, dtype=">u2").reshape(height, width).astype(np.uint16)
                readings[blind] = 0
                yield DepthFrame(time_s, readings)


def has_rays(camera: Camera, radius: float) -> NDArray[np.bool_]:
    """The pixels (H, W) whose rays the lens model tells: of slopes within ``radius``, and coming back to the pixel.

    The corners of wide images lie outside of what the model was fitted to (the calibration's metric radius), and the
    lens lets nothing through there; should a reading stand there all the same, nobody knows where it points.

    >>> has_rays(Camera(5, 1, 2.0, 2.0, 2.0, 0.0), 0.7).tolist()  # slopes of -1, -0.5, 0, 0.5 and 1
    [[False, True, True, True, False]]
    """
    from capture.projection import project  # compiled loops: only these files need them

    slopes = ray_slopes(camera).reshape(-1, 2).astype(np.float64)
    pixels, _ = project(camera, np.column_stack([slopes, np.ones(len(slopes))]))
    v, u = np.mgrid[: camera.height, : camera.width]
    off = np.abs(pixels - np.stack([u, v], axis=-1).reshape(-1, 2)).max(axis=1)
    known = (off < 0.5) & (np.hypot(*slopes.T) <= radius)
    return np.asarray(known).reshape(camera.height, camera.width)


def _check_whole(path: Path) -> None:
    """Refuse a file that is shorter than its segment says; the library would give the frames that are left, silently.

    Matroska elements (RFC 8794): an identifier, a length whose leading zero bits tell how many bytes it takes (all
    ones: not known), the content. The file is a header and a segment.
    """
    with path.open("rb") as file:
        head = file.read(256)
        present = file.seek(0, 2)
    at, length = _element(head, 0, path)
    at, length = _element(head, at + length, path)
    if at + length > present:
        raise damaged(path, f"{at + length - present} bytes are missing at its end")


def _element(head: bytes, at: int, path: Path) -> tuple[int, int]:
    """Where the content of the element at ``at`` begins, and how long it is."""
    identifier, size = head[at : at + 4], head[at + 4 : at + 12]
    if identifier not in (_HEADER, _SEGMENT) or not size or not size[0]:
        raise damaged(path, "it has no segment")
    width = 9 - size[0].bit_length()
    value = int.from_bytes(size[:width], "big") & ((1 << 7 * width) - 1)
    return at + 4 + width, 0 if value == (1 << 7 * width) - 1 else value


@contextmanager
def _container(path: Path) -> Iterator[Any]:
    """The opened file; whatever the library raises inside the block becomes one line about the file."""
    av = optional_module("av", extra="azure-kinect", where=path)
    try:
        with av.open(str(path), format="matroska") as container:
            yield container
    except (av.error.FFmpegError, ValueError, OverflowError, MemoryError, UnicodeError) as error:
        raise damaged(path, getattr(error, "strerror", None) or error) from error


def _track(container: Any, title: str) -> Any:
    """The track of that title, or the one that the file's tags call so; None if there is none."""
    for stream in container.streams.video:
        if stream.metadata.get("title") == title or f"K4A_{title}_TRACK" in stream.metadata:
            return stream
    return None


def _calibration(container: Any, path: Path) -> Checked | None:
    """The factory's calibration, attached as ``calibration.json``."""
    for stream in container.streams:
        if stream.type == "attachment" and stream.metadata.get("filename") == "calibration.json":
            return _parsed(bytes(stream.data or b""), path)
    return None


def _parsed(data: bytes, path: Path) -> Checked:
    try:
        if len(data) > _LARGEST_CALIBRATION:
            raise ValueError("it is too long")
        value = json.loads(data.rstrip(b"\0"))
    except (ValueError, RecursionError) as error:
        raise RecordingError(
            f"has a calibration that is not valid JSON ({error})", where=path, remedy="state the camera with --fx"
        ) from error
    if not isinstance(value, dict):
        raise RecordingError("has a calibration that is not a JSON object", where=path, remedy="record it again")
    return Checked(value, path).object("CalibrationInformation")


def _camera_entry(calibration: Checked, place: str) -> Checked:
    for entry in calibration.objects("Cameras"):
        if entry.value.get("Location") == f"CALIBRATION_CameraLocation{place}":
            return entry
    raise calibration.fail(f"the calibration has no camera at {place}")


def _depth_camera(calibration: Checked, width: int, height: int) -> Camera:
    entry = _camera_entry(calibration, "D0")
    if (width, height) not in _DEPTH_MODES:
        raise entry.fail(f"has depth images of {width} x {height} px, which no mode of the sensor makes")
    side, left, top = _DEPTH_MODES[width, height]
    return _pinhole(entry, (width, height), scale=(side, side), begin=(left, top))


def _radius(calibration: Checked) -> float:
    """The largest slope of a ray for which the lens model was fitted; without end if the calibration does not say."""
    entry = _camera_entry(calibration, "D0")
    radius = entry.number("MetricRadius") if "MetricRadius" in entry.value else 0.0
    return radius if radius > 0.0 else math.inf


def _pinhole(
    entry: Checked, size: tuple[int, int], *, scale: tuple[float, float], begin: tuple[float, float]
) -> Camera:
    """The camera of an image that shows the part of the whole sensor from ``begin`` on (px)."""
    lens = entry.object("Intrinsics")
    if lens.text("ModelType") != "CALIBRATION_LensDistortionModelBrownConrady":
        raise lens.fail(f"has a lens model that is not known ({lens.text('ModelType')})")
    parameters = lens.numbers("ModelParameters")
    if len(parameters) < 14:
        raise lens.fail(f"the lens has {len(parameters)} parameters, not 14")
    cx, cy, fx, fy, k1, k2, k3, k4, k5, k6, away_x, away_y, p2, p1 = parameters[:14]
    if away_x or away_y or fx <= 0.0 or fy <= 0.0:
        raise lens.fail("has a lens with a centre of distortion of its own, or without focal length")
    # The file counts from the corner of the corner pixel, OpenCV from its centre.
    return Camera(
        *size,
        fx=fx * scale[0],
        fy=fy * scale[1],
        cx=cx * scale[0] - begin[0] - 0.5,
        cy=cy * scale[1] - begin[1] - 0.5,
        distortion=(k1, k2, p1, p2, k3, k4, k5, k6),
    )


def _colour(track: Any, calibration: Checked | None) -> Colour | None:
    """The colour camera, if its images are whole JPEG files; other codecs are not kept."""
    if track is None or track.codec_context is None or track.codec_context.name != "mjpeg":
        return None
    if calibration is None:
        return Colour()
    entry = _camera_entry(calibration, "PV0")
    width, height = int(track.width), int(track.height)
    whole = (float(width), width * _COLOUR_ASPECT)
    camera = _pinhole(entry, (width, height), scale=whole, begin=(0.0, (whole[1] - height) / 2.0))
    to_colour, to_depth = _pose(entry), _pose(_camera_entry(calibration, "D0"))
    return Colour(camera, to_colour @ inverse(to_depth))


def _pose(entry: Checked) -> Floats:
    """What maps points of the calibration's reference frame into the camera's (4, 4), metres."""
    placed = entry.object("Rt")
    rotation = np.array(placed.numbers("Rotation", count=9)).reshape(3, 3)
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-3 or np.linalg.det(rotation) < 0.0:
        raise placed.fail("the calibration's rotation of a camera is none")
    u, _, vt = np.linalg.svd(rotation)  # the file's numbers are rounded to single precision
    return transform(u @ vt, np.array(placed.numbers("Translation", count=3)))
