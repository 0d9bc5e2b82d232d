"""Files that are whole: what reading one that is not raises, and writing so that none is ever half-written."""

from __future__ import annotations

import os
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

UNREADABLE = (
    OSError,
    ValueError,
    KeyError,
    TypeError,
    EOFError,
    NotImplementedError,
    zipfile.BadZipFile,
    zlib.error,
)
"""What numpy raises for an ``.npz`` file that is cut short, damaged, or something else."""


@contextmanager
def replaced_when_complete(path: Path) -> Iterator[Path]:
    """Give a temporary path beside ``path``; move it there only when the block ends without an error.

    The temporary name keeps the suffix, because many writers choose the format by it.
    """
    partial = path.with_name(f".{path.stem}.partial-{os.getpid()}{path.suffix}")
    try:
        with naming(path, partial):
            yield partial
            os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


@contextmanager
def naming(path: Path, partial: Path | None = None) -> Iterator[None]:
    """Errors of the operating system name this file where they name none (a full disk) or the ``partial`` one."""
    try:
        yield
    except OSError as error:
        if error.filename is None or str(error.filename) == str(partial):
            error.filename = str(path)
        raise


def remove_left_over(folder: Path, pattern: str = ".*.partial-*") -> None:
    """Remove what a run that was killed while it wrote left under temporary names."""
    for left_over in folder.glob(pattern):
        left_over.unlink(missing_ok=True)
