"""Joints of which a cloud tells nothing, because all bones on one side of them are out of sight.

The cloud says how the bones in sight stand, but not how the hidden ones beyond do: with thigh and pelvis hidden, any
angle of the knee explains a shank. Such joints are best guessed to be at rest, with the bones in sight where they were.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Anatomy, Floats
from adapt.model.body import Body, bone_transforms
from adapt.model.kinematics import bones_beyond
from adapt.model.pose_space import is_free, moved_rigidly
from capture.rigid import inverse

Bools = NDArray[np.bool_]


def unobserved_coordinates(anatomy: Anatomy, shown: Bools) -> Bools:
    """Which joint coordinates (n,) lie between bones (B,) of which none shows on the one side, or none on the other.

    >>> from adapt.anatomy_file import load_anatomy
    >>> arm = load_anatomy("upper-limb-right")
    >>> shown = np.array([bone.name in ("humerus", "ulna") for bone in arm.bones])
    >>> [arm.coordinates[k].name for k in np.flatnonzero(unobserved_coordinates(arm, shown))]
    ['pro_sup', 'deviation', 'flexion']
    """
    names = [bone.name for bone in anatomy.bones]
    told = np.zeros(len(anatomy.coordinates), dtype=bool)
    for joint in anatomy.joints:
        beyond = np.isin(names, bones_beyond(anatomy, joint.child))
        for name in joint.coordinates:
            sides = shown[beyond].any() and shown[~beyond].any()
            told[anatomy.coordinate_index(name)] |= is_free(joint) or sides
    return np.asarray(~told)


def towards_rest(body: Body, theta: Floats, last: Floats, shown: Bools, kept: float) -> Floats:
    """The pose ``theta`` (n,) with what is unobserved where ``last`` (n,) has it, but for the share of the way to rest.

    ``kept`` is the share of the distance from rest that stays. The root moves so that the bones (B,) that show stay
    where ``theta`` has them.

    >>> from adapt.anatomy_file import load_anatomy
    >>> from adapt.model.body import make_body, rest_theta
    >>> arm = make_body(load_anatomy("upper-limb-right"))
    >>> rest, last = rest_theta(arm), rest_theta(arm) + 0.2
    >>> shown = np.array([name != "hand" for name in arm.rest_bones])
    >>> (towards_rest(arm, rest, last, shown, 0.5) - rest)[6:].round(6).tolist()  # elbow, forearm, and twice the wrist
    [0.0, 0.0, 0.1, 0.1]
    """
    anatomy = body.anatomy
    free = unobserved_coordinates(anatomy, shown)
    if not free.any() or not shown.any():
        return theta
    rest = np.array([coordinate.rest for coordinate in anatomy.coordinates])
    guess = np.where(free, rest + kept * (last - rest), theta)
    first = anatomy.bones[int(shown.argmax())].name
    move = bone_transforms(body, theta)[first] @ inverse(bone_transforms(body, guess)[first])
    return moved_rigidly(anatomy, guess, move)
