"""Which steps of a run are done: made from the same things with the same choices, and still there.

``steps.json`` keeps of each step a digest of what it was made from and the files that it made.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from capture.own import json_of, replaced_if_own
from capture.recording import open_recording
from capture.recording.fingerprint import fingerprint
from capture.recording.types import BOX_FRAMES_FILE, CALIBRATION_FILE, FRAMES_FILE, HEADER_FILE

FILE = "steps.json"
_FORMAT = "bonetrack-run"
_MARK = json_of(_FORMAT)


@dataclass(frozen=True)
class DoneSteps:
    """The steps that were done in a folder of results."""

    folder: Path

    def is_done(self, step: str, digest: str) -> bool:
        """Whether a step was done from just this, and all that it made is there."""
        kept = self._read().get(step)
        if not isinstance(kept, dict) or kept.get("made_from") != digest:
            return False
        return all((self.folder / str(name)).is_file() for name in kept.get("files", ()))

    def knows(self, step: str) -> bool:
        """Whether a step was ever done here."""
        return step in self._read()

    def note(self, step: str, digest: str, files: Sequence[Path]) -> None:
        """Keep that a step is done, and which files it made.

        Raises:
            OutputError: something else stands in the place of the list of steps.
        """
        names = [path.relative_to(self.folder).as_posix() for path in files]
        steps = {**self._read(), step: {"made_from": digest, "files": names}}
        with replaced_if_own(self.folder / FILE, _MARK) as partial:
            partial.write_text(json.dumps({"format": _FORMAT, "steps": steps}, indent=1) + "\n", encoding="utf-8")

    def _read(self) -> dict[str, Any]:
        try:
            steps = json.loads((self.folder / FILE).read_text(encoding="utf-8"))["steps"]
        except (OSError, ValueError, KeyError, TypeError):
            return {}  # what is not known to be done is done again
        return steps if isinstance(steps, dict) else {}


def digest(chosen: Mapping[str, Any], *parts: str) -> str:
    """A digest of choices and of other digests; a file that a choice names counts by its content, wherever it lies.

    >>> digest({"poses": 6}) == digest({"poses": 6}), digest({"poses": 6}) == digest({"poses": 5})
    (True, False)
    """
    told = json.dumps([sorted((key, _by_content(value)) for key, value in chosen.items()), parts])
    return hashlib.sha256(told.encode()).hexdigest()


def _by_content(value: Any) -> Any:
    """A value of a choice with digests in the place of whole paths."""
    if isinstance(value, list):
        return [_by_content(one) for one in value]
    if not isinstance(value, str) or not Path(value).is_absolute() or not Path(value).exists():
        return value
    return sources_digest([Path(value)]) if Path(value).is_dir() else file_digest(Path(value))


def file_digest(path: Path) -> str:
    """A digest of a file's content."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def sources_digest(paths: Sequence[Path]) -> str:
    """A digest of sensors' files and folders by name, size and time, for their content may be many gigabytes.

    It is the same where they are moved or copied with their times.
    """
    told = hashlib.sha256()
    for path in paths:
        for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
            if file.is_file():
                written = file.stat()
                told.update(f"{file.relative_to(path.parent)} {written.st_size} {written.st_mtime_ns}\n".encode())
    return told.hexdigest()


def recording_digest(path: Path, *, calibrated: bool = True) -> str:
    """A digest of a recording: its images, lists and cameras, and unless told otherwise where its sensors stand."""
    recording = open_recording(path)
    told = hashlib.sha256(fingerprint(recording).encode())
    names = [HEADER_FILE, *([CALIBRATION_FILE] if calibrated else [])]
    names += [f"{sensor.name}/{name}" for sensor in recording.sensors for name in (FRAMES_FILE, BOX_FRAMES_FILE)]
    for file in (path / name for name in names):
        told.update(file.read_bytes() if file.is_file() else b"none")
    return told.hexdigest()
