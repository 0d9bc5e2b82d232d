"""The one home of rigid transforms: SO(3) and SE(3) as plain arrays.

A rotation is (..., 3, 3); a rigid transform is (4, 4) acting on column vectors, x' = T x. Frames stand in
names: ``world_from_sensor`` maps sensor coordinates to world coordinates.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_SMALL = 1e-4  # below this angle (rad) Taylor series replace the closed forms


def hat(vector: Floats) -> Floats:
    """The matrix of the cross product: ``hat(u) @ x == cross(u, x)``. Shapes (..., 3) -> (..., 3, 3).

    >>> hat(np.array([1.0, 2.0, 3.0])) @ np.array([0.0, 0.0, 1.0])
    array([ 2., -1.,  0.])
    """
    matrix = np.zeros((*vector.shape, 3))
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    matrix[..., 0, 1], matrix[..., 0, 2], matrix[..., 1, 2] = -z, y, -x
    matrix[..., 1, 0], matrix[..., 2, 0], matrix[..., 2, 1] = z, -y, x
    return matrix


def exp_so3(rotation_vector: Floats) -> Floats:
    """Rotation matrices of rotation vectors (rad): (..., 3) -> (..., 3, 3), Rodrigues' formula.

    >>> quarter_about_z = exp_so3(np.array([0.0, 0.0, np.pi / 2.0]))
    >>> (quarter_about_z @ [1.0, 0.0, 0.0]).round(9).tolist()  # x goes to y: turns follow the right hand
    [0.0, 1.0, 0.0]
    """
    angle = np.linalg.norm(rotation_vector, axis=-1)[..., None, None]
    k = hat(rotation_vector)
    small = angle < _SMALL
    safe = np.where(small, 1.0, angle)
    a = np.where(small, 1.0 - angle**2 / 6.0, np.sin(safe) / safe)
    b = np.where(small, 0.5 - angle**2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    return np.asarray(np.eye(3) + a * k + b * (k @ k))


def log_so3(rotation: Floats) -> Floats:
    """Rotation vectors (rad, norm in [0, pi]) of one rotation matrix (3, 3) or of several (N, 3, 3).

    With axis u and angle x, the matrix is cos(x) I + sin(x) hat(u) + (1 - cos(x)) u u^T: its skew part gives the
    axis unless x is near pi, where the symmetric part does.

    >>> half_about_y = np.diag([-1.0, 1.0, -1.0])
    >>> log_so3(half_about_y).round(4).tolist()
    [0.0, 3.1416, 0.0]
    """
    if rotation.ndim > 2:
        return np.array([log_so3(one) for one in rotation])
    skew = 0.5 * (rotation - rotation.T)
    sine_u = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    sine, cosine = math.sqrt(sine_u @ sine_u), 0.5 * (float(np.trace(rotation)) - 1.0)
    angle = math.atan2(sine, cosine)
    if cosine > -0.5:
        return sine_u * (angle / sine if sine > 0.0 else 1.0)
    axes = rotation + rotation.T - 2.0 * cosine * np.eye(3)  # 2 (1 - cos(x)) u u^T
    axis = axes[:, np.argmax(np.diag(axes))]
    return np.asarray(axis * math.copysign(angle / math.sqrt(axis @ axis), axis @ sine_u))


def left_jacobian_so3(rotation_vector: Floats) -> Floats:
    """J with ``exp(r + dr) = exp(J dr) exp(r)`` to first order: (..., 3) -> (..., 3, 3).

    >>> r, dr = np.array([0.3, -0.2, 0.5]), np.array([1e-6, 2e-6, -1e-6])
    >>> bool(np.allclose(exp_so3(r + dr), exp_so3(left_jacobian_so3(r) @ dr) @ exp_so3(r), rtol=0.0, atol=1e-11))
    True
    """
    angle = np.linalg.norm(rotation_vector, axis=-1)[..., None, None]
    k = hat(rotation_vector)
    small = angle < _SMALL
    safe = np.where(small, 1.0, angle)
    b = np.where(small, 0.5 - angle**2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    c = np.where(small, 1.0 / 6.0 - angle**2 / 120.0, (safe - np.sin(safe)) / safe**3)
    return np.asarray(np.eye(3) + b * k + c * (k @ k))


def transform(rotation: Floats, translation: Floats) -> Floats:
    """The (4, 4) rigid transform of a rotation (3, 3) and a translation (3,).

    >>> transform(np.eye(3), np.array([1.0, 2.0, 3.0]))
    array([[1., 0., 0., 1.],
           [0., 1., 0., 2.],
           [0., 0., 1., 3.],
           [0., 0., 0., 1.]])
    """
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, translation
    return matrix


def inverse(rigid: Floats) -> Floats:
    """Inverse of a rigid (4, 4) transform.

    >>> world_from_sensor = transform(exp_so3(np.array([0.0, 0.0, np.pi / 2.0])), np.array([1.0, 2.0, 3.0]))
    >>> inverse(world_from_sensor)[:3, 3].round(9).tolist()  # where the world's origin lies for the sensor
    [-2.0, 1.0, -3.0]
    """
    rotation = rigid[:3, :3].T
    return transform(rotation, -rotation @ rigid[:3, 3])


def apply(rigid: Floats, points: Floats) -> Floats:
    """Map points (N, 3) by a rigid (4, 4) transform.

    >>> apply(transform(np.eye(3), np.array([0.0, 0.0, 1.0])), np.array([[0.1, 0.2, 0.3]])).tolist()
    [[0.1, 0.2, 1.3]]
    """
    return points @ rigid[:3, :3].T + rigid[:3, 3]


def rotation_angle(rotation: Floats) -> float:
    """Angle (rad) of a rotation matrix (3, 3).

    >>> round(rotation_angle(exp_so3(np.array([0.3, 0.0, 0.4]))), 9)
    0.5
    """
    return float(np.linalg.norm(log_so3(rotation)))
