"""Masses for a model that must have some: placeholders from the subject's own shape, not measured masses.

The rest skin's inside is filled with a grid of cells; each cell belongs to the bone whose surface is nearest and has
one density for all. OpenSim needs masses above zero to load a model; inverse kinematics does not use them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from adapt.anatomy import Floats
from adapt.model.body import Body

DENSITY_KG_M3 = 1090.0
"""Of a whole limb: the middle of the segments' densities, 1050 (thigh) to 1160 (hand), that Winter (2009), table 4.1,
gives after Dempster (1955)."""
_CELL_M = 0.01


@dataclass(frozen=True, eq=False)
class Mass:
    """kg; centre (3,) in m; inertia (3, 3) in kg m2 about the centre. Axes of the rest space."""

    mass: float
    centre: Floats
    inertia: Floats


def segment_masses(body: Body) -> dict[str, Mass]:
    """A mass for every bone, of the flesh nearest to it; at least one cell's at the middle of the bone."""
    surfaces = list(body.rest_bones.values())
    cells = _cells_inside(body.v_tilde.value, body.anatomy.skin_faces)
    owner = np.repeat(np.arange(len(surfaces)), [len(surface) for surface in surfaces])
    nearest = owner[cKDTree(np.concatenate(surfaces)).query(cells)[1]]
    return {
        name: _mass(np.vstack([surface.mean(axis=0), cells[nearest == k]]))
        for k, (name, surface) in enumerate(body.rest_bones.items())
    }


def _cells_inside(vertices: Floats, faces: np.ndarray) -> Floats:
    """Middles (N, 3) of the grid's cells inside a closed surface."""
    import igl

    low, high = vertices.min(axis=0), vertices.max(axis=0)
    axes = [np.arange(a + 0.5 * _CELL_M, b, _CELL_M) for a, b in zip(low, high, strict=True)]
    middles = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.asarray(middles[igl.fast_winding_number(vertices, faces, middles) > 0.5])


def _mass(cells: Floats) -> Mass:
    """Sum of cubes of one density at ``cells`` (N, 3)."""
    each = DENSITY_KG_M3 * _CELL_M**3
    centre = cells.mean(axis=0)
    arms = cells - centre
    second = each * (arms.T @ arms + len(cells) * _CELL_M**2 / 12.0 * np.eye(3))
    return Mass(each * len(cells), centre, np.trace(second) * np.eye(3) - second)
