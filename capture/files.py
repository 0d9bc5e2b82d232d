"""Files that are whole: what reading one that is not raises, and writing so that none is ever half-written."""

from __future__ import annotations

import os
import tokenize
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

UNREADABLE = (
    OSError,
    ValueError,
    KeyError,
    TypeError,
    EOFError,
    RuntimeError,
    MemoryError,
    SyntaxError,
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
)
"""What numpy raises for an ``.npz`` file that is cut short, damaged, or something else."""

MOST_BYTES = 4 << 30
"""An ``.npz`` file that would become larger than this in memory is refused: an hour of motion has a tenth of it."""


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """All arrays of an ``.npz`` file by name; nothing is unpickled.

    Raises:
        Exception: one of ``UNREADABLE``.
    """
    with zipfile.ZipFile(path) as members:
        claimed = sum(member.file_size for member in members.infolist())
    if claimed > MOST_BYTES:
        raise ValueError(f"would become {claimed} bytes")
    with np.load(path, allow_pickle=False) as data:
        arrays = {key: data[key] for key in data.files}
    for key, value in arrays.items():
        if not isinstance(value, np.ndarray):  # numpy gives what is no array as it stands there
            raise ValueError(f"{key} is no array")
    return arrays


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
