"""People of MakeHuman's data (CC0), in a rig: their shapes, joint centres and which part each triangle belongs to.

X is forward, Y up, Z to the person's right; metres. A rig's bone turns about its head, in the axes of the rest pose:
G_b = G_parent(b) T(h_b) R_b T(-h_b), and the skin follows by linear blending of the rig's weights.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from adapt.search.figure.names import JOINTS, PARTS
from adapt.template_builder.makehuman_rigs import bone_weights, head_of, parents_first, rig_files
from adapt.template_builder.sources_makehuman import data_folder, joint_cubes, load_skin, shape_target, shaped_points

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_SIDES = {"l": "Left", "r": "Right"}
_MIXAMO_FINGERS = ("Index1", "Middle1", "Ring1", "Pinky1")
BONES: dict[str, dict[str, tuple[str, ...]]] = {
    "cmu_mb": {
        "pelvis": ("Hips",),
        "spine": ("LowerBack", "Spine", "Spine1"),
        "neck": ("Neck", "Neck1"),
        "head": ("Head",),
        **{f"clavicle_{s}": (f"{side}Shoulder",) for s, side in _SIDES.items()},
        **{f"upper_arm_{s}": (f"{side}Arm",) for s, side in _SIDES.items()},
        **{f"forearm_{s}": (f"{side}ForeArm",) for s, side in _SIDES.items()},
        **{f"hand_{s}": (f"{side}Hand",) for s, side in _SIDES.items()},
        **{f"fingers_{s}": (f"{side}FingerBase", f"{side}HandFinger1") for s, side in _SIDES.items()},
        **{f"thigh_{s}": (f"{side}UpLeg",) for s, side in _SIDES.items()},
        **{f"shank_{s}": (f"{side}Leg",) for s, side in _SIDES.items()},
        **{f"foot_{s}": (f"{side}Foot",) for s, side in _SIDES.items()},
    },
    "mixamo": {
        "pelvis": ("Hips",),
        "spine": ("Spine", "Spine1", "Spine2"),
        "neck": ("Neck",),
        "head": ("Head",),
        **{f"clavicle_{s}": (f"{side}Shoulder",) for s, side in _SIDES.items()},
        **{f"upper_arm_{s}": (f"{side}Arm",) for s, side in _SIDES.items()},
        **{f"forearm_{s}": (f"{side}ForeArm",) for s, side in _SIDES.items()},
        **{f"hand_{s}": (f"{side}Hand",) for s, side in _SIDES.items()},
        **{f"fingers_{s}": tuple(f"{side}Hand{f}" for f in _MIXAMO_FINGERS) for s, side in _SIDES.items()},
        **{f"thigh_{s}": (f"{side}UpLeg",) for s, side in _SIDES.items()},
        **{f"shank_{s}": (f"{side}Leg",) for s, side in _SIDES.items()},
        **{f"foot_{s}": (f"{side}Foot",) for s, side in _SIDES.items()},
    },
}
"""The rigs' bones by what they move; several bones share a turn, or each take all of it (fingers side by side)."""

_PREFIX = {"cmu_mb": "", "mixamo": "mixamorig:"}
_CUBES = {"head": "head-2", "wrist": "hand", "finger": "finger-3-1", "hip": "upper-leg", "toe": "foot-1"}
_CARRIERS = {
    "pelvis": "pelvis",
    "neck": "neck",
    "head": "head",
    "shoulder": "upper_arm",
    "elbow": "forearm",
    "wrist": "hand",
    "finger": "hand",
    "hip": "thigh",
    "knee": "shank",
    "ankle": "foot",
    "toe": "foot",
}
_LARGER = {
    "forearm": "lower_arm",
    "neck": "head",
    "pelvis": "trunk",
    "spine": "trunk",
    "clavicle": "trunk",
    "fingers": "hand",
}


def joint_cube(joint: str) -> str:
    """The name of the joint centre in MakeHuman's base mesh.

    >>> joint_cube("wrist_l"), joint_cube("head")
    ('l-hand', 'head-2')
    """
    kind, _, side = joint.partition("_")
    return f"{side}-{_CUBES.get(kind, kind)}" if side else _CUBES.get(kind, kind)


