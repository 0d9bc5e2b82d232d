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
    return cast(Callable[_P, _R], numba.njit(cache=True, error_model="numpy", nogil=True)(function))


def compiled_sums(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """The same where sums may be taken in any order, so that the processor can take several terms at once."""
    options = {"cache": True, "error_model": "numpy", "nogil": True, "fastmath": {"reassoc", "nsz", "contract"}}
    return cast(Callable[_P, _R], numba.njit(**options)(function))
