"""The files or folders that are to be made one recording, opened and checked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from capture.errors import RecordingError
from capture.importers.formats import open_source
from capture.importers.options import ImportOptions
from capture.importers.readings import Tally
from capture.importers.source import Source, UserCamera
from capture.importers.times import Timed
from capture.recording import Sensor


@dataclass(frozen=True)
class Input:
    """One sensor's file or folder ``path``, perhaps another of the box alone, and what is stated of its camera.

    ``source`` is what it holds, to be read once, ``sensor`` what it is called in the recording.
    """

    path: Path
    box_path: Path | None
    stated: UserCamera
    format_name: str | None
    source: Source
    sensor: Sensor

    def opened(self, path: Path | None = None) -> Source:
        """The file opened anew, or the box's, with what is wrong in its readings or times refused as it is read."""
        path = path or self.path
        source = open_source(path, self.stated, name=self.format_name)
        return replace(source, frames=Tally(source.sensor, path).watched(Timed(path).watched(source.frames)))

    def in_words(self) -> str:
        """What a source is and how it was taken, for who looks at the recording later."""
        turned = ", mirrored by the driver and turned back" if self.source.sensor.mirrored else ""
        return f"{self.path.name}{turned}, times by {self.source.times}"


def open_inputs(paths: Path | Sequence[Path], out: Path, options: ImportOptions) -> list[Input]:
    """Open each sensor's file or folder, to be written into the folder ``out``.

    Raises:
        RecordingError: not as many different names, or files of the box, as sensors; a file cannot be read, or lies in
            the folder that is to be written.
    """
    listed = [paths] if isinstance(paths, Path) else list(paths)
    names = options.name_of_each(len(listed))
    if len(set(names)) != len(listed):
        raise RecordingError(
            f"{len(listed)} sensors need as many different names, not {', '.join(names)}",
            where=out,
            remedy="give --sensor once for each",
        )
    box_paths = () if options.box is None else options.box.paths
    _refuse_inside([*listed, *box_paths], out)
    if box_paths and len(box_paths) != len(listed):
        raise RecordingError(
            f"{len(listed)} sensors need as many files of the box, not {len(box_paths)}",
            where=out,
            remedy="give --box-source once for each",
        )
    each, format_name = options.camera_of_each(len(listed)), options.format_name
    inputs = []
    for path, box_path, own, name in zip(listed, box_paths or [None] * len(listed), each, names, strict=True):
        source = open_source(path, own, name=format_name)
        inputs.append(Input(path, box_path, own, format_name, source, replace(source.sensor, name=name)))
    return inputs


def _refuse_inside(paths: Sequence[Path], out: Path) -> None:
    """Raise RecordingError where a file to be read lies in the folder that is emptied before it is written."""
    for path in paths:
        if out.resolve() in (path.resolve(), *path.resolve().parents):
            remedy = "give another --out"
            raise RecordingError("lies in the folder that is to be written", where=path, remedy=remedy)
