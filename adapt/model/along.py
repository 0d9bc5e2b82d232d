"""Bones along a curve: vertebrae and ribs, each vertex on its own share of the arc between two bones (anatomy.Bone)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from adapt.anatomy import Anatomy, Bone, Floats
from adapt.model.deformers.between import into_frames, out_of_frames
from adapt.model.derivatives import Motion, mere_points
from adapt.model.joints import arc_to, arched_joint


def posed_along(anatomy: Anatomy, bone: Bone, rest: Floats, p: Floats, transforms: Mapping[str, Floats]) -> Floats:
    """Posed surface (N, 3) m of a bone whose surface at rest is ``rest`` (N, 3).

    ``p`` (P, 3) m are the landmarks at rest, ``transforms`` T_b (4, 4) of the bones.
    """
    if bone.along is None:
        moved = transforms[bone.name]
        return np.asarray(rest @ moved[:3, :3].T + moved[:3, 3])
    arc, none = arc_to(anatomy, bone.name, mere_points(p)), np.zeros((len(rest), 0))
    local = into_frames(arc.frames(bone.along, none), rest)
    first, second = (still_motion(transforms[name]) for name in (base_of(anatomy, bone.name), bone.name))
    return out_of_frames(arc.moved(first, second).frames(bone.along, none), mere_points(local)).value


def base_of(anatomy: Anatomy, bone: str) -> str:
    """The bone on which the base of the arc rides that leads to a bone; the bone itself if there is none."""
    joint = arched_joint(anatomy, bone)
    return bone if joint is None or joint.parent is None else joint.parent


def still_motion(transform: Floats) -> Motion:
    """A rigid transform (4, 4) that varies with nothing."""
    return Motion(transform[:3, :3], transform[:3, 3], np.zeros((3, 0)), np.zeros((3, 0)))
