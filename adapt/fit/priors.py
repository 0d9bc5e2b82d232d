"""What is known of a pose before the data: the ranges of joints. Of a body's shape: ``adapt.model.shape.prior``."""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.fit.least_squares import Quadratic

RANGE_SIGMA_RAD = np.deg2rad(2.0)  # how softly a joint's range ends


def range_term(anatomy: Anatomy, theta: Floats) -> Quadratic:
    """Zero inside the joint ranges, quadratic outside."""
    low = np.array([coordinate.low for coordinate in anatomy.coordinates])
    high = np.array([coordinate.high for coordinate in anatomy.coordinates])
    residual = (theta - np.clip(theta, low, high)) / RANGE_SIGMA_RAD
    outside = (residual != 0.0) / RANGE_SIGMA_RAD
    return Quadratic(0.5 * float(residual @ residual), outside * residual, np.diag(outside**2))
