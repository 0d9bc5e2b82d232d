"""Files that are whole: what reading one that is not raises, and writing so that none is ever half-written."""

from __future__ import annotations

import math
import os
import re
import tokenize
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

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

MOST_BYTES = 512 << 20
"""Of all arrays read from one file: five hours of a leg's motion at 30 frames a second."""


class TooLarge(ValueError):
    """An array is larger than any that belongs there; the text says which."""


def read_arrays(path: Path | IO[bytes], known: Mapping[str, int]) -> dict[str, NDArray[Any]]:
    """Arrays of an ``.npz`` file, or of an open one, by name; nothing is unpickled.

    ``known`` has the most bytes that each may take, by name; a name that ends in ``/`` stands for all that begin with
    it. Others are left alone, and sizes are looked at before anything is read, so that a small file cannot take much
    memory. Which arrays there must be is for the caller to check.

    Raises:
        Exception: one of ``UNREADABLE``, and of these ``TooLarge`` for an array or a sum beyond its limit.

    >>> from io import BytesIO
    >>> file = BytesIO()
    >>> np.savez(file, times=np.arange(3.0), notes=np.zeros(9))
    >>> {name: array.tolist() for name, array in read_arrays(file, {"times": 1000}).items()}
    {'times': [0.0, 1.0, 2.0]}
    >>> read_arrays(file, {"times": 16})
    Traceback (most recent call last):
        ...
    capture.files.TooLarge: times would take 24 bytes of memory, more than 16 bytes
    """
    with zipfile.ZipFile(path) as archive:
        names = [name.removesuffix(".npy") for name in archive.namelist() if name.endswith(".npy")]
        limits = {name: limit for name in names if (limit := _limit(name, known)) is not None}
        total = 0
        for name, limit in limits.items():
            size = _size(archive, name)
            total += size
            if size > limit or total > MOST_BYTES:
                most = f"{limit} bytes" if size > limit else f"{MOST_BYTES} bytes with those before it"
                raise TooLarge(f"{name} would take {size} bytes of memory, more than {most}")
        arrays = {}
        for name in limits:
            with archive.open(f"{name}.npy") as member:
                arrays[name] = np.lib.format.read_array(member, allow_pickle=False)
    return arrays


def unreadable(what: str, error: BaseException) -> str:
    """What a file is not, in words, with the array that is too large if that is why.

    >>> unreadable("a motion file", TooLarge("times would take 80 bytes of memory, more than 8 bytes"))
    'not a motion file: times would take 80 bytes of memory, more than 8 bytes'
    >>> unreadable("a motion file", EOFError())
    'not a motion file'
    """
    return f"not {what}: {error}" if isinstance(error, TooLarge) else f"not {what}"


def _limit(name: str, known: Mapping[str, int]) -> int | None:
    return known.get(name, next((m for group, m in known.items() if group[-1] == "/" and name.startswith(group)), None))


def _size(archive: zipfile.ZipFile, name: str) -> int:
    """Bytes that an array would take, by its header."""
    with archive.open(f"{name}.npy") as member:
        version = np.lib.format.read_magic(member)
        if version == (1, 0):
            shape, _, dtype = np.lib.format.read_array_header_1_0(member)
        elif version == (2, 0):
            shape, _, dtype = np.lib.format.read_array_header_2_0(member)
        else:
            raise ValueError(f"{name} is of format {version}")
    return math.prod(shape) * dtype.itemsize


@contextmanager
def replaced_when_complete(path: Path) -> Iterator[Path]:
    """Give a temporary path beside ``path``; move it there only when the block ends without an error.

    The temporary name keeps the suffix, because many writers choose the format by it.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     table = Path(folder, "angles.csv")
    ...     with replaced_when_complete(table) as partial:
    ...         _ = partial.write_text("whole")
    ...         partial.suffix, table.exists()
    ...     table.read_text(), partial.exists()
    ('.csv', False)
    ('whole', False)
    """
    partial = path.with_name(f".{path.stem}.partial-{os.getpid()}{path.suffix}")
    try:
        with naming(path, partial):
            yield partial
            os.replace(partial, path)
    finally:
        with suppress(OSError):  # where there can be no such file, the error that says so is on its way
            partial.unlink(missing_ok=True)


@contextmanager
def naming(path: Path, partial: Path | None = None) -> Iterator[None]:
    """Errors of the operating system name this file where they name none (a full disk) or the ``partial`` one."""
    try:
        yield
    except OSError as error:
        told = error.strerror or str(error)
        if partial is not None and str(partial) in told:  # libraries put it into the words
            error.strerror = told.replace(str(partial), str(path))
        if error.filename is None or str(error.filename) == str(partial):
            error.filename = str(path)
        raise


def left_over(folder: Path, names: Iterable[str]) -> list[Path]:
    """What runs that were killed while they wrote files of these names left in a folder under temporary names.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     for name in ("motion.npz", ".motion.partial-812.npz", ".notes.partial-812.npz"):
    ...         Path(folder, name).touch()
    ...     [path.name for path in left_over(Path(folder), ["motion.npz"])]
    ['.motion.partial-812.npz']
    """
    patterns = [f"\\.{re.escape(Path(name).stem)}\\.partial-[0-9]+{re.escape(Path(name).suffix)}" for name in names]
    known = re.compile("|".join(patterns))
    return [path for path in folder.iterdir() if known.fullmatch(path.name) and path.is_file()]


def remove_left_over(folder: Path, names: Iterable[str]) -> None:
    """Remove what runs that were killed while they wrote files of these names left under temporary names."""
    for path in left_over(folder, names):
        path.unlink(missing_ok=True)
