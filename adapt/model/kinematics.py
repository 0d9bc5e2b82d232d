"""The chain of joints: from theta and the landmarks to every bone's skinning transform (equation 1)."""

from __future__ import annotations

from adapt.anatomy import Anatomy, Floats
from adapt.model.derivatives import Motion, Points
from adapt.model.joints import carried_by


def bone_motions(anatomy: Anatomy, theta: Floats, p: Points, *, first_column: int = 0) -> dict[str, Motion]:
    """T_b(theta, p) of every bone, by name: the motion from its rest pose to its pose.

    ``theta`` (rad, m) is in the order of ``anatomy.coordinates``; its derivative columns start at
    ``first_column`` of the parameters that ``p`` varies with (p.n must leave room for them).

    >>> import numpy as np
    >>> from adapt.anatomy_file import load_anatomy
    >>> from adapt.model.derivatives import constant_points
    >>> arm = load_anatomy("upper-limb-right")
    >>> theta = np.array([coordinate.rest for coordinate in arm.coordinates])
    >>> p = constant_points(arm.landmarks, len(theta))  # columns of theta, none of the shape
    >>> motions = bone_motions(arm, theta, p)
    >>> list(motions), motions["hand"].d_rotation.shape, motions["ulna"].d_rotation[:, -2:].any().item()
    (['humerus', 'ulna', 'radius', 'hand'], (3, 10), False)
    """
    motions: dict[str, Motion] = {}
    for joint in anatomy.joints:
        motions[joint.child] = carried_by(anatomy, joint, theta, p, first_column, motions)
    return motions


def bones_beyond(anatomy: Anatomy, bone: str) -> list[str]:
    """A bone and all that hang on it.

    >>> from adapt.anatomy_file import load_anatomy
    >>> bones_beyond(load_anatomy("lower-limb-right"), "tibia")
    ['tibia', 'foot']
    """
    bones = [bone]
    for joint in anatomy.joints:  # parents come before their children
        if joint.parent in bones:
            bones.append(joint.child)
    return bones
