"""Finished stages of a long build, kept on disk: a build that was broken off, or changed late, goes on from there."""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

import numpy as np

from adapt.template_builder.meshes import Mesh
from capture.files import replaced_when_complete

T = TypeVar("T")


def _digest(parts: tuple[Any, ...]) -> str:
    told = hashlib.sha256()
    for part in parts:
        if isinstance(part, np.ndarray):
            told.update(f"{part.dtype}{part.shape}".encode() + part.tobytes())
        elif isinstance(part, Mesh):
            told.update(_digest((part.vertices, part.faces)).encode())
        elif isinstance(part, ModuleType):
            told.update(Path(str(part.__file__)).read_bytes())
        else:
            told.update(repr(part).encode())
    return told.hexdigest()[:16]


@dataclass(frozen=True)
class Stages:
    """A folder of stages' results; None keeps nothing.

    The files are Python pickles: they are read back from the builder's own folder alone, and must not be shared.
    """

    folder: Path | None

    def kept(self, name: str, of: tuple[Any, ...], make: Callable[[], T]) -> T:
        """What ``make`` gives, made anew only where no result of that name was kept with the same ``of``.

        ``of`` is all that the result depends on: arrays by their bytes, meshes by their arrays, modules by their text,
        other data by its repr.
        """
        if self.folder is None:
            return make()
        path = self.folder / f"{name}-{_digest(of)}.pickle"
        if path.is_file():
            result: T = pickle.loads(path.read_bytes())
            return result
        result = make()
        self.folder.mkdir(parents=True, exist_ok=True)
        with replaced_when_complete(path) as partial:
            partial.write_bytes(pickle.dumps(result))
        return result
