"""Journals of long work: each finished piece is a line of a file, so that the same command goes on after a kill.

The first line is a key: what the work is made from, and with which software. A journal with another key is begun anew,
and that is told, for who interrupted hours of work expects them to be gone on with.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.files import naming
from capture.own import Mark, replaced_if_own
from capture.recording import Recording

MARK = Mark(re.compile(rb"\A[0-9a-f]{64}\r?\n"))

BEGUN_ANEW = "begun anew, for the run that was cut short had another version, other files or other options"

Told = Callable[[str], None]
"""Told a line for people."""

_LAYOUT = 3
"""Of the lines of journals: raised when a version could not go on with lines of the one before it."""

_FLOATS, _LOWER = "floats", "lower half"


@dataclass(frozen=True)
class Journal:
    """A file that finished pieces (JSON) are added to; ``entries`` are those of earlier runs.

    Arrays of floats are written as their bytes, a symmetric one by its lower half; they come back as arrays. Other
    arrays come back as lists. Errors name the ``result`` that the work is for, which people know, not the journal.
    """

    path: Path
    entries: tuple[Any, ...] = field(repr=False)
    result: Path

    def append(self, entry: Any) -> None:
        """Add a finished piece. Numbers come back as they were, to the last bit."""
        with naming(self.result, self.path), self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(entry, default=_plain) + "\n")

    def remove(self) -> None:
        """Take the file away: the work is done, or its failure is known."""
        self.path.unlink(missing_ok=True)


def resume_journal(
    path: Path,
    key: str,
    told: Told = lambda _: None,
    *,
    goes_on: Callable[[Any], bool] = lambda entry: True,
    result: Path | None = None,
) -> Journal:
    """The journal at ``path``; an empty one if there is none with that key, which is ``told`` in a line.

    A last line that was cut short is dropped; a damaged line is dropped with all that follows. So is what follows the
    last entry from which the work ``goes_on``. The ``result`` is what the work is for, if that is another file.

    Raises:
        OutputError: something else than a journal stands there.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path, key = Path(folder, "adapt.journal"), "0" * 64
    ...     resume_journal(path, key).append({"frame": 3, "theta": np.array([0.25, -1.0])})
    ...     resume_journal(path, key).entries, resume_journal(path, "f" * 64).entries
    (({'frame': 3, 'theta': array([ 0.25, -1.  ])},), ())
    """
    lines = path.read_text(encoding="utf-8", errors="replace").split("\n") if path.is_file() else []
    entries = []
    if len(lines) > 2 and lines[0] != key and MARK.is_on(path):
        told(f"{path}: {BEGUN_ANEW}")
    if lines and lines[0] == key:
        for line in lines[1:-1]:  # what follows the last newline was cut short
            try:
                entries.append(json.loads(line, object_hook=_as_it_was))
            except ValueError:
                break
    while entries and not goes_on(entries[-1]):
        entries.pop()
    result = path if result is None else result
    with naming(result, path), replaced_if_own(path, MARK) as partial:
        partial.write_text("\n".join([key, *lines[1 : 1 + len(entries)]]) + "\n", encoding="utf-8")
    return Journal(path, tuple(entries), result)


def journal_key(recording: Recording, *inputs: NDArray[Any] | str) -> str:
    """What a journal must have been made from to be continued: the software, the recording, and other inputs."""
    digest = hashlib.sha256(f"{_software()} {_LAYOUT}".encode())
    for sensor in recording.sensors:
        digest.update(f"{sensor.name} {sensor.camera} {sensor.depth_unit_m} {sensor.depth_range_m}".encode())
        for frame in sensor.frames:
            written = frame.path.stat()
            digest.update(f"{frame.path.name} {frame.time_s} {written.st_size} {written.st_mtime_ns}".encode())
    if recording.calibration is not None:
        for name, calibration in recording.calibration.sensors.items():
            digest.update(name.encode() + np.ascontiguousarray(calibration.world_from_sensor).tobytes())
    for item in inputs:
        data = item.encode() if isinstance(item, str) else np.ascontiguousarray(item).tobytes()
        digest.update(f"{len(data)} ".encode() + data)
    return digest.hexdigest()


def _software() -> str:
    try:
        return f"bonetrack {metadata.version('bonetrack')}"
    except metadata.PackageNotFoundError:  # run from a checkout
        return "bonetrack"


def _plain(value: Any) -> Any:
    """Numpy's arrays and numbers in JSON's words: floats by their bytes, so that not a bit is lost nor a letter wasted."""
    if not (isinstance(value, np.ndarray) and value.dtype == np.float64):
        return value.tolist()
    if value.ndim == 2 and np.array_equal(value, value.T, equal_nan=True):
        return {_LOWER: _words(value[np.tril_indices(len(value))])}
    return {_FLOATS: _words(value), "shape": value.shape}


def _words(floats: NDArray[np.float64]) -> str:
    return base64.b85encode(np.ascontiguousarray(floats, dtype="<f8").tobytes()).decode("ascii")


def _as_it_was(told: dict[str, Any]) -> Any:
    """What ``_plain`` made, undone; ValueError if it is damaged."""
    if told.keys() == {_FLOATS, "shape"}:
        return _floats(told[_FLOATS]).reshape(told["shape"])
    if told.keys() != {_LOWER}:
        return told
    half = _floats(told[_LOWER])
    size = int(np.sqrt(2 * len(half)))
    whole = np.zeros((size, size))
    whole[np.tril_indices(size)] = half
    return np.where(np.tri(size, dtype=bool), whole, whole.T)


def _floats(words: str) -> NDArray[np.float64]:
    return np.frombuffer(base64.b85decode(words), dtype="<f8").astype(np.float64)
