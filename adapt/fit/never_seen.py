"""Bones of which no pose ever showed anything: a lost hand, a foot below the image's edge.

A cloud that ends where the template goes on pulls at the skin beside its end: matched to a stump's end, a forearm
shrinks until its wrist lies there. So the skin of bones that were never seen, and skin beside places where the sensors
looked and found nothing, takes no part in fitting; how long the last bone in sight is stays with what is known of
bodies beforehand, and where it ends is not claimed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from adapt.anatomy import Anatomy, Floats
from adapt.match.correspondences import Target
from adapt.match.skin_sample import SkinSample
from adapt.model.body import Body
from adapt.search.pose_score import find_skin, skin_found

_IN_SIGHT, _FOUND = 0.1, 0.55  # of a bone's skin, and of that; a lost hand, folded onto the stump, is found to half
_RIDES = 0.02  # skin of which this share rides on a bone that nobody saw cannot be placed
_BESIDE_M = 0.03  # skin this near to skin that is not there may be matched to where the limb ends

Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class NeverSeen:
    """Names of the bones never seen, and the skin (V,) that takes no part in fitting because of them."""

    bones: tuple[str, ...]
    skin: Bools = field(repr=False)

    def report(self, anatomy: Anatomy) -> dict[str, list[str]]:
        """What a subject says of it."""
        return {"bones_never_seen": list(self.bones), "lengths_guessed": guessed_lengths(anatomy, self.bones)}


def never_seen(body: Body, poses: Sequence[tuple[Target, Floats]], sample: SkinSample) -> NeverSeen:
    """What none of K clouds with poses (n,) shows."""
    with_skin: set[str] = set()
    shown: set[str] = set()
    looked_at, found = np.zeros(len(body.v_hat), dtype=bool), np.zeros(len(body.v_hat), dtype=bool)
    for target, theta in poses:
        parts = find_skin(body, target, theta, sample).bones
        with_skin |= parts.keys()
        shown |= {name for name, part in parts.items() if part.in_sight >= _IN_SIGHT and part.coverage >= _FOUND}
        in_sight, near = skin_found(body, target, theta, sample)
        looked_at |= in_sight
        found |= near
    bones = tuple(bone.name for bone in body.anatomy.bones if bone.name in with_skin - shown)
    if not bones:
        return NeverSeen((), np.zeros(len(body.v_hat), dtype=bool))
    skin, absent = skin_of(body, bones), looked_at & ~found
    if absent.any():
        skin |= cKDTree(body.v_hat[absent]).query(body.v_hat)[0] < _BESIDE_M
    return NeverSeen(bones, skin)


def skin_of(body: Body, bones: Sequence[str]) -> Bools:
    """The skin (V,) of which something rides on these bones.

    >>> from adapt.anatomy_file import load_anatomy
    >>> from adapt.model.body import make_body
    >>> body = make_body(load_anatomy("upper-limb-right"))
    >>> round(float(skin_of(body, ["hand"]).mean()), 2), round(float(skin_of(body, ["hand", "humerus"]).mean()), 2)
    (0.23, 0.77)
    """
    names = [bone.name for bone in body.anatomy.bones]
    return np.asarray(body.skin_riding[:, [name in bones for name in names]].sum(axis=1) > _RIDES)


def without(sample: SkinSample, skin: Bools) -> SkinSample:
    """The sample without some of the skin (V,).

    >>> from adapt.anatomy_file import load_anatomy
    >>> from adapt.match.skin_sample import sample_skin
    >>> from adapt.model.body import make_body
    >>> body = make_body(load_anatomy("upper-limb-right"))
    >>> sample = sample_skin(body.anatomy)
    >>> left = without(sample, skin_of(body, ["hand"]))
    >>> len(left.vertices) < len(sample.vertices), len(left.observations) == len(sample.observations)
    (True, True)
    """
    kept = ~skin[sample.vertices]
    return replace(
        sample,
        vertices=sample.vertices[kept],
        observations=np.where(skin, 0.0, sample.observations),
        onto_vertices=sample.onto_vertices[kept],
    )


def ends(anatomy: Anatomy, bones: Sequence[str]) -> list[str]:
    """The joints that bones which were never seen hang on, or hold: nothing tells where their centres are.

    >>> from adapt.anatomy_file import load_anatomy
    >>> ends(load_anatomy("upper-limb-right"), ["hand"]), ends(load_anatomy("lower-limb-right"), ["tibia"])
    (['wrist'], ['knee', 'ankle'])
    """
    return [joint.name for joint in anatomy.joints if {joint.parent, joint.child} & set(bones)]


def guessed_lengths(anatomy: Anatomy, bones: Sequence[str]) -> list[str]:
    """The bones in sight that end at a joint with a bone that was never seen: how long they are is a guess.

    >>> from adapt.anatomy_file import load_anatomy
    >>> guessed_lengths(load_anatomy("upper-limb-right"), ["hand"])
    ['ulna', 'radius']
    >>> guessed_lengths(load_anatomy("lower-limb-right"), ["pelvis"])
    ['femur']
    """
    touched = {handle.joint for handle in anatomy.handles if handle.bone in bones}
    names = dict.fromkeys(handle.bone for handle in anatomy.handles if handle.joint in touched)
    return [name for name in names if name not in bones]
