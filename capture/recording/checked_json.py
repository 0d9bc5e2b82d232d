"""Reading JSON written by others: each access checks what it finds and says in one line what is wrong."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from capture.errors import RecordingError

_REMEDY = "see docs/recording-format.md"


@dataclass(frozen=True)
class Checked:
    """A JSON object, the file it came from and the keys that led to it; accessors raise RecordingError."""

    value: dict[str, Any]
    file: Path
    keys: str = ""

    def fail(self, problem: str) -> RecordingError:
        """The error to raise about this object."""
        return RecordingError(problem, where=self.file, remedy=_REMEDY)

    def _name(self, key: str) -> str:
        return f"{self.keys}.{key}" if self.keys else key

    def get(self, key: str) -> Any:
        """The value of a key that must be there."""
        if key not in self.value:
            raise self.fail(f"key '{self._name(key)}' is missing")
        return self.value[key]

    def object(self, key: str) -> Checked:
        """A nested object."""
        return self._nested(self.get(key), self._name(key))

    def objects(self, key: str) -> list[Checked]:
        """A list of at least one nested object."""
        values = self.get(key)
        if not isinstance(values, list) or not values:
            raise self.fail(f"'{self._name(key)}' must be a list that is not empty")
        return [self._nested(value, f"{self._name(key)}[{i}]") for i, value in enumerate(values)]

    def items(self) -> Iterator[tuple[str, Checked]]:
        """All entries, each of which must be a nested object."""
        for key, value in self.value.items():
            yield key, self._nested(value, self._name(key))

    def _nested(self, value: Any, keys: str) -> Checked:
        if not isinstance(value, dict):
            raise self.fail(f"'{keys}' must be an object")
        return Checked(value, self.file, keys)

    def text(self, key: str) -> str:
        """A string."""
        value = self.get(key)
        if not isinstance(value, str):
            raise self.fail(f"'{self._name(key)}' must be text, got {value!r}")
        return value

    def flag(self, key: str) -> bool:
        """True or false."""
        value = self.get(key)
        if not isinstance(value, bool):
            raise self.fail(f"'{self._name(key)}' must be true or false, got {value!r}")
        return value

    def number(self, key: str, *, above: float = -math.inf) -> float:
        """A finite number greater than ``above``."""
        return self._number(self.get(key), self._name(key), above)

    def whole(self, key: str, *, low: int, high: int) -> int:
        """A whole number in [low, high]."""
        value = self.get(key)
        if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
            raise self.fail(f"'{self._name(key)}' must be a whole number from {low} to {high}, got {value!r}")
        return value

    def numbers(self, key: str, *, count: int | None = None, above: float = -math.inf) -> tuple[float, ...]:
        """A list of finite numbers, ``count`` of them unless None."""
        values = self.get(key)
        if not isinstance(values, list) or (count is not None and len(values) != count):
            raise self.fail(f"'{self._name(key)}' must be a list of {'' if count is None else f'{count} '}numbers")
        return tuple(self._number(value, f"{self._name(key)}[{i}]", above) for i, value in enumerate(values))

    def _number(self, value: Any, name: str, above: float) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            raise self.fail(f"'{name}' must be a finite number, got {value!r}")
        if value <= above:
            raise self.fail(f"'{name}' must be greater than {above:g}, got {value!r}")
        return float(value)


def read_json(path: Path, *, format_name: str, newest_version: int) -> Checked:
    """Read a JSON file of one of this program's formats, checking its name and version.

    Raises:
        RecordingError: unreadable, not JSON, another format, or a version this program does not know.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "recording.json")
    ...     _ = path.write_text('{"format": "bonetrack-recording", "version": 9}')
    ...     read_json(path, format_name="bonetrack-recording", newest_version=1)
    Traceback (most recent call last):
        ...
    capture.errors.RecordingError: ...recording.json: has version 9, newer than this program knows (1); ...
    """
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        problem = f"cannot be read ({error.strerror})"
        raise RecordingError(problem, where=path, remedy="check the file and its permissions") from error
    except (ValueError, RecursionError) as error:
        raise RecordingError(f"is not valid JSON ({error})", where=path, remedy=_REMEDY) from error
    if not isinstance(value, dict) or value.get("format") != format_name:
        raise RecordingError(f'is not a {format_name} file (no "format": "{format_name}")', where=path, remedy=_REMEDY)
    checked = Checked(value, path)
    version = checked.whole("version", low=1, high=2**31)
    if version > newest_version:
        raise RecordingError(
            f"has version {version}, newer than this program knows ({newest_version})",
            where=path,
            remedy="update bonetrack",
        )
    return checked
