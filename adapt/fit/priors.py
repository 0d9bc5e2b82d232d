"""What is known of a pose before the data: the joint ranges, and what joints hold besides (a collar bone its length).

Of a body's shape see ``adapt.model.shape.prior``.

The rule of the ranges is ``range_term``. The numbers are ``low`` and ``high`` of an anatomy's coordinates; those of the
templates stand with their sources in ``adapt/template_builder/upper_limb.py`` and ``lower_limb.py``, and as a table in
docs/coordinates.md.
"""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.fit.problem import Quadratic
from adapt.model.body import Body
from adapt.model.derivatives import Points
from adapt.model.joints import JOINT_TYPES
from adapt.model.kinematics import bone_motions

RANGE_SIGMA_RAD = np.deg2rad(2.0)  # how softly a joint's range ends


def range_term(anatomy: Anatomy, theta: Floats) -> Quadratic:
    """Zero inside the joint ranges, quadratic outside.

    >>> from adapt.anatomy_file import load_anatomy
    >>> leg = load_anatomy("lower-limb-right")
    >>> theta = np.zeros(len(leg.coordinates))
    >>> theta[leg.coordinate_index("knee_angle_r")] = -RANGE_SIGMA_RAD  # overstretched by one standard deviation
    >>> range_term(leg, np.zeros(len(theta))).energy, round(range_term(leg, theta).energy, 6)
    (0.0, 0.5)
    """
    low = np.array([coordinate.low for coordinate in anatomy.coordinates])
    high = np.array([coordinate.high for coordinate in anatomy.coordinates])
    residual = (theta - np.clip(theta, low, high)) / RANGE_SIGMA_RAD
    outside = (residual != 0.0) / RANGE_SIGMA_RAD
    return Quadratic(0.5 * float(residual @ residual), outside * residual, np.diag(outside**2))


def held_term(body: Body, theta: Floats, *, with_shape: bool = False) -> Quadratic:
    """What joints hold besides their ranges, by theta (n,) and, if asked for, then by the body's shape (m,).

    >>> from adapt.anatomy_file import load_anatomy
    >>> from adapt.model.body import make_body
    >>> held_term(make_body(load_anatomy("upper-limb-right")), np.zeros(10)).energy  # an arm alone holds nothing
    0.0
    """
    n, d = len(theta), body.p.d if with_shape else body.p.d[:, :, :0]
    total = Quadratic(0.0, np.zeros(n + d.shape[2]), np.zeros((n + d.shape[2], n + d.shape[2])))
    holding = [joint for joint in body.anatomy.joints if JOINT_TYPES[joint.type].holds]
    if not holding:
        return total
    p = Points(body.p.value, np.concatenate([np.zeros((*body.p.value.shape, n)), d], axis=2))
    motions = bone_motions(body.anatomy, theta, p)
    for joint in holding:
        off, slope = JOINT_TYPES[joint.type].held(body.anatomy, joint, p, motions)
        total = total + Quadratic(0.5 * off**2, off * slope, np.outer(slope, slope))
    return total
