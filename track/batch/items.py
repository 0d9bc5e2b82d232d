"""What is to be done: recordings with the anatomy to look for, from a folder of recordings or a table of them."""

from __future__ import annotations

import csv
import hashlib
import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from adapt.model.shape.population import ANYBODY, Person
from capture.errors import BonetrackError, FitError

_MARK = "recording.json"
_NEEDED = {"recording", "anatomy"}
_CONTENT = "content of the anatomy's file"
_PERSON = ("height", "mass", "sex")
_KNOWN = (*sorted(_NEEDED), "name", "near", *_PERSON, "region", "subject")


class BatchError(BonetrackError):
    """A batch cannot be begun, or some of its recordings failed."""


@dataclass(frozen=True)
class Item:
    """One recording to be tracked, and under which name its results are kept.

    Without a ``subject`` the anatomy is adapted to the recording first. The ``region`` is x0 y0 z0 x1 y1 z1 (m), and
    ``near`` a point x y z (m) that tells who of several is meant. Of an anatomy's file, ``content`` is a digest;
    ``person`` is what is said of whoever is recorded.
    """

    name: str
    recording: Path
    anatomy: str
    subject: Path | None = None
    region: tuple[float, ...] | None = None
    near: tuple[float, ...] | None = None
    content: str | None = None
    person: Person = ANYBODY

    def described(self) -> dict[str, Any]:
        """The item as JSON keeps it; point, content and person only where there is one: earlier versions knew none."""
        subject = None if self.subject is None else str(self.subject)
        region = None if self.region is None else list(self.region)
        described = asdict(self) | {"recording": str(self.recording), "subject": subject, "region": region}
        near, content, person = (described.pop(name) for name in ("near", "content", "person"))
        described |= {} if near is None else {"near": list(near)}
        described |= {} if self.person.is_unknown else {"person": person}
        return described | ({} if content is None else {_CONTENT: content})


def read_items(source: Path, *, anatomy: str | None = None) -> list[Item]:
    """The items of a folder that holds recordings, or of a CSV file.

    A CSV file has the columns ``recording`` and ``anatomy``, and may have ``name`` (else the recording's folder name),
    ``subject``, ``region`` or ``near`` (six or three numbers, m, separated by spaces), and ``height`` (m), ``mass``
    (kg) and ``sex`` of the person. Paths are relative to the file's folder; an ``anatomy`` is a path where it ends in
    ``.npz``.

    Args:
        source: the folder or the file.
        anatomy: of every recording of a folder, and of lines of a table that state none.

    Raises:
        BatchError: nothing there, a column, a value or an anatomy's file is missing or wrong, or two items of one name.

    >>> from tempfile import TemporaryDirectory
    >>> lines = [["recording", "anatomy", "near"], ["walk", "lower-limb-left", "0 0.5 1.8"]]
    >>> with TemporaryDirectory() as folder:
    ...     table = Path(folder, "batch.csv")
    ...     with table.open("w", newline="") as file:
    ...         csv.writer(file).writerows(lines)
    ...     [(item.name, item.anatomy, item.near) for item in read_items(table)]
    [('walk', 'lower-limb-left', (0.0, 0.5, 1.8))]
    """
    if source.is_dir():
        found = sorted(path.parent.resolve() for path in source.glob(f"*/{_MARK}"))
        name, content = _anatomy(anatomy, Path(), source)
        items = [Item(path.name, path, name, content=content) for path in found]
    elif source.is_file():
        items = _from_table(source, anatomy)
    else:
        raise BatchError("no such folder or file", where=source, remedy="name a folder of recordings, or a CSV file")
    if not items:
        raise BatchError("there are no recordings", where=source, remedy="name a folder of recordings, or a CSV file")
    name, times = Counter(item.name for item in items).most_common(1)[0]
    if times > 1:
        raise BatchError(f"{times} items are called {name}", where=source, remedy="tell them apart in a column `name`")
    return items


