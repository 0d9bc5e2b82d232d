"""Images that a driver mirrored, left for right, turned back: depth, colour, and the cameras that go with them.

libfreenect2 and OpenNI mirror their images unless told otherwise; a right hand in them is as good a left one, and
nothing in a depth image tells. With M = diag(-1, 1, 1) a point x of the mirrored scene is the point
M x of the true one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from capture.camera import Camera
from capture.errors import RecordingError
from capture.importers.source import ColourFrame, DepthFrame, Frames, Source
from capture.recording import Colour, Sensor, colour_image
from capture.rigid import Floats

_TURNED = {3, 8, 9, 13}
"""Coefficients of OpenCV's order that change their sign with x: p2, the thin prism's s1 and s2, the tilt about y."""

_MIRROR = np.diag([-1.0, 1.0, 1.0, 1.0])


def unmirrored(source: Source, path: Path) -> Source:
    """The true images of a source whose images (all of them: a driver mirrors depth and colour alike) are mirrored.

    Raises:
        RecordingError: while the frames are read, a colour image that cannot be decoded.
    """
    sensor = source.sensor
    colour = None if sensor.colour is None else _true_colour(sensor.colour)
    true: Sensor = replace(sensor, camera=unmirrored_camera(sensor.camera), colour=colour, mirrored=True)
    return replace(source, sensor=true, frames=_true_frames(source.frames, path))


def unmirrored_camera(camera: Camera) -> Camera:
    """The camera of the true image, for the camera of the mirrored one (and the other way round).

    >>> unmirrored_camera(Camera(640, 480, 580.0, 580.0, 300.0, 240.0)).cx
    339.0
    """
    distortion = tuple(-value if i in _TURNED else value for i, value in enumerate(camera.distortion))
    return replace(camera, cx=camera.width - 1 - camera.cx, distortion=distortion)


def _true_colour(colour: Colour) -> Colour:
    pose: Floats | None = colour.colour_from_depth
    return replace(
        colour,
        camera=None if colour.camera is None else unmirrored_camera(colour.camera),
        colour_from_depth=None if pose is None else _MIRROR @ pose @ _MIRROR,
    )


def _true_frames(frames: Frames, path: Path) -> Iterator[DepthFrame | ColourFrame]:
    for frame in frames:
        if isinstance(frame, DepthFrame):
            yield DepthFrame(frame.time_s, np.ascontiguousarray(frame.readings[:, ::-1]))
        else:
            yield ColourFrame(frame.time_s, true_picture(frame.image, path))


def true_picture(image: NDArray[np.uint8] | bytes, path: Path) -> NDArray[np.uint8]:
    """The pixels (H, W, 3) of a mirrored colour image, turned back; ``path`` is the file it came from.

    >>> true_picture(np.arange(6, dtype=np.uint8).reshape(1, 2, 3), Path("colour.png")).tolist()
    [[[3, 4, 5], [0, 1, 2]]]

    Raises:
        RecordingError: it is no whole JPEG or PNG.
    """
    if isinstance(image, bytes):
        colour_image.size(image, where=path)  # a decoder would believe whatever size the header claims
        decoded = cv2.imdecode(np.frombuffer(image, np.uint8), cv2.IMREAD_COLOR)
        if decoded is None:
            raise RecordingError(
                "holds a colour image that is no whole JPEG or PNG", where=path, remedy="record or copy it again"
            )
        image = np.asarray(decoded, dtype=np.uint8)
    return np.ascontiguousarray(image[:, ::-1])
