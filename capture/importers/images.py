"""Depth images without a description: folders of PNG images, raw 16-bit dumps.

Neither tells when a frame was taken or what the camera was, so both are asked for; a nominal rate stands for times
that nobody knows.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from capture.camera import Camera
from capture.errors import RecordingError
from capture.importers.source import DEPTH_RANGE_M, NOMINAL_FPS, DepthFrame, Source, Stated, check_size
from capture.recording import Recording, RecordingWriter, Sensor, depth_png, open_recording

Kind = Literal["png", "raw"]
"""What the files hold; see ``import_images``."""

RAW_SIZE = (640, 480)
"""Columns and rows of a raw image unless stated otherwise."""

_BYTES_PER_READING = 2

_POINTER = b"version https://git-lfs.github.com/spec/"
_LARGEST_POINTER = 1024


def import_images(
    files: Sequence[Path],
    out: Path,
    *,
    kind: Kind,
    camera: Camera,
    depth_unit_m: float,
    fps: float = NOMINAL_FPS,
    sensor_name: str = "sensor",
    depth_range_m: tuple[float, float] = DEPTH_RANGE_M,
    overwrite: bool = False,
) -> Recording:
    """Make a one-sensor recording of depth images, in the order given; frame k was taken at k / fps.

    Of kind ``png``, a file is one 16-bit grey image; of kind ``raw``, one or more whole images, 16-bit little endian,
    row by row.

    Raises:
        RecordingError: a file that is not what its kind says, or not of the camera's size, or ``out`` is in use.
    """
    sensor = Sensor(sensor_name, camera, depth_unit_m, depth_range_m)
    created_by = f"bonetrack import of {files[0].parent.name}, times by {rate_in_words(fps)}"
    with RecordingWriter(out, sensors=[sensor], created_by=created_by, overwrite=overwrite) as writer:
        for frame in _frames(files, kind, camera, fps):
            writer.add_frame(sensor.name, frame.readings, frame.time_s)
    return open_recording(out)


def open_png(source: Path, stated: Stated) -> Source:
    """A PNG image, or a folder of them.

    Raises:
        RecordingError: there is none, the first is no 16-bit grey PNG, or no focal length is stated.
    """
    files = natural_order(source_files(source, stated.pattern or "*.png"))
    width, height = depth_png.image_size(files[0])
    return _source(files, "png", stated.camera(width, height, own=None, where=source), stated)


def open_raw(source: Path, stated: Stated) -> Source:
    """A raw dump, or a folder of them.

    Raises:
        RecordingError: there is none, or no focal length is stated.
    """
    files = natural_order(source_files(source, stated.pattern or "*"))
    width, height = stated.size or RAW_SIZE
    check_size(width, height, where=source)
    return _source(files, "raw", stated.camera(width, height, own=None, where=source), stated)


def _source(files: Sequence[Path], kind: Kind, camera: Camera, stated: Stated) -> Source:
    fps = stated.fps or NOMINAL_FPS
    sensor = Sensor("sensor", camera, stated.unit(None), stated.depth_range_m)
    return Source(sensor, _frames(files, kind, camera, fps), times=rate_in_words(fps), count=len(files))


def rate_in_words(fps: float) -> str:
    """Where times come from that nobody knows."""
    return f"a nominal rate of {fps:g} Hz"


def _frames(files: Sequence[Path], kind: Kind, camera: Camera, fps: float) -> Iterator[DepthFrame]:
    images = (image for file in files for image in _READERS[kind](file, camera))
    for index, image in enumerate(images):
        yield DepthFrame(index / fps, image)


def source_files(source: Path, pattern: str) -> list[Path]:
    """The file itself, or the files of a folder that match the pattern.

    Raises:
        RecordingError: there is none.
    """
    if source.is_file():
        return [source]
    files = [file for file in source.glob(pattern) if file.is_file()] if source.is_dir() else []
    if not files:
        problem = f"has no files like {pattern}" if source.is_dir() else "does not exist"
        raise RecordingError(problem, where=source, remedy="name the folder that holds the depth images")
    for file in files:
        refuse_pointer(file)
    return files


def refuse_pointer(file: Path) -> None:
    """Refuse a file that Git LFS left in place of another.

    Raises:
        RecordingError: it is one.
    """
    if file.stat().st_size > _LARGEST_POINTER:
        return
    with file.open("rb") as opened:
        if opened.read(len(_POINTER)) == _POINTER:
            raise RecordingError(
                "is a Git LFS pointer, a few lines that stand for the file itself",
                where=file,
                remedy="fetch the file with `git lfs pull`",
            )


def natural_order(files: Iterable[Path]) -> list[Path]:
    """Files sorted by name, numbers in names by their value: 20.png before 100.png."""

    def key(file: Path) -> list[tuple[int, str]]:
        return [(int(part), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d+)", file.name)]

    return sorted(files, key=key)


def _png_image(file: Path, camera: Camera) -> Iterator[NDArray[np.uint16]]:
    yield depth_png.read_readings(file, width=camera.width, height=camera.height)


def _raw_images(file: Path, camera: Camera) -> Iterator[NDArray[np.uint16]]:
    image_bytes = camera.width * camera.height * _BYTES_PER_READING
    try:
        size = file.stat().st_size
        if size == 0 or size % image_bytes:
            raise RecordingError(
                f"has {size} bytes, not a whole number of {camera.width} x {camera.height} 16-bit images "
                f"({image_bytes} bytes each)",
                where=file,
                remedy="give the right image size, or a pattern that leaves the file out",
            )
        with file.open("rb") as stream:
            for _ in range(size // image_bytes):
                readings = np.frombuffer(stream.read(image_bytes), dtype="<u2")
                yield readings.reshape(camera.height, camera.width).astype(np.uint16)
    except OSError as error:
        problem = f"cannot be read ({error.strerror})"
        raise RecordingError(problem, where=file, remedy="check the file and its permissions") from error


_READERS: dict[Kind, Callable[[Path, Camera], Iterator[NDArray[np.uint16]]]] = {"png": _png_image, "raw": _raw_images}