@dataclass(frozen=True)
class Phenotype:
    """Shares of what MakeHuman's targets stand for: all 0 to 1; ``origins`` of African, Asian, Caucasian sum to 1."""

    male: float
    old: float
    child: float
    muscle: float
    weight: float
    height: float
    proportions: float
    origins: tuple[float, float, float]
    size: float  # by which the whole body is scaled


def draw_phenotype(rng: np.random.Generator) -> Phenotype:
    """A person at random: mostly grown up, women and men, 1.45 to 2 m; a few children."""
    male = float(rng.integers(2)) if rng.random() < 0.8 else rng.random()
    child = rng.uniform(0.3, 0.9) if rng.random() < 0.06 else 0.0
    origins = rng.dirichlet([0.7, 0.7, 0.7])
    return Phenotype(
        male=male,
        old=float(rng.random() ** 2) if child == 0.0 else 0.0,
        child=child,
        muscle=rng.uniform(0.05, 1.0),
        weight=rng.uniform(0.0, 1.0),
        height=float(np.clip(rng.normal(0.46, 0.12), 0.08, 0.9)),
        proportions=rng.uniform(0.0, 1.0),
        origins=(float(origins[0]), float(origins[1]), float(origins[2])),
        size=rng.uniform(0.96, 1.04),
    )


def target_weights(phenotype: Phenotype) -> dict[str, float]:
    """The shape targets (folder/name) of a phenotype with their weights, as MakeHuman combines them."""
    p = phenotype
    weights: dict[str, float] = {}
    sexes = {"female": 1.0 - p.male, "male": p.male}
    ages = {"young": (1.0 - p.old) * (1.0 - p.child), "old": p.old * (1.0 - p.child), "child": p.child}
    for (origin, a), (sex, b), (age, c) in product(
        zip(("african", "asian", "caucasian"), p.origins, strict=True), sexes.items(), ages.items()
    ):
        weights[f"macrodetails/{origin}-{sex}-{age}"] = a * b * c
    towards = "maxheight" if p.height > 0.5 else "minheight"
    shape = "idealproportions" if p.proportions > 0.5 else "uncommonproportions"
    for (sex, a), (age, b), (muscle, c), (weight, d) in product(
        sexes.items(), ages.items(), _three(p.muscle, "muscle").items(), _three(p.weight, "weight").items()
    ):
        share, build = a * b * c * d, f"{muscle}-{weight}"
        weights[f"macrodetails/universal-{sex}-{age}-{build}"] = share
        weights[f"macrodetails/height/{sex}-{age}-{build}-{towards}"] = share * abs(2.0 * p.height - 1.0)
        weights[f"macrodetails/proportions/{sex}-{age}-{build}-{shape}"] = share * abs(2.0 * p.proportions - 1.0)
    return {name: weight for name, weight in weights.items() if weight > 1e-3 and _exists(name)}


def _three(value: float, what: str) -> dict[str, float]:
    low, high = max(0.0, 1.0 - 2.0 * value), max(0.0, 2.0 * value - 1.0)
    return {f"min{what}": low, f"average{what}": 1.0 - low - high, f"max{what}": high}


@lru_cache(maxsize=512)
def _exists(name: str) -> bool:
    return (data_folder() / "targets" / f"{name}.target.gz").exists()


@lru_cache(maxsize=256)
def _target(name: str) -> NDArray[np.float32]:
    return shape_target(name).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Person:
    """A body at rest: skin (V, 3) m of the rig's vertices, the rig's heads (B, 3), joints (19, 3), middles of cubes."""

    skin: Floats = field(repr=False)
    heads: Floats = field(repr=False)
    joints: Floats = field(repr=False)
    cubes: dict[str, Floats] = field(repr=False)


