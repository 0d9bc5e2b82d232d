"""Recordings of other programs, brought into this program's format: folders of PNG images, raw 16-bit dumps.

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

from capture import depth_png
from capture.camera import Camera
from capture.errors import RecordingError
from capture.recording import Recording, RecordingWriter, Sensor, open_recording

Kind = Literal["png", "raw"]
"""What the files hold; see ``import_images``."""

NOMINAL_FPS = 30.0
"""The rate assumed when nobody knows when the frames were taken (Hz)."""

DEPTH_RANGE_M = (0.2, 4.0)
"""Readings of imported recordings are trusted in this range."""

_BYTES_PER_READING = 2


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
    created_by = f"bonetrack import of {files[0].parent.name}, times by a nominal rate of {fps:g} Hz"
    images = (image for file in files for image in _READERS[kind](file, camera))
    with RecordingWriter(out, sensors=[sensor], created_by=created_by, overwrite=overwrite) as writer:
        for index, image in enumerate(images):
            writer.add_frame(sensor.name, image, index / fps)
    return open_recording(out)


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
    return files


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
