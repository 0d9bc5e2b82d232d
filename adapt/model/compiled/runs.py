"""Which columns of derivatives two bones vary by: a left hand does not move with the right elbow.

Columns are theta's n first, then the m of the body's parameters, by which everything varies.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Anatomy, Ints
from adapt.model.compiled.layout import Unsigned
from adapt.model.derivatives import Points
from adapt.model.pose_space import joint_index

_WORTH_SKIPPING = 8  # columns: to go on over fewer costs less than to begin anew behind them


def varying_runs(anatomy: Anatomy, p: Points, bones: Ints) -> tuple[Unsigned, Unsigned]:
    """From where to where (D, R, 2) columns lie that either of each pair of ``bones`` (D, 2) varies by.

    Then the same (D, Q, 2) in rows of the columns of x, y and z one after the other.
    """
    body = np.ones((len(bones), p.n), dtype=bool)
    varying = np.hstack([_columns_of_bones(anatomy)[bones].any(axis=1), body])
    return _table(varying), _table(np.tile(varying, 3))


def _table(varying: NDArray[np.bool_]) -> Unsigned:
    """Runs (D, R, 2) of each row, filled up with runs of no columns.

    They have no signs: compiled loops would look at each number whether it counts from the end.
    """
    runs = [_runs(row) for row in varying]
    table = np.zeros((len(runs), max(map(len, runs)), 2), dtype=np.uint64)
    for row, own in zip(table, runs, strict=True):
        row[: len(own)] = own
    return table


def _columns_of_bones(anatomy: Anatomy) -> NDArray[np.bool_]:
    """Which coordinates (B, n) move each bone."""
    order = [bone.name for bone in anatomy.bones]
    moving = np.zeros((len(order), len(anatomy.coordinates)), dtype=bool)
    for joint in anatomy.joints:  # parents come before their children
        own = moving[order.index(joint.child)]
        own[joint_index(anatomy, joint)] = True
        for other in (joint.parent, joint.other):
            if other is not None:
                own |= moving[order.index(other)]
    return moving


def _runs(moving: NDArray[np.bool_]) -> Ints:
    """Runs (R, 2) of columns that are among them, and of the few between two that are not."""
    edges = np.flatnonzero(np.diff(np.r_[False, moving, False].astype(np.int64))).reshape(-1, 2)
    if not len(edges):
        return np.zeros((1, 2), dtype=np.int64)
    apart = edges[1:, 0] - edges[:-1, 1] >= _WORTH_SKIPPING
    return np.column_stack([edges[np.r_[True, apart], 0], edges[np.r_[apart, True], 1]])
