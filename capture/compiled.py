"""Loops that array operations would only make slow, compiled once by numba and kept beside the source.

A module that uses this is imported where its work begins, because numba alone takes half a second to import. Every
compiled function has a twin in plain NumPy that a test compares it with.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

import numba

_P = ParamSpec("_P")
_R = TypeVar("_R")


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
        return machine_code(cache=True)
    except RuntimeError:  # nowhere to keep it: installed read-only, and no folder of the user's own
        return machine_code(cache=False)
