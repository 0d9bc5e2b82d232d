"""Bounded biharmonic weights (Jacobson et al. 2011), inside tetrahedra.

For every handle h the field w_h that minimises the integral of |laplacian(w_h)|^2, subject to 0 <= w_h <= 1,
w_h = 1 at its own corners and 0 at those of the others; afterwards rows are scaled to sum to one.
"""

from __future__ import annotations

import igl
import numpy as np
from numpy.typing import NDArray

from adapt.template_builder.tetrahedra import TetMesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def bounded_biharmonic(mesh: TetMesh, corners: list[Ints]) -> Floats:
    """Weights (N, H) at the corners of a tetrahedral mesh for H handles, each a set of corner indices."""
    fixed = np.concatenate(corners)
    owner = np.repeat(np.arange(len(corners)), [len(own) for own in corners])
    values = np.eye(len(corners))[owner]
    raw = igl.bbw(np.ascontiguousarray(mesh.points), np.ascontiguousarray(mesh.tets), fixed, values, max_iter=20)
    return normalised(np.asarray(raw))


def normalised(weights: Floats) -> Floats:
    """Clip to [0, 1] and scale rows to sum to one."""
    clipped = np.clip(weights, 0.0, 1.0)
    return np.asarray(clipped / clipped.sum(axis=1, keepdims=True))
