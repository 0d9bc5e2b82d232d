"""Skin near a bending joint, which follows the model less well than calm skin does and so counts less.

Tissue bunches up in front of an elbow and is drawn taut over it, otherwise in every person than the model says. What
the skin there is off by is no evidence of where the bones are. So each match near a bend is doubted: it is taken to be
off by s times the fit's noise besides the noise itself, and its weight is multiplied by

    trust = 1 / (1 + sum over the joints of s^2),     s = SIZE sin(min(alpha, 90 deg)) exp(-d^2 / (2 REACH_M^2))

- alpha is how far the joint is bent away from the rest pose, in which the template's skin is what it is: the angle by
  which the limb's direction across the joint has come apart on the two bones that it joins. A ball (a hip) bends like a
  hinge, whatever the direction; a twist about the limb's own direction (a forearm, a thigh) bends nothing: skin that is
  twisted slides along the surface and hardly leaves it.
- d is the vertex' distance, at rest, from the skin that rides on both sides of the joint, which deformers of every type
  tell (``bone_shares``). A root joins the limb to nothing and does not bend.

There are no unknowns in it, and it is an assumption, not a law of tissue. It was found by experiment on people who are
not of our model's making (arms and legs of MakeHuman's, docs/uncertainty.md): with the weights of calm skin, what
bends differently was explained by longer bones and joints out of place.

Matches keep the trust of the pose in which they were found while a solve moves the pose on. Were it to follow, bending
a joint would lower the cost of all skin near it, and poses would drift towards the bent ones.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from scipy.spatial import cKDTree

from adapt.anatomy import Anatomy, Floats, Ints
from adapt.model.body import Body, make_body
from adapt.model.compiled.chain import move_bones
from adapt.model.kinematics import bones_beyond

SIZE = 4.0  # what skin of a joint bent by 90 degrees is off by, in units of the fit's noise
REACH_M = 0.04  # how far from a bend skin still feels it
_BOTH = 0.1  # skin of which this share rides on one side of a joint, and not all of the rest on the other, bends
_AROUND_M = 0.1  # skin by which the limb's direction at a joint is told


@dataclass(frozen=True)
class _Bends:
    """J joints with skin on both sides: the bones' numbers (J, 2), the limb's direction (J, 3), nearness (V, J)."""

    bones: Ints
    direction: Floats
    nearness: Floats = field(repr=False)


def bend_trust(body: Body, theta: Floats, vertices: Ints | slice = slice(None)) -> Floats:
    """How much some ``vertices`` (N,) of the skin, in the pose theta (n,), count against calm skin: (0, 1].

    >>> from adapt.anatomy_file import load_anatomy
    >>> from adapt.model.body import rest_theta
    >>> arm = make_body(load_anatomy("upper-limb-right"))
    >>> theta = rest_theta(arm)
    >>> float(bend_trust(arm, theta).min())
    1.0
    >>> theta[arm.anatomy.coordinate_index("elbow_flexion")] += np.pi / 2.0
    >>> round(float(bend_trust(arm, theta).min()), 3)  # in the bend of the elbow: 1 / (1 + 4^2)
    0.059
    """
    bends = _bends(body.anatomy)
    turns = move_bones(body.prepared.chain, np.asarray(theta, dtype=np.float64)).rotation[bends.bones]
    one, other = np.matmul(turns, bends.direction[:, None, :, None])[..., 0].transpose(1, 0, 2)
    sine = np.linalg.norm(np.cross(one, other), axis=1)
    bent = np.where((one * other).sum(axis=1) > 0.0, sine, 1.0)  # beyond 90 degrees as much as there
    return np.asarray(1.0 / (1.0 + bends.nearness[vertices] ** 2 @ (SIZE * bent) ** 2))


@lru_cache(maxsize=8)
def _bends(anatomy: Anatomy) -> _Bends:
    """Where an anatomy's skin bends, told at the template's size: bodies differ from it by less than the reach."""
    riding = make_body(anatomy).skin_riding
    names = [bone.name for bone in anatomy.bones]
    bones, directions, nearness = [], [], []
    for joint in anatomy.joints:
        if joint.parent is None:
            continue
        share = riding[:, np.isin(names, bones_beyond(anatomy, joint.child))].sum(axis=1)
        of_faces = share[anatomy.skin_faces]
        bending = (of_faces.max(axis=1) > _BOTH) & (of_faces.min(axis=1) < 1.0 - _BOTH)
        if not bending.any():
            continue  # no skin rides on one of its sides: a kneecap
        zone = anatomy.skin_vertices[np.unique(anatomy.skin_faces[bending])]
        bones.append((names.index(joint.parent), names.index(joint.child)))
        directions.append(_direction(anatomy.skin_vertices, share, zone.mean(axis=0)))
        nearness.append(np.exp(-0.5 * (cKDTree(zone).query(anatomy.skin_vertices)[0] / REACH_M) ** 2))
    joined = np.array(bones, dtype=np.int64).reshape(-1, 2)
    towards = np.array(directions, dtype=np.float64).reshape(-1, 3)
    near = np.array(nearness, dtype=np.float64).reshape(-1, len(anatomy.skin_vertices))
    return _Bends(joined, towards, np.ascontiguousarray(near.T))


def _direction(skin: Floats, share: Floats, middle: Floats) -> Floats:
    """The limb's direction (3,) across a joint: from the skin (V, 3) before it to that beyond, near its middle (3,)."""
    near = np.exp(-0.5 * (((skin - middle) / _AROUND_M) ** 2).sum(axis=1))
    across = np.average(skin, axis=0, weights=near * share) - np.average(skin, axis=0, weights=near * (1.0 - share))
    return np.asarray(across / np.linalg.norm(across))
