"""Which bones show in a frame, and what is known where not all do.

A bone shows when enough of the skin that rides on it is in sight and is found where the pose says. Where a bone does
not show, its pose is a guess from its neighbours and from the past: good enough to start the next frame from, but
nothing to hand on.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Anatomy, Floats, Joint
from adapt.fit.judge import FOLLOWED, Bounds, shows
from adapt.model.body import Body
from adapt.model.joints import JOINT_TYPES
from adapt.search.pose_score import FoundPart

Bools = NDArray[np.bool_]


def bones_shown(anatomy: Anatomy, skin: Mapping[str, FoundPart], bounds: Bounds = FOLLOWED) -> Bools:
    """Which bones (B,) show, given how the skin of those that have any is found.

    A bone without skin of its own is placed by a coordinate that it shares (a kneecap) or by a second bone that it
    reaches to (a collar bone): it shows when its parent shows and so does that other bone.
    """
    own = {name: shows(part, bounds) for name, part in skin.items()}
    return np.array([own[b.name] if b.name in own else _placed(anatomy, b.name, own) for b in anatomy.bones])


def _placed(anatomy: Anatomy, bone: str, shown: Mapping[str, bool]) -> bool:
    joint = next(joint for joint in anatomy.joints if joint.child == bone)
    others = [j.child for j in anatomy.joints if j is not joint and set(j.coordinates) & set(joint.coordinates)]
    if joint.other is not None:
        others.append(joint.other)
    return bool(others) and all(shown.get(name or "", False) for name in (joint.parent, *others))


def coordinates_known(anatomy: Anatomy, shown: Bools) -> Bools:
    """Which coordinates (T, n) are known where bones (T, B) show: those of a joint whose parent and child both do.

    A coordinate that joints share is known where it is known of one of them.

    >>> from adapt.anatomy_file import load_anatomy
    >>> anatomy = load_anatomy("upper-limb-right")
    >>> shown = np.array([[bone.name != "hand" for bone in anatomy.bones]])
    >>> known = coordinates_known(anatomy, shown)[0]
    >>> [coordinate.name for coordinate, told in zip(anatomy.coordinates, known, strict=True) if not told]
    ['deviation', 'flexion']
    """
    known = np.zeros((len(shown), len(anatomy.coordinates)), dtype=bool)
    for joint in anatomy.joints:
        ends = shown[:, _ends(anatomy, joint)].all(axis=1)
        for name in joint.coordinates:
            known[:, anatomy.coordinate_index(name)] |= ends
    return known


def coordinates_seen(anatomy: Anatomy, shown: Bools) -> Bools:
    """Which coordinates (n,) move a bone that shows, given which bones (B,) do: those whose change can be seen.

    >>> from adapt.anatomy_file import load_anatomy
    >>> anatomy = load_anatomy("upper-limb-right")
    >>> seen = coordinates_seen(anatomy, np.array([bone.name == "ulna" for bone in anatomy.bones]))
    >>> [coordinate.name for coordinate, told in zip(anatomy.coordinates, seen, strict=True) if not told]
    ['pro_sup', 'deviation', 'flexion']
    """
    moves = dict(zip((bone.name for bone in anatomy.bones), shown.tolist(), strict=True))
    seen = np.zeros(len(anatomy.coordinates), dtype=bool)
    for joint in reversed(anatomy.joints):  # children come after their parents
        for name in (joint.parent, joint.other):
            if name is not None:
                moves[name] |= moves[joint.child]
        for name in joint.coordinates:
            seen[anatomy.coordinate_index(name)] |= moves[joint.child]
    return seen


def known_thetas(anatomy: Anatomy, thetas: Floats, shown: Bools) -> Floats:
    """Poses (T, n) with NaN for what is not known where bones (T, B) show.

    >>> from adapt.anatomy_file import load_anatomy
    >>> anatomy = load_anatomy("upper-limb-right")
    >>> shown = np.array([[True, True, True, False]])  # all but the hand
    >>> known_thetas(anatomy, np.zeros((1, len(anatomy.coordinates))), shown)[0, -4:].tolist()
    [0.0, 0.0, nan, nan]
    """
    return np.where(coordinates_known(anatomy, shown), thetas, np.nan)


def centres_known(anatomy: Anatomy, shown: Bools) -> dict[str, Bools]:
    """In which frames (T,) each joint's centre is known where bones (T, B) show.

    The parent carries it, and so does a child that only turns about it; a child that glides does not.

    >>> from adapt.anatomy_file import load_anatomy
    >>> known = centres_known(load_anatomy("upper-limb-right"), np.array([[True, False, False, False]]))  # the humerus
    >>> {name: bool(told[0]) for name, told in known.items()}
    {'shoulder': True, 'elbow': True, 'radioulnar': False, 'wrist': False}
    """
    return {joint.name: np.asarray(shown[:, _carriers(anatomy, joint)].any(axis=1)) for joint in anatomy.joints}


def skin_shown(body: Body, shown: Bools) -> Bools:
    """Which skin vertices (V,) ride mostly on a bone that shows, given which bones (B,) do."""
    return np.asarray(shown[body.skin_riding.argmax(axis=1)])


def _ends(anatomy: Anatomy, joint: Joint) -> list[int]:
    """Indices of the bones that a joint joins; a free joint has one."""
    names = [bone.name for bone in anatomy.bones]
    return [names.index(name) for name in (joint.parent, joint.child) if name is not None]


def _carriers(anatomy: Anatomy, joint: Joint) -> list[int]:
    ends = _ends(anatomy, joint)
    return ends if JOINT_TYPES[joint.type].child_carries_centre else ends[:1]
