"""Reading files that others wrote, no more of them than belongs there, so that none takes memory that it should not."""

from __future__ import annotations

from pathlib import Path

from capture.errors import BonetrackError, RecordingError


def read_head(file: Path, count: int, *, error: type[BonetrackError] = RecordingError) -> bytes:
    """The first bytes of a file, ``count`` of them if it has as many.

    Raises:
        BonetrackError: an ``error``, if the file cannot be read.
    """
    try:
        with file.open("rb") as opened:
            return opened.read(count)
    except OSError as why:
        problem = f"cannot be read ({why.strerror})"
        raise error(problem, where=file, remedy="check the file and its permissions") from why


def read_at_most(file: Path, most: int, *, remedy: str, error: type[BonetrackError] = RecordingError) -> bytes:
    """All bytes of a file, of which there may be ``most``; ``remedy`` says what to do about a larger one.

    Raises:
        BonetrackError: an ``error``, if the file cannot be read, or is larger.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder, "rig.json")
    ...     _ = file.write_text("{}")
    ...     read_at_most(file, 1, remedy="name another file")
    Traceback (most recent call last):
        ...
    capture.errors.RecordingError: ...rig.json: is larger than 1 bytes; name another file
    """
    data = read_head(file, most + 1, error=error)
    if len(data) > most:
        raise error(f"is larger than {most} bytes", where=file, remedy=remedy)
    return data
