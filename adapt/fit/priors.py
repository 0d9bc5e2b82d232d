"""What is known of a pose before the data: the joint ranges. Of a body's shape: ``adapt.model.shape.prior``.

The rule is ``range_term``. The numbers are ``low`` and ``high`` of an anatomy's coordinates; those of the templates
stand with their sources in ``adapt/template_builder/upper_limb.py`` and ``lower_limb.py``, and as a table in
docs/coordinates.md.
"""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.fit.problem import Quadratic

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
