"""Depth images without a description: folders of PNG images, raw 16-bit dumps.

Neither tells what the camera was, so that is asked for. When a frame was taken stands in the names of files, or else a
nominal rate stands for times that nobody knows (``capture.importers.names``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from capture.camera import Camera
from capture.errors import RecordingError
from capture.importers.names import NamedTimes, named_times, rate_in_words
from capture.importers.source import (
    DEPTH_RANGE_M,
    NO_CLOCK,
    NOMINAL_FPS,
    DepthFrame,
    Frames,
    Source,
    UserCamera,
    check_size,
)
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


def open_png(source: Path, stated: UserCamera) -> Source:
    """A PNG image, or a folder of them.

    Raises:
        RecordingError: there is none, the first is no 16-bit grey PNG, or no focal length is stated.
    """
    named = named_times(source_files(source, stated.pattern or "*.png"), stated.fps)
    width, height = depth_png.image_size(named.files[0])
    return _source(named, "png", stated.camera(width, height, own=None, where=source), stated)


def open_raw(source: Path, stated: UserCamera) -> Source:
    """A raw dump, or a folder of them.

    Raises:
        RecordingError: there is none, or no focal length is stated.
    """
    named = named_times(source_files(source, stated.pattern or "*"), stated.fps)
    width, height = stated.size or RAW_SIZE
    check_size(width, height, where=source)
    camera = stated.camera(width, height, own=None, where=source)
    if any(file.stat().st_size > width * height * _BYTES_PER_READING for file in named.files):
        fps = stated.fps or NOMINAL_FPS
        sensor = Sensor("sensor", camera, stated.unit(None), stated.depth_range_m)
        words = f"{rate_in_words(fps)} ({'as stated' if stated.fps else 'assumed'}: nothing tells the time)"
        return Source(sensor, _frames(named.files, "raw", camera, fps), times=words, alone=NO_CLOCK)
    return _source(named, "raw", camera, stated)


def _source(named: NamedTimes, kind: Kind, camera: Camera, stated: UserCamera) -> Source:
    """A source of files that hold an image each."""
    sensor = Sensor("sensor", camera, stated.unit(None), stated.depth_range_m)
    images = ((_READERS[kind](file, camera), time_s) for file, time_s in zip(named.files, named.times_s, strict=True))
    frames = (DepthFrame(time_s, image) for image_of, time_s in images for image in image_of)
    return source_of(named, sensor, frames)


def source_of(named: NamedTimes, sensor: Sensor, frames: Frames) -> Source:
    """The source that a sensor's files and the frames in them make."""
    return Source(sensor, frames, times=named.words, count=len(named.files), alone="" if named.clock else NO_CLOCK)


def _frames(files: Sequence[Path], kind: Kind, camera: Camera, fps: float) -> Iterator[DepthFrame]:
    images = (image for file in files for image in _READERS[kind](file, camera))
    for index, image in enumerate(images):
        yield DepthFrame(index / fps, image)


def source_files(source: Path, pattern: str) -> list[Path]:
    """The file itself, or the files of a folder that match the pattern.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     for name in ("depth-1.png", "depth-2.png", "colour-1.png"):
    ...         _ = Path(folder, name).write_bytes(b"any")
    ...     sorted(file.name for file in source_files(Path(folder), "depth-*.png"))
    ['depth-1.png', 'depth-2.png']

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

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder, "0001.png")
    ...     _ = file.write_text("version https://git-lfs.github.com/spec/v1")
    ...     refuse_pointer(file)
    Traceback (most recent call last):
        ...
    capture.errors.RecordingError: ...0001.png: is a Git LFS pointer, a few lines that stand for the file itself; ...

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
