"""Room for a new recording: a folder that is not there or is empty, or an older recording, emptied of its own files.

Of an older recording those files go that the format names, those that its lists of frames name, and those that are
named as ``RecordingWriter`` names images. What else is kept beside them stays as it is.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Sequence
from pathlib import Path

from capture.errors import RecordingError
from capture.files import left_over, remove_left_over
from capture.own import Mark, json_of, refuse_any_foreign
from capture.recording.types import (
    BOX_FRAMES_FILE,
    CALIBRATION_FILE,
    CALIBRATION_FORMAT,
    COLOUR_FRAMES_FILE,
    FORMAT,
    FRAMES_FILE,
    HEADER_FILE,
    TRUTH_FILE,
    UNFINISHED_FILE,
)

_FILES = {
    HEADER_FILE: json_of(FORMAT),
    UNFINISHED_FILE: json_of(FORMAT),
    CALIBRATION_FILE: json_of(CALIBRATION_FORMAT),
    TRUTH_FILE: Mark(re.compile(rb"\APK\x03\x04.{26}\w+\.npy", re.DOTALL)),
}
_LISTS = (FRAMES_FILE, BOX_FRAMES_FILE, COLOUR_FRAMES_FILE)
_IMAGE = re.compile(r"(\d{6,}|box-\d{6,}|colour-\d{6,})\.(png|jpg)|\.[a-z0-9-]+\.partial-\d+\.(png|jpg)")


def make_room(path: Path, sensors: Sequence[str], *, overwrite: bool) -> None:
    """Make the folder of a recording with sensors of these names, or empty the recording that stands there.

    Raises:
        RecordingError, OutputError: the folder holds something that may not be replaced.
    """
    if path.exists() and not path.is_dir():
        raise RecordingError("is a file, not a folder", where=path, remedy="give another name")
    path.mkdir(parents=True, exist_ok=True)
    if set(path.iterdir()) - set(left_over(path, _FILES)):
        header = _header(path)
        if not overwrite and header.name != UNFINISHED_FILE:
            raise RecordingError(
                "holds a recording already", where=path, remedy="allow overwriting, or give another folder"
            )
        refuse_any_foreign({path / name: mark for name, mark in _FILES.items()})
        old = [file for name in _sensor_names(header) for file in _of_sensor(path / name)]
        _refuse_clash(path, sensors, old)
        header.replace(path / UNFINISHED_FILE)  # from here on it is not whole any more
        for file in [*old, *(path / name for name in (HEADER_FILE, CALIBRATION_FILE, TRUTH_FILE))]:
            file.unlink(missing_ok=True)
    remove_left_over(path, _FILES)


def _header(path: Path) -> Path:
    """The header of the recording in a folder, unfinished ones before others."""
    known = (path / name for name in (UNFINISHED_FILE, HEADER_FILE) if _FILES[name].is_on(path / name))
    header = next(known, None)
    if header is None:
        raise RecordingError(
            "is not empty and not a recording, so it will not be replaced", where=path, remedy="give another folder"
        )
    return header


def _of_sensor(home: Path) -> list[Path]:
    """The lists and images of a sensor, in its folder."""
    if not home.is_dir():
        return []
    lists = [home / name for name in _LISTS if (home / name).is_file()]
    listed = {name for file in lists for name in _listed(file)}
    images = [
        file for file in home.iterdir() if file.is_file() and (file.name in listed or _IMAGE.fullmatch(file.name))
    ]
    return lists + images


def _listed(file: Path) -> list[str]:
    """Names in a list of frames, which may be damaged, that are of files in the list's own folder."""
    with file.open(newline="", encoding="utf-8", errors="replace") as lines:
        names = [row[0] for row in csv.reader(line.replace("\0", "") for line in lines) if row]
    return [name for name in names[1:] if _is_plain(name)]


def _refuse_clash(path: Path, sensors: Sequence[str], old: Sequence[Path]) -> None:
    """Raise RecordingError where a new sensor's files would meet some that are not the older recording's."""
    for home in (path / name for name in sensors):
        if home.exists() and not home.is_dir():
            raise RecordingError("stands where a sensor's folder is to be", where=home, remedy="move it away")
        clashing = sorted(set(_of_sensor(home)) - set(old))
        if clashing:
            problem = "is not of the recording that stands there, and would be replaced"
            raise RecordingError(problem, where=clashing[0], remedy="move it away, or give another folder")


def _sensor_names(header: Path) -> list[str]:
    """Names of the sensors in a header that may be damaged: those that can safely be names of folders."""
    try:
        sensors = json.loads(header.read_text(encoding="utf-8"))["sensors"]
        names = [str(sensor["name"]) for sensor in sensors]
    except (OSError, ValueError, KeyError, TypeError):
        return []
    return [name for name in names if _is_plain(name)]


def _is_plain(name: str) -> bool:
    return name == Path(name).name and name not in {"", ".", ".."}
