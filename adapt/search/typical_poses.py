"""The forms that a limb can take, whichever its joints: what a first search tries, before it knows anything.

Poses are drawn from the joints' ranges, those near the template's rest, a usual pose, more often. Two of them have the
same form when one skin can be laid on the other by a rigid motion, which the search finds anyway; so each is laid on
the straightest one, and poses in the middle of groups of like forms stand for all. A joint that hardly changes the form
is left to the fit.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.cluster.vq import kmeans2
from scipy.spatial.transform import Rotation

from adapt.anatomy import Anatomy, Floats
from adapt.match.skin_sample import sample_skin
from adapt.model.body import make_body, pose_skin
from adapt.model.pose_space import joint_coordinates

FORMS = 12
_DRAWN = 300
_VERTICES = 100


def straightest(anatomy: Anatomy) -> Floats:
    """The pose (n,) with every coordinate as near zero as it may be."""
    return np.array([np.clip(0.0, c.low, c.high) for c in anatomy.coordinates])


@lru_cache(maxsize=4)
def typical_forms(anatomy: Anatomy) -> tuple[Floats, ...]:
    """Poses (n,) that stand for all forms of the limb, the root at the origin: the same on every call."""
    drawn = _drawn(anatomy)
    forms = _forms(anatomy, drawn)
    middles, _ = kmeans2(forms, FORMS, minit="++", rng=0)
    nearest = ((forms[:, None] - middles) ** 2).sum(axis=2).argmin(axis=0)
    return tuple(drawn[k] for k in np.unique(nearest))


def _drawn(anatomy: Anatomy) -> Floats:
    """Poses (D, n): each joint coordinate by itself, most likely near its rest and never outside its range."""
    rng = np.random.default_rng(0)
    drawn = np.tile(straightest(anatomy), (_DRAWN, 1))
    for i in joint_coordinates(anatomy):
        coordinate = anatomy.coordinates[i]
        drawn[:, i] = rng.triangular(coordinate.low, coordinate.rest, coordinate.high, _DRAWN)
    return drawn


def _forms(anatomy: Anatomy, thetas: Floats) -> Floats:
    """Skin (D, 3 N) of poses (D, n), laid rigidly on the straightest, each vertex by how much it counts."""
    body, sample = make_body(anatomy), sample_skin(anatomy, at_most=_VERTICES)
    weights = sample.observations[sample.vertices]
    share = np.sqrt(weights / weights.sum())[:, None]

    def centred(theta: Floats) -> Floats:
        skin = pose_skin(body, theta, vertices=sample.vertices)
        return np.asarray(share * (skin - np.average(skin, axis=0, weights=weights)))

    straight = centred(straightest(anatomy))
    forms = [centred(theta) for theta in thetas]
    return np.array([Rotation.align_vectors(straight, form)[0].apply(form).ravel() for form in forms])
