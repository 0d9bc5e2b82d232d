"""Which reader reads what: recognised by content first, since suffixes lie, and by what a folder holds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from capture.bounded import read_head
from capture.errors import RecordingError
from capture.importers import (
    azure_kinect,
    clouds,
    datasets,
    images,
    openni,
    realsense_bag,
    realsense_db3,
    realsense_snapshots,
    sensor_folder,
    text_images,
)
from capture.importers.disparity import converted
from capture.importers.mirror import unmirrored
from capture.importers.names import natural_order
from capture.importers.source import Source, UserCamera
from capture.recording.types import HEADER_FILE, UNFINISHED_FILE

_HEAD_BYTES = 64

_HEADERS = (HEADER_FILE, UNFINISHED_FILE)


@dataclass(frozen=True)
class Format:
    """One kind of file or folder.

    Attributes:
        name: what ``--format`` calls it.
        open: its reader.
        head: the first bytes of such a file (empty: not recognised by content).
        suffixes: what such files are usually called.
        is_folder: whether a folder is one (None: only files are).
    """

    name: str
    open: Callable[[Path, UserCamera], Source]
    head: bytes = b""
    suffixes: tuple[str, ...] = ()
    is_folder: Callable[[Path], bool] | None = None

    @property
    def files(self) -> bool:
        """Whether single files are of this format."""
        return bool(self.suffixes) or self.name == "raw"

    @property
    def folders(self) -> bool:
        """Whether folders are of this format."""
        return self.is_folder is not None


FORMATS = (
    Format("azure-kinect", azure_kinect.open_mkv, head=b"\x1a\x45\xdf\xa3", suffixes=(".mkv",)),
    Format("realsense-bag", realsense_bag.open_bag, head=b"#ROSBAG V", suffixes=(".bag",)),
    Format("realsense-db3", realsense_db3.open_db3, head=b"SQLite format 3\0", suffixes=(".db3",)),
    Format("openni", openni.open_oni, head=b"NI10", suffixes=(".oni",)),
    Format("tum", datasets.open_tum, is_folder=datasets.is_tum),
    Format("sensor-folder", sensor_folder.open_sensor_folder, is_folder=sensor_folder.is_sensor_folder),
    Format("redwood", datasets.open_redwood, is_folder=datasets.is_redwood),
    Format("realsense-snapshots", realsense_snapshots.open_snapshots, is_folder=realsense_snapshots.is_snapshots),
    Format("clouds", clouds.open_clouds, suffixes=(".ply", ".pcd"), is_folder=clouds.is_clouds),
    Format(
        "png",
        images.open_png,
        head=b"\x89PNG\r\n\x1a\n",
        suffixes=(".png",),
        is_folder=lambda folder: any(folder.glob("*.png")),
    ),
    Format("pgm", text_images.open_pgm, suffixes=(".pgm",), is_folder=lambda folder: any(folder.glob("*.pgm"))),
    Format(
        "text",
        text_images.open_text,
        suffixes=(".txt", ".csv"),
        is_folder=lambda folder: any(folder.iterdir()) and all(_is_table(file) for file in folder.iterdir()),
    ),
    Format("raw", images.open_raw, is_folder=lambda folder: any(folder.iterdir())),
)
"""In the order of trying; ``raw`` is whatever nothing else is."""

_TOLD_BY_OTHER_FILES = (
    datasets.is_tum,
    datasets.is_redwood,
    realsense_snapshots.is_snapshots,
    sensor_folder.is_sensor_folder,
)
"""Folders whose images are told by files that are none, so that a pattern for images does not say what they are."""

_BY_NAME = {format.name: format for format in FORMATS}


def open_source(path: Path, stated: UserCamera, *, name: str | None = None) -> Source:
    """Open a sensor's file or folder with the reader of its format; ``name`` states the format.

    Raises:
        KeyError: no format has that name.
        RecordingError: not there, empty, not what the format asks for, or too little is known of the camera.
    """
    if not path.exists():
        raise RecordingError("does not exist", where=path, remedy="name a sensor's file, or a folder of depth images")
    if path.is_file() and path.stat().st_size == 0:
        raise RecordingError("is an empty file", where=path, remedy="record or copy it again")
    if any((path / name).is_file() for name in _HEADERS) or path.name in _HEADERS:
        raise RecordingError(
            "is a recording already" if path.is_dir() else "is the description of a recording",
            where=path,
            remedy="give its folder to `bonetrack adapt` and the others as it is",
        )
    if path.is_file():
        images.refuse_pointer(path)
    chosen = recognised(path, stated.pattern) if name is None else _BY_NAME[name]
    if path.is_dir() and not chosen.folders:
        raise RecordingError("is a folder", where=path, remedy=f"name the {chosen.suffixes[0]} file in it")
    if path.is_file() and not chosen.files:
        raise RecordingError("is a file", where=path, remedy=f"a recording laid out like {chosen.name} is a folder")
    source = chosen.open(path, stated)
    source = converted(source, path) if stated.disparity else source
    # A file that says itself that its images are mirrored has been turned back by its reader, which is once enough.
    return unmirrored(source, path) if stated.mirrored and not source.sensor.mirrored else source


def recognised(path: Path, pattern: str | None = None) -> Format:
    """The format of a file or folder that exists; of a folder only the files that match the pattern count.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder, "depth.dat")
    ...     _ = file.write_text("ply")
    ...     recognised(file).name  # by what is in it, not by what it is called
    'clouds'

    Raises:
        RecordingError: an empty folder, or a file whose content is not what its suffix says.
    """
    if path.is_dir() and pattern is not None and not any(told(path) for told in _TOLD_BY_OTHER_FILES):
        return _of_files(path, pattern)
    if path.is_dir():
        found = next((format for format in FORMATS if format.is_folder and format.is_folder(path)), None)
        if found is None:
            raise RecordingError("is an empty folder", where=path, remedy="name the folder of the depth images")
        return found
    head = read_head(path, _HEAD_BYTES)
    for format in FORMATS:
        if format.head and head.startswith(format.head):
            return format
    if path.suffix.lower() == ".pcd" or head.startswith(b"ply"):
        return _BY_NAME["clouds"]
    if head[:2] in (b"P2", b"P5") and head[2:3].isspace():
        return _BY_NAME["pgm"]
    if text_images.is_table(head):
        return _BY_NAME["text"]
    named = next((format for format in FORMATS if path.suffix.lower() in format.suffixes), None)
    if named is not None:
        raise RecordingError(
            f"is not what its name says: it does not begin as a {path.suffix} file does",
            where=path,
            remedy="record or copy it again, or state its format with --format",
        )
    return FORMATS[-1]


def _of_files(folder: Path, pattern: str) -> Format:
    """The format of those files of a folder that match the pattern: that of the first.

    Raises:
        RecordingError: there is none, or it is a recording of a sensor by itself.
    """
    first = natural_order(images.source_files(folder, pattern))[0]
    found = recognised(first)
    if not found.folders:
        raise RecordingError("is a recording by itself, not an image", where=first, remedy="name this file")
    return found


def _is_table(file: Path) -> bool:
    return file.is_file() and text_images.is_table(read_head(file, _HEAD_BYTES))
