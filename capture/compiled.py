"""Loops that array operations would only make slow, compiled once by numba and kept beside the source.

A module that uses this is imported where its work begins, because numba alone takes half a second to import. Every
compiled function has a twin in plain NumPy that a test compares it with.

What numba keeps it takes up again as long as the function's own file is as it was, though functions and numbers of
other files have become part of it: after an update of those alone, the old equations would run without a word. And it
reads what it kept before it asks whether that is old, which fails where a class that a function takes has moved since.
So what is kept has a name that tells the content of the file and of those it imports, and is looked for under it alone.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from functools import cache
from glob import escape
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

import numba

_P = ParamSpec("_P")
_R = TypeVar("_R")

_ROOT = Path(__file__).parents[1]
_IMPORTED = re.compile(r"^from ((?:capture|adapt|track)[\w.]*) import", re.MULTILINE)


def compiled(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """The function as machine code, with NumPy's rules for division by zero."""
    return _compiled(function, fastmath=False)


def compiled_sums(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """The same where sums may be taken in any order, so that the processor can take several terms at once."""
    return _compiled(function, fastmath={"reassoc", "nsz", "contract"})


def inlined(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """The same for a few lines that other compiled loops repeat: they become part of each loop."""
    return _compiled(function, fastmath={"nsz", "contract"}, forceinline=True)


def _compiled(function: Callable[_P, _R], *, fastmath: bool | set[str], **more: bool) -> Callable[_P, _R]:
    def machine_code(*, cache: bool) -> Callable[_P, _R]:
        options = {"cache": cache, "error_model": "numpy", "nogil": True, "fastmath": fastmath, **more}
        return cast(Callable[_P, _R], numba.njit(**options)(function))

    try:
        kept = machine_code(cache=True)
        _keep_by_content(kept, Path(function.__code__.co_filename))
    except (RuntimeError, AttributeError, OSError):  # nowhere to keep it, or not to be told when it is old
        return machine_code(cache=False)
    return kept


def _keep_by_content(kept: Any, file: Path) -> None:
    """Has numba look for what it keeps of a function under the content of its file, and what is older removed."""
    name, place, now = kept._cache._impl.filename_base, kept._cache._cache_path, kept._cache._cache_file
    named = f"{name}-{_content(file)[:16]}"
    for old in Path(place).glob(f"{escape(name)}[.-]*"):
        if not old.name.startswith(named):
            old.unlink(missing_ok=True)
    kept._cache._cache_file = type(now)(cache_path=place, filename_base=named, source_stamp=now._source_stamp)


@cache
def _content(file: Path) -> str:
    """The content of a file, of those of ours that it imports, and of what these import if they are compiled, too."""
    found, waiting = set[Path](), [file]
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            text = path.read_text(encoding="utf-8")
            if path == file or "from capture.compiled import" in text:
                waiting += [there for name in _IMPORTED.findall(text) if (there := _file_of(name)) is not None]
    return hashlib.sha256(b"".join(path.read_bytes() for path in sorted(found))).hexdigest()


def _file_of(module: str) -> Path | None:
    place = _ROOT.joinpath(*module.split("."))
    return next((path for path in (place.with_suffix(".py"), place / "__init__.py") if path.is_file()), None)
