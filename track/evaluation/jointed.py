"""A person made movable by their own bones: hinges between landmarks of theirs, and skin that follows the bones.

Joints turn about lines through landmarks of the person's own bones; every bone moves as a rigid body, so that the
truth of a motion is where the bones are. How much skin follows which bone is found on the person's own skin, as
heat that flows along it from each bone's nearest places (Baran & Popovic 2007):

    (K + M H) w_b = M H n_b,        H = diag(1 / d^2)

with K the cotangent stiffness and M the mass of the surface, d (V,) the distance to the nearest bone and n_b (V,)
1 where that bone is b. Skin is carried by dual quaternions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import igl
import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from adapt.anatomy import Floats
from adapt.template_builder.meshes import Mesh
from capture.rigid import exp_so3, transform
from track.accuracy.mesh_distance import distance_to_mesh
from track.evaluation.skinning import dual_quaternions

_NEAREST_M = 0.002  # skin that touches a bone counts as this near


@dataclass(frozen=True)
class Turn:
    """One turn about a line at rest, through ``at`` towards ``to``; it rides on its ``parent`` (None: on nothing).

    ``to`` is another landmark, or an axis ("forward", "up", "right") at rest.
    """

    name: str
    parent: str | None
    at: str
    to: str
    share: float = 1.0  # of the angle that is asked for


AXES = {
    "forward": np.array([1.0, 0.0, 0.0]),
    "up": np.array([0.0, 1.0, 0.0]),
    "right": np.array([0.0, 0.0, 1.0]),
}


@dataclass(frozen=True, eq=False)
class Jointed:
    """A limb at rest: skin, bones and landmarks (m), turns with parents before children, and what each bone rides on.

    ``weights`` (V, B): how much each vertex of the skin follows each bone, in the bones' order.
    """

    skin: Mesh
    bones: dict[str, Mesh]
    landmarks: dict[str, Floats] = field(repr=False)
    turns: tuple[Turn, ...]
    rides: dict[str, str | None]
    weights: Floats = field(repr=False)

    def motions(self, degrees: Mapping[str, float], world: Floats) -> dict[str, Floats]:
        """(4, 4) of every bone from rest to the pose with so many degrees at each turn, carried by ``world`` (4, 4)."""
        moved: dict[str | None, Floats] = {None: world}
        for turn in self.turns:
            moved[turn.name] = moved[turn.parent] @ self._turned(turn, degrees.get(turn.name, 0.0))
        return {bone: moved[joint] for bone, joint in self.rides.items()}

    def _turned(self, turn: Turn, degrees: float) -> Floats:
        at = self.landmarks[turn.at]
        axis = AXES[turn.to] if turn.to in AXES else self.landmarks[turn.to] - at
        rotation = exp_so3(np.deg2rad(turn.share * degrees) * axis / np.linalg.norm(axis))
        return transform(rotation, at - rotation @ at)

    def posed_skin(self, motions: Mapping[str, Floats]) -> Floats:
        """Vertices (V, 3) of the skin where the bones' motions carry it."""
        return dual_quaternions(self.skin.vertices, self.weights, np.array([motions[name] for name in self.bones]))


def heat_weights(skin: Mesh, bones: Sequence[Mesh]) -> Floats:
    """How much each vertex of a closed skin follows each bone: (V, B), in [0, 1], rows sum to one."""
    distance = np.array([distance_to_mesh(skin.vertices, bone.vertices, bone.faces) for bone in bones])
    nearest = distance.argmin(axis=0)[:, None] == np.arange(len(bones))
    mass = igl.massmatrix(skin.vertices, skin.faces, igl.MASSMATRIX_TYPE_VORONOI)
    heat = mass @ sparse.diags(1.0 / np.maximum(distance.min(axis=0), _NEAREST_M) ** 2)
    stiffness = -igl.cotmatrix(skin.vertices, skin.faces)
    found = splu((stiffness + heat).tocsc()).solve(np.asarray(heat @ nearest.astype(np.float64)))
    found = np.clip(found, 0.0, 1.0)  # obtuse triangles overshoot a little
    return np.asarray(found / found.sum(axis=1, keepdims=True))


def shared_along(weights: Floats, points: Floats, first: int, second: int, start: Floats, end: Floats) -> Floats:
    """Weights (V, B) in which two bones share what they have: linearly from ``start`` (3,) to ``end``."""
    t = np.clip((points - start) @ (end - start) / ((end - start) @ (end - start)), 0.0, 1.0)
    both, shared = weights[:, first] + weights[:, second], weights.copy()
    shared[:, first], shared[:, second] = both * (1.0 - t), both * t
    return shared
