"""When to search a lost limb again: a search costs seconds, and a cloud that looks as it did has no more to tell.

A look (7,) of a cloud is the number of its points, their mean and their standard deviation (m).
"""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Floats
from capture.cloud.fuse import Cloud

_MOVED_M = 0.02  # a limb that comes back moves mean or spread of the points by more
_MORE = 0.15  # or changes their number by a larger share


def look_of(cloud: Cloud) -> Floats:
    """How a cloud looks.

    >>> none = np.zeros(0, dtype=bool)
    >>> cloud = Cloud(np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.2]]), np.zeros((2, 3)), none, none.astype(int), ())
    >>> look_of(cloud).round(6).tolist()
    [2.0, 0.0, 0.0, 1.1, 0.0, 0.0, 0.1]
    """
    mean, deviation = cloud.points.mean(axis=0), cloud.points.std(axis=0)
    return np.concatenate([[float(len(cloud.points))], mean, deviation])


def looks_changed(now: Floats, before: Floats) -> bool:
    """Whether a cloud looks other than an earlier one; it does where there was none (0,).

    >>> looks_changed(np.array([900.0, 0, 0, 1, 0.1, 0.2, 0.1]), np.array([1000.0, 0, 0, 1, 0.1, 0.2, 0.1]))
    False
    >>> looks_changed(np.array([900.0, 0, 0, 1, 0.1, 0.2, 0.1]), np.zeros(0))
    True
    """
    if not len(before):
        return True
    more = abs(now[0] - before[0]) > _MORE * before[0]
    return bool(more or np.abs(now[1:] - before[1:]).max() > _MOVED_M)
