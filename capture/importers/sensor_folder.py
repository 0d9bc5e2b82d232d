"""One sensor's folder of a recording in bonetrack's own format, brought in by itself.

Its ``frames.csv`` tells which images are frames and when they were taken. Images of the calibration box and colour
images lie beside them and are left out: they would pass for depth images of the person. Where the camera stands is
told by the recording's header, not by the folder, so the camera is asked for.
"""

from __future__ import annotations

from pathlib import Path

from capture.bounded import read_head
from capture.errors import RecordingError
from capture.importers.images import source_of
from capture.importers.names import NamedTimes
from capture.importers.source import DepthFrame, Source, UserCamera
from capture.recording import Sensor, depth_png
from capture.recording.read import read_frame_list
from capture.recording.types import BOX_FRAMES_FILE, FRAMES_FILE

_HEAD_BYTES = 64


def is_sensor_folder(folder: Path) -> bool:
    """Whether a folder lists its depth images as a recording of bonetrack's does."""
    file = folder / FRAMES_FILE
    return file.is_file() and b"file,time_s" in read_head(file, _HEAD_BYTES)


def open_sensor_folder(folder: Path, stated: UserCamera) -> Source:
    """The depth images that the folder lists as frames.

    Raises:
        RecordingError: the list or an image is missing or wrong, or no focal length is stated.
    """
    listed = read_frame_list(folder / FRAMES_FILE)
    if not listed:
        raise RecordingError("lists no frames", where=folder / FRAMES_FILE, remedy="name another sensor's folder")
    words = FRAMES_FILE
    if (folder / BOX_FRAMES_FILE).is_file():
        words += f" (images of the box left out: {len(read_frame_list(folder / BOX_FRAMES_FILE))})"
    files, times = tuple(frame.path for frame in listed), tuple(frame.time_s for frame in listed)
    named = NamedTimes(files, times, words, clock=True)
    width, height = depth_png.image_size(files[0])
    camera = stated.camera(width, height, own=None, where=folder)
    sensor = Sensor("sensor", camera, stated.unit(None), stated.depth_range_m)
    frames = (
        DepthFrame(frame.time_s, depth_png.read_readings(frame.path, width=width, height=height)) for frame in listed
    )
    return source_of(named, sensor, frames)
