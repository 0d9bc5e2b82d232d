"""Which of a person's two legs is the right one: the right one is on the right.

Shank and foot alone hardly tell their side, and where both legs are in view a search takes either. But toes point
forward and the knee bends back, so a leg tells where its person's right is, whichever side it is taken for; and as legs
do not pass through each other, the other leg of the same person lies on its own side of it. Arms cross, so of them
nothing follows.
"""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.model.body import Body, bone_transforms, pose_skin

_SHANK, _LOWER = "tibia", ("tibia", "foot")
_APART_M = (0.03, 0.5)  # legs nearer than that cross, those farther apart may be two people's
_SAME_WAY = 0.7  # cosine between the two legs' right: the legs of one person face the same way


def keeps_to_its_side(anatomy: Anatomy) -> bool:
    """Whether a limb stays on its own side of the other one of the same person.

    >>> from adapt.anatomy_file import load_anatomy
    >>> keeps_to_its_side(load_anatomy("lower-limb-right")), keeps_to_its_side(load_anatomy("upper-limb-right"))
    (True, False)
    """
    return anatomy.side != "both" and any(bone.name == _SHANK for bone in anatomy.bones)


def lies_on_its_side(body: Body, theta: Floats, other: Floats) -> bool | None:
    """Whether the leg at ``theta`` (n,) is on its side of the one at ``other`` (n,); None where that cannot be told.

    >>> from adapt.anatomy_file import load_anatomy
    >>> from adapt.model.body import make_body, rest_theta
    >>> leg = make_body(load_anatomy("lower-limb-right"))
    >>> theta, beside = rest_theta(leg), rest_theta(leg)
    >>> beside[leg.anatomy.coordinate_index("hip_tz")] -= 0.2  # 20 cm to the left
    >>> lies_on_its_side(leg, theta, beside), lies_on_its_side(leg, beside, theta), lies_on_its_side(leg, theta, theta)
    (True, False, None)
    """
    right, rights = _right(body, theta), _right(body, other)
    apart = (_lower_leg(body, theta) - _lower_leg(body, other)) @ (right + rights) / 2.0
    if right @ rights < _SAME_WAY or not _APART_M[0] < abs(apart) < _APART_M[1]:
        return None
    return bool((apart > 0.0) == (body.anatomy.side == "right"))


def is_nearer_to(body: Body, theta: Floats, mine: Floats, other: Floats) -> bool | None:
    """Whether a leg is the one at ``mine`` rather than the ``other`` of the same person at another time, all (n,).

    Feet swing past each other fore and aft, so how far they are across decides. None where the person turned, or both
    are too far away to tell.

    >>> from adapt.anatomy_file import load_anatomy
    >>> from adapt.model.body import make_body, rest_theta
    >>> leg = make_body(load_anatomy("lower-limb-right"))
    >>> mine, other, seen = (rest_theta(leg) for _ in range(3))
    >>> across = leg.anatomy.coordinate_index("hip_tz")
    >>> other[across], seen[across] = mine[across] - 0.2, mine[across] - 0.05  # m
    >>> is_nearer_to(leg, seen, mine, other)
    True
    """
    right = _right(body, mine)
    across = [(_lower_leg(body, theta) - _lower_leg(body, known)) @ right for known in (mine, other)]
    if _right(body, theta) @ right < _SAME_WAY or min(map(abs, across)) > _APART_M[1]:
        return None
    return bool(abs(across[0]) < abs(across[1]))


def _right(body: Body, theta: Floats) -> Floats:
    """Where the person's right is (3,), by the shank: the third axis of the rest pose."""
    return np.asarray(bone_transforms(body, theta)[_SHANK][:3, 2])


def _lower_leg(body: Body, theta: Floats) -> Floats:
    """The middle (3,) m of shank and foot."""
    shares = body.skin_riding[:, [bone.name in _LOWER for bone in body.anatomy.bones]].sum(axis=1)
    return np.asarray(np.average(pose_skin(body, theta), axis=0, weights=shares))
