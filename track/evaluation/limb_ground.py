"""What the template's own body gives to every other body of MakeHuman: our joints and landmarks, carried by its skin.

All of these bodies have the same vertices. Around a limb, the template's body tells by which weighted sums of them our
landmarks are found (see ``track.evaluation.skin_carried``); the same sums find them in anybody.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from adapt.anatomy import Anatomy, Floats, Ints
from adapt.anatomy_file import load_anatomy
from adapt.template_builder.plan import LimbPlan
from adapt.template_builder.skin import height_in
from adapt.template_builder.sources_makehuman import SourceSkin, load_skin
from track.evaluation.skin_carried import carrying_weights

_BEYOND_M = 0.10  # so much of the trunk beyond the template's cuts helps to carry what lies near them
_EVERY_M = 0.008  # vertices nearer to another than this add nothing


@dataclass(frozen=True, eq=False)
class LimbGround:
    """The limb in the template's body: which vertices carry, and the weights (P, W) of our landmarks."""

    anatomy: Anatomy
    body: SourceSkin = field(repr=False)
    carriers: Ints = field(repr=False)  # (W,) vertices of the body
    weights: Floats = field(repr=False)

    def landmarks(self, vertices: Floats) -> Floats:
        """Our landmarks (P, 3) m in a body with these vertices (N, 3)."""
        return np.asarray(self.weights @ vertices[self.carriers])

    def landmark(self, vertices: Floats, names: tuple[str, ...]) -> Floats:
        """The mean (3,) of some of them."""
        rows = [self.anatomy.landmark_index(name) for name in names]
        return np.asarray((self.weights[rows] @ vertices[self.carriers]).mean(axis=0))

    def centre(self, vertices: Floats, joint: str) -> Floats:
        """Where one of our joints (3,) is in that body."""
        return self.landmark(vertices, self.anatomy.joint(joint).centre)

    def skin(self, vertices: Floats) -> Floats:
        """Where the template's own skin vertices (V, 3) are in that body: slow."""
        return np.asarray(_skin_weights(self) @ vertices[self.carriers])


@lru_cache(maxsize=2)
def limb_ground(anatomy: str) -> LimbGround:
    """The ground of a template."""
    plan, ours = limb_plan(anatomy).skin, load_anatomy(anatomy)
    body = load_skin(plan.targets, stature=plan.stature)
    used = np.unique(body.quads)
    used = used[height_in(plan.cuts, body.vertices[used]) > -_BEYOND_M]
    spread = _spread(body.vertices[used])
    carriers = used[spread]
    return LimbGround(ours, body, carriers, carrying_weights(ours.landmarks, body.vertices[carriers]))


@lru_cache(maxsize=2)
def _skin_weights(ground: LimbGround) -> Floats:
    return carrying_weights(ground.anatomy.skin_vertices, ground.body.vertices[ground.carriers])


def _spread(points: Floats) -> Ints:
    """Indices of points none of which shares a cell of _EVERY_M with another."""
    _, first = np.unique(np.floor(points / _EVERY_M).astype(np.int64), axis=0, return_index=True)
    return np.sort(first)


def limb_plan(anatomy: str) -> LimbPlan:
    """How the template of that name is built."""
    from adapt.template_builder.__main__ import PLANS  # it needs what only the templates' build needs

    return PLANS[anatomy]