def _from_table(path: Path, anatomy: str | None) -> list[Item]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file)
            lines, columns = list(reader), set(reader.fieldnames or ())
    except (UnicodeDecodeError, csv.Error) as error:
        raise BatchError("not a CSV file", where=path, remedy=f"give one with columns {', '.join(_KNOWN)}") from error
    needed = _NEEDED if anatomy is None else _NEEDED - {"anatomy"}
    if missing := sorted(needed - columns):
        raise BatchError(f"no column {missing[0]}", where=path, remedy=f"its columns may be {', '.join(_KNOWN)}")
    if strange := sorted(str(column) for column in columns - set(_KNOWN)):
        raise BatchError(f"unknown column {strange[0]}", where=path, remedy=f"its columns may be {', '.join(_KNOWN)}")
    return [_item(line, path, number, anatomy) for number, line in enumerate(lines, 2)]


def _item(line: dict[str, str | None], path: Path, number: int, anatomy: str | None) -> Item:
    value = {name: (line.get(name) or "").strip() for name in _KNOWN}
    where = f"{path}, line {number}"
    if not value["recording"] or None in line:
        raise BatchError("not one value for each column, or no recording", where=where, remedy="complete the line")
    recording = (path.parent / value["recording"]).resolve()
    name = value["name"] or recording.name
    if Path(name).name != name:
        raise BatchError(f"{name!r} cannot name a folder", where=where, remedy="use a name without slashes")
    if value["region"] and value["near"]:
        raise BatchError("states both a region and a point", where=where, remedy="leave one of them empty")
    if value["subject"] and any(value[name] for name in _PERSON):
        remedy = "leave the subject or the person empty: a subject that is there is not adapted again"
        raise BatchError("states both a subject and a person", where=where, remedy=remedy)
    stated = _anatomy(value["anatomy"], path.parent, where) if value["anatomy"] else _anatomy(anatomy, Path(), where)
    return Item(
        name,
        recording,
        stated[0],
        (path.parent / value["subject"]).resolve() if value["subject"] else None,
        _region(value["region"], where),
        _near(value["near"], where),
        stated[1],
        _person([value[name] for name in _PERSON], where),
    )


def _anatomy(stated: str | None, folder: Path, where: str | Path) -> tuple[str, str | None]:
    """The name of an anatomy, or the path of its file from a ``folder`` and a digest of what the file holds."""
    from adapt.anatomy_file import anatomy_file, is_path

    if not stated:
        raise BatchError("no anatomy is stated", where=where, remedy="state it, such as --anatomy upper-limb-right")
    if not is_path(stated):
        return stated, None
    path = (folder / stated).resolve()
    file = anatomy_file(path)
    if file is None:
        raise BatchError(f"no such anatomy file: {path}", where=where, remedy="name a file that is there")
    return str(path), hashlib.sha256(file.read_bytes()).hexdigest()


def _region(text: str, where: str) -> tuple[float, ...] | None:
    if not text:
        return None
    numbers = _numbers(text)
    if len(numbers) != 6 or not all(low < high for low, high in zip(numbers[:3], numbers[3:], strict=True)):
        raise BatchError(f"{text!r} is no region", where=where, remedy="give x0 y0 z0 x1 y1 z1 in m, lowest first")
    return numbers


def _near(text: str, where: str) -> tuple[float, ...] | None:
    if not text:
        return None
    numbers = _numbers(text)
    if len(numbers) != 3 or not all(math.isfinite(number) for number in numbers):
        raise BatchError(f"{text!r} is no point", where=where, remedy="give x y z in m")
    return numbers


def _person(stated: Sequence[str], where: str) -> Person:
    height, mass, sex = stated
    try:
        return Person(_number(height, where), _number(mass, where), sex or None)
    except FitError as error:
        raise BatchError(error.problem, where=where, remedy=error.remedy) from error


def _number(text: str, where: str) -> float | None:
    if not text:
        return None
    numbers = _numbers(text)
    if len(numbers) != 1 or not math.isfinite(numbers[0]):
        raise BatchError(f"{text!r} is no height and no mass", where=where, remedy="give m and kg")
    return numbers[0]


def _numbers(text: str) -> tuple[float, ...]:
    """The numbers that a text consists of; none if it holds anything else."""
    try:
        return tuple(float(part) for part in text.split())
    except ValueError:
        return ()
