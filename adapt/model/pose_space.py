"""The space of poses theta: where the limb is (free joints), the angles between its bones, and how poses differ.

A free joint has six coordinates: a rotation vector, then an origin, both in the recording. They are no angles of a
joint, and they have no range that means anything. Rotation vectors, which other joints may have, too, neither subtract
nor add: for turns R(r) = exp(r),

    difference(theta, earlier) = log(R(theta) R(earlier)^T),     advance(theta, step) = log(R(step) R(theta)).
"""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Anatomy, Floats, Joint
from adapt.model.derivatives import Points
from adapt.model.joints import JOINT_TYPES
from capture.rigid import apply, exp_so3, log_so3


def is_free(joint: Joint) -> bool:
    """Whether a joint's coordinates place its child in the recording.

    >>> from adapt.anatomy_file import load_anatomy
    >>> arm = load_anatomy("upper-limb-right")
    >>> [(joint.name, is_free(joint)) for joint in arm.joints]
    [('shoulder', True), ('elbow', False), ('radioulnar', False), ('wrist', False)]
    """
    return JOINT_TYPES[joint.type].free


def free_coordinates(anatomy: Anatomy) -> list[list[int]]:
    """Where the six coordinates of each free joint stand in theta.

    >>> from adapt.anatomy_file import load_anatomy
    >>> free_coordinates(load_anatomy("lower-limb-right"))
    [[0, 1, 2, 3, 4, 5]]
    """
    return [joint_index(anatomy, joint) for joint in anatomy.joints if is_free(joint)]


def joint_coordinates(anatomy: Anatomy) -> list[int]:
    """Where the coordinates that change a limb's form stand in theta, each once: all but those of free joints.

    >>> from adapt.anatomy_file import load_anatomy
    >>> leg = load_anatomy("lower-limb-right")
    >>> [leg.coordinates[i].name for i in joint_coordinates(leg)]  # the kneecap follows the knee
    ['hip_flexion_r', 'hip_adduction_r', 'hip_rotation_r', 'knee_angle_r', 'ankle_angle_r']
    """
    free = {i for index in free_coordinates(anatomy) for i in index}
    return [i for i in range(len(anatomy.coordinates)) if i not in free]


def joint_index(anatomy: Anatomy, joint: Joint) -> list[int]:
    """Where a joint's coordinates stand in theta.

    >>> from adapt.anatomy_file import load_anatomy
    >>> leg = load_anatomy("lower-limb-right")
    >>> joint_index(leg, leg.joint("hip")), joint_index(leg, leg.joint("patellofemoral"))
    ([6, 7, 8], [9])
    """
    return [anatomy.coordinate_index(name) for name in joint.coordinates]


def root_joint(anatomy: Anatomy) -> Joint:
    """The (first) free joint, by which the whole limb moves.

    >>> from adapt.anatomy_file import load_anatomy
    >>> root_joint(load_anatomy("lower-limb-right")).name, root_joint(load_anatomy("upper-limb-right")).name
    ('pelvis', 'shoulder')
    """
    return next(joint for joint in anatomy.joints if is_free(joint))


def root_coordinates(anatomy: Anatomy) -> list[int]:
    """Where the root's six coordinates stand in theta.

    >>> from adapt.anatomy_file import load_anatomy
    >>> arm = load_anatomy("upper-limb-right")
    >>> [arm.coordinates[i].name for i in root_coordinates(arm)]
    ['shoulder_rx', 'shoulder_ry', 'shoulder_rz', 'shoulder_tx', 'shoulder_ty', 'shoulder_tz']
    """
    return joint_index(anatomy, root_joint(anatomy))


def rest_pose(anatomy: Anatomy, p: Points) -> Floats:
    """The pose (n,) in which a body with landmarks p stands as its rest skin.

    >>> from adapt.anatomy_file import load_anatomy
    >>> from adapt.model.derivatives import constant_points
    >>> arm = load_anatomy("upper-limb-right")
    >>> theta = rest_pose(arm, constant_points(arm.landmarks, 1))
    >>> round(float(np.rad2deg(theta[arm.coordinate_index("elbow_flexion")])), 1)
    41.1
    """
    theta = np.array([coordinate.rest for coordinate in anatomy.coordinates])
    for joint in anatomy.joints:
        theta[joint_index(anatomy, joint)] = JOINT_TYPES[joint.type].rest(anatomy, joint, p)
    return theta


