"""Only what bonetrack wrote is replaced: a file is known for its own by a mark that its writer left in it.

There is no list of written files beside them: a mark goes wherever the file goes. A mark is a pattern in a part of the
file that is cheap to read, so that a large foreign file is told apart as fast as a small one.
"""

from __future__ import annotations

import os
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from capture.errors import OutputError
from capture.files import UNREADABLE, replaced_when_complete

WRITTEN = "written by bonetrack"
"""The words of a mark where a format has room for words."""

_HEAD_BYTES, _TAIL_BYTES = 8 << 10, 64 << 10
_REMEDY = "move it away, or give another name for the result"


def head(path: Path) -> bytes:
    """The first bytes of a file."""
    with path.open("rb") as file:
        return file.read(_HEAD_BYTES)


def tail(path: Path) -> bytes:
    """The last bytes of a file."""
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - _TAIL_BYTES))
        return file.read(_TAIL_BYTES)


def _description(path: Path) -> bytes:
    """The beginning of the text ``description`` in an ``.npz`` file, as ASCII."""
    with zipfile.ZipFile(path) as archive, archive.open("description.npy") as member:
        return member.read(_HEAD_BYTES).replace(b"\0", b"")  # numpy keeps four bytes a letter


@dataclass(frozen=True)
class Mark:
    """What tells a file of bonetrack's from others: a pattern, and the part of the file that it is looked for in."""

    pattern: re.Pattern[bytes]
    part: Callable[[Path], bytes] = head

    def is_on(self, path: Path) -> bool:
        """Whether a file bears the mark; one that cannot be read does not."""
        try:
            return self.pattern.search(self.part(path)) is not None
        except UNREADABLE:
            return False


def words(text: str) -> Mark:
    """The mark of files that have these words near their beginning.

    >>> words("written by bonetrack").pattern.search(b"# written by bonetrack") is not None
    True
    """
    return Mark(re.compile(re.escape(text.encode())))


def json_of(name: str) -> Mark:
    """The mark of JSON files whose key ``format`` has this value.

    >>> mark = json_of("bonetrack-poses").pattern
    >>> mark.search(b'{"format": "bonetrack-poses"}') is not None, mark.search(b'{"format": "poses"}') is not None
    (True, False)
    """
    return Mark(re.compile(rb'"format":\s*"%b"' % re.escape(name.encode())))


def arrays_of(name: str) -> Mark:
    """The mark of ``.npz`` files whose description has this value of ``format``."""
    return Mark(json_of(name).pattern, _description)


def table_of(columns: Sequence[str]) -> Mark:
    """The mark of CSV files, which have no room for another one: their first row is just these columns."""
    return Mark(re.compile(rb"\A%b\r?\n" % re.escape(",".join(columns).encode())))


def page_of(text: str) -> Mark:
    """The mark of pages and tables in Markdown: the first line is that of the text which is to be written.

    >>> mark = page_of("# Errors of seven cohorts").pattern
    >>> mark.match(b"# Errors of seven cohorts") is not None, mark.match(b"# My notes") is not None
    (True, False)
    """
    return Mark(re.compile(rb"\A%b\r?(\n|\Z)" % re.escape(text.partition("\n")[0].encode())))


PNG = words("tEXtSoftware\0bonetrack")
"""The mark of images that ``marked_png`` made."""


def marked_png(data: bytes) -> bytes:
    """The bytes of a PNG file with the mark in a text chunk, the first after the image's header (33 bytes in all).

    >>> import cv2
    >>> import numpy as np
    >>> _, plain = cv2.imencode(".png", np.array([[7]], dtype=np.uint8))
    >>> marked = marked_png(plain.tobytes())
    >>> PNG.pattern.search(marked) is not None, cv2.imdecode(np.frombuffer(marked, np.uint8), -1).tolist()
    (True, [[7]])
    """
    chunk = b"tEXtSoftware\0bonetrack"
    return data[:33] + struct.pack(">I", len(chunk) - 4) + chunk + struct.pack(">I", zlib.crc32(chunk)) + data[33:]


HTML_META = "<meta name='generator' content='bonetrack'>"
"""The mark of a page, which stands first in its head."""
HTML = Mark(re.compile(rb"<head>\s*%b" % re.escape(HTML_META.encode())))


def refuse_foreign(path: Path, mark: Mark) -> None:
    """Leave a file alone that bonetrack did not write; none, an empty one and one with the mark may be written.

    Raises:
        OutputError: something else stands there.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     notes = Path(folder, "angles.mot")
    ...     _ = notes.write_text("my own notes")
    ...     refuse_foreign(notes, words(WRITTEN))
    Traceback (most recent call last):
        ...
    capture.errors.OutputError: ...angles.mot: does not look like bonetrack's own, so it is not replaced; ...
    """
    if not os.path.lexists(path):
        return
    if path.is_dir():
        raise OutputError("is a folder, not a file", where=path, remedy=_REMEDY)
    if not path.is_file() or (path.stat().st_size and not mark.is_on(path)):
        raise OutputError("does not look like bonetrack's own, so it is not replaced", where=path, remedy=_REMEDY)


def refuse_any_foreign(marks: Mapping[Path, Mark]) -> None:
    """``refuse_foreign`` of all files that are going to be written, so that none is where one is refused.

    Raises:
        OutputError: something else stands in the place of one.
    """
    for path, mark in marks.items():
        refuse_foreign(path, mark)


@contextmanager
def replaced_if_own(path: Path, mark: Mark) -> Iterator[Path]:
    """``replaced_when_complete`` of a file that is not there yet or bears the mark, which the new one must bear, too.

    Raises:
        OutputError: see ``refuse_foreign``.
    """
    refuse_foreign(path, mark)
    with replaced_when_complete(path) as partial:
        yield partial