class Rig:
    """One of MakeHuman's rigs with the base mesh's triangles: what does not depend on who it is."""

    def __init__(self, which: str = "cmu_mb") -> None:
        bones, shares = rig_files(which)
        prefix = _PREFIX[which]
        self.names = parents_first({name: bone["parent"] for name, bone in bones.items()})
        self.parents = [self.names.index(p) if (p := bones[name]["parent"]) else -1 for name in self.names]
        self.role_bones = {
            role: [self.names.index(prefix + name) for name in names] for role, names in BONES[which].items()
        }
        self._points = [bones[name]["head"] for name in self.names]
        self._base = shaped_points({})
        plain = load_skin({}, stature=1.7)
        self.used = np.unique(plain.quads)
        quads = np.searchsorted(self.used, plain.quads)
        self.faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
        self._cubes = joint_cubes()
        weights = bone_weights(self.names, shares, len(self._base))[self.used]
        bare = weights.sum(axis=1) == 0.0
        weights[bare, self.role_bones["pelvis"][0]] = 1.0
        self.weights = sparse.csr_matrix(weights)
        self.vertex_parts = self._bone_parts()[weights.argmax(axis=1)]
        self.face_parts = self.vertex_parts[self.faces[:, 0]]

    def _bone_parts(self) -> NDArray[np.uint8]:
        """The part that each bone belongs to: that of the nearest bone with a role, upwards."""
        roles = {bone: role for role, bones in self.role_bones.items() for bone in bones}
        parts = np.zeros(len(self.names), dtype=np.uint8)
        for b in range(len(self.names)):
            at = b
            while at not in roles and self.parents[at] >= 0:
                at = self.parents[at]
            kind, side = _kind_and_side(roles.get(at, "pelvis"))
            larger = _LARGER.get(kind, kind)
            parts[b] = PARTS.index(larger if larger in PARTS else larger + side)
        return parts

    def person(self, phenotype: Phenotype) -> Person:
        """The body of a phenotype, at rest and without clothes."""
        points = self._base.copy()
        for name, weight in target_weights(phenotype).items():
            points += np.float32(weight) * _target(name)
        points *= phenotype.size
        cubes = {name: points[rows].mean(axis=0) for name, rows in self._cubes.items()}
        heads = np.array([head_of(point, points, cubes) for point in self._points])
        joints = np.array([cubes[joint_cube(joint)] for joint in JOINTS])
        return Person(points[self.used], heads, joints, cubes)

    def pose(self, person: Person, turns: Mapping[str, Floats], skin: Floats | None = None) -> tuple[Floats, Floats]:
        """Skin (V, 3) and joint centres (19, 3) m in a pose: rotations (3, 3) by role, shared by a chain's bones.

        ``skin`` (V, 3) is what stands at rest instead of the bare skin: clothes.
        """
        moved = self.transforms(person.heads, turns)
        rows = (self.weights @ moved[:, :3].reshape(-1, 12)).reshape(-1, 3, 4)
        rest = person.skin if skin is None else skin
        posed = np.einsum("nij,nj->ni", rows[:, :, :3], rest) + rows[:, :, 3]
        carriers = [self.role_bones[_carrier(joint)][0] for joint in JOINTS]
        joints = np.einsum("nij,nj->ni", moved[carriers, :3, :3], person.joints) + moved[carriers, :3, 3]
        return posed, joints

    def transforms(self, heads: Floats, turns: Mapping[str, Floats]) -> Floats:
        """(B, 4, 4) from rest to the pose."""
        own = {bone: turn for role, turn in turns.items() for bone in self.role_bones[role]}
        moved = np.tile(np.eye(4), (len(self.names), 1, 1))
        for b, parent in enumerate(self.parents):
            if b in own:
                moved[b, :3, :3] = own[b]
                moved[b, :3, 3] = heads[b] - own[b] @ heads[b]
            if parent >= 0:
                moved[b] = moved[parent] @ moved[b]
        return moved


def _kind_and_side(role: str) -> tuple[str, str]:
    return (role[:-2], role[-2:]) if role[-2:] in ("_l", "_r") else (role, "")


def _carrier(joint: str) -> str:
    kind, side = _kind_and_side(joint)
    return _CARRIERS[kind] + side