def pose_difference(anatomy: Anatomy, theta: Floats, earlier: Floats) -> Floats:
    """theta - earlier (n,), with turns told by rotation vectors as the one that leads from one to the other.

    >>> from adapt.anatomy_file import load_anatomy
    >>> arm = load_anatomy("upper-limb-right")
    >>> turned, other_way = np.zeros(10), np.zeros(10)
    >>> turned[2], other_way[2] = np.deg2rad(170.0), np.deg2rad(-170.0)
    >>> round(float(np.rad2deg(pose_difference(arm, turned, other_way)[2])), 6)  # the short way, not 340 degrees
    -20.0
    """
    difference = theta - earlier
    for index in _rotation_vectors(anatomy):
        difference[index] = log_so3(exp_so3(theta[index]) @ exp_so3(earlier[index]).T)
    return difference


def advance(anatomy: Anatomy, theta: Floats, step: Floats) -> Floats:
    """The pose reached from ``theta`` by a ``pose_difference``; rotation vectors stay no longer than pi.

    >>> from adapt.anatomy_file import load_anatomy
    >>> arm = load_anatomy("upper-limb-right")
    >>> turned, step = np.zeros(10), np.zeros(10)
    >>> turned[2], step[2] = np.deg2rad(170.0), np.deg2rad(20.0)
    >>> round(float(np.rad2deg(advance(arm, turned, step)[2])), 6)
    -170.0
    """
    moved = theta + step
    for index in _rotation_vectors(anatomy):
        moved[index] = log_so3(exp_so3(step[index]) @ exp_so3(theta[index]))
    return moved


def wrap(anatomy: Anatomy, theta: Floats) -> Floats:
    """The same pose with rotation vectors no longer than pi, where they vary smoothly.

    >>> from adapt.anatomy_file import load_anatomy
    >>> theta = np.zeros(10)
    >>> theta[2], theta[6] = np.deg2rad(200.0), np.deg2rad(200.0)  # the whole arm, and the elbow
    >>> np.rad2deg(wrap(load_anatomy("upper-limb-right"), theta))[[2, 6]].round(6).tolist()
    [-160.0, 200.0]
    """
    wrapped = theta.copy()
    for index in _rotation_vectors(anatomy):
        angle = float(np.linalg.norm(wrapped[index]))
        if angle > np.pi:
            wrapped[index] *= 1.0 - 2.0 * np.pi / angle
    return wrapped


def moved_rigidly(anatomy: Anatomy, theta: Floats, move: Floats) -> Floats:
    """The pose (n,) in which the whole body stands moved by a rigid transform (4, 4), or is seen from another frame.

    >>> from adapt.anatomy_file import load_anatomy
    >>> from capture.rigid import transform
    >>> arm = load_anatomy("upper-limb-right")
    >>> move = transform(exp_so3(np.array([0.0, 0.5, 0.0])), np.array([1.0, 0.0, 0.0]))
    >>> moved_rigidly(arm, np.zeros(10), move).round(6).tolist()
    [0.0, 0.5, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    """
    moved = theta.copy()
    for index in free_coordinates(anatomy):
        turn, origin = index[:3], index[3:]
        moved[turn] = log_so3(move[:3, :3] @ exp_so3(theta[turn]))
        moved[origin] = apply(move, theta[origin][None])[0]
    return moved


def reported_coordinates(anatomy: Anatomy, thetas: Floats) -> dict[str, Floats]:
    """Poses (T, n) as named columns (T,): degrees for rotations, metres for translations.

    A rotation vector is reported as body-fixed X-Y-Z angles, as OpenSim's FreeJoint does, under
    the names ``<joint>_euler_x``, ``_y``, ``_z``. NaN poses stay NaN.

    >>> from adapt.anatomy_file import load_anatomy
    >>> theta = np.zeros((1, 10))
    >>> theta[0, 3], theta[0, 6] = 0.2, np.deg2rad(90.0)  # the shoulder along x, the elbow
    >>> columns = reported_coordinates(load_anatomy("upper-limb-right"), theta)
    >>> {name: round(float(values[0]), 6) for name, values in columns.items() if values[0]}
    {'shoulder_tx': 0.2, 'elbow_flexion': 90.0}
    """
    columns: dict[str, Floats] = {}
    for joint in anatomy.joints:
        columns |= JOINT_TYPES[joint.type].reported(joint, thetas[:, joint_index(anatomy, joint)])
    return columns


def _rotation_vectors(anatomy: Anatomy) -> list[list[int]]:
    """Where the three coordinates of each rotation vector stand in theta."""
    having = [(joint, JOINT_TYPES[joint.type].rotation_vector) for joint in anatomy.joints]
    return [[joint_index(anatomy, joint)[k] for k in which] for joint, which in having if which]
