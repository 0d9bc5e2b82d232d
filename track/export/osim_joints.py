"""The anatomy's joints as OpenSim has them: each joint's type states its form (adapt.model.joints).

OpenSim's joints do not share coordinates: a joint that follows another's (a kneecap the knee's) gets a coordinate of
its own, ``<coordinate>_beta`` as in OpenSim's models, and a CoordinateCouplerConstraint holds it equal.
"""

from __future__ import annotations

from collections.abc import Mapping

from adapt.anatomy import Anatomy, Floats
from adapt.model.body import Body, rest_theta
from adapt.model.frames import frame_from_landmarks
from adapt.model.joints import JOINT_TYPES
from adapt.model.joints.opensim import FOLLOWER, OsimJoint, Resting


def body_frames(body: Body) -> dict[str, Floats]:
    """F_b (4, 4) at rest of every bone: what the model's body frames are."""
    return {b.name: frame_from_landmarks(body.anatomy, b.frame, body.p).matrix() for b in body.anatomy.bones}


def coupled_coordinates(anatomy: Anatomy) -> dict[str, str]:
    """The model's coordinates that only follow another: dependent name to independent name.

    >>> from adapt.anatomy_file import load_anatomy
    >>> coupled_coordinates(load_anatomy("lower-limb-right"))  # the kneecap's follows the knee's
    {'knee_angle_r_beta': 'knee_angle_r'}
    """
    seen: set[str] = set()
    coupled: dict[str, str] = {}
    for joint in anatomy.joints:
        coupled |= {f"{name}{FOLLOWER}": name for name in joint.coordinates if name in seen}
        seen |= set(joint.coordinates)
    return coupled


def joints_of_coordinates(anatomy: Anatomy) -> dict[str, str]:
    """Every coordinate of the model, and the joint it belongs to.

    >>> from adapt.anatomy_file import load_anatomy
    >>> joints = joints_of_coordinates(load_anatomy("lower-limb-right"))
    >>> joints["knee_angle_r"], joints["knee_angle_r_beta"]
    ('knee', 'patellofemoral')
    """
    owner: dict[str, str] = {}
    for joint in anatomy.joints:
        own = JOINT_TYPES[joint.type].opensim_owners(joint)
        owner |= {f"{name}{FOLLOWER}" if name in owner else name: of for name, of in own.items()}
    return owner


def follower_columns(body: Body, transforms: Mapping[str, Floats]) -> dict[str, Floats]:
    """Columns (T,) in degrees of what follows bones and is no coordinate of ours (a collar bone's turns).

    ``transforms`` (T, 4, 4) lead from rest to pose; NaN stays NaN.
    """
    columns: dict[str, Floats] = {}
    for joint in body.anatomy.joints:
        columns |= JOINT_TYPES[joint.type].opensim_followers(body.anatomy, joint, body.p.value, transforms)
    return columns


def osim_joints(body: Body) -> list[OsimJoint]:
    """All joints of a body, parents before their children."""
    rest = Resting(body.anatomy, body.p, rest_theta(body), body_frames(body))
    seen: set[str] = set()
    joints: list[OsimJoint] = []
    for joint in body.anatomy.joints:
        follows = bool(seen & set(joint.coordinates))
        joints += JOINT_TYPES[joint.type].in_opensim(rest, joint, follows=follows)
        seen |= set(joint.coordinates)
    return joints
