"""What a triangle mesh knows about itself: normals, areas, edges."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from adapt.anatomy import Floats, Ints


def incidence(faces: Ints, n_vertices: int) -> sparse.csr_matrix:
    """The (V, F) matrix that sums a quantity of the faces (F, 3) onto their vertices."""
    rows, columns = faces.ravel(), np.repeat(np.arange(len(faces)), 3)
    return sparse.csr_matrix((np.ones(rows.size), (rows, columns)), shape=(n_vertices, len(faces)))


def vertex_normals(vertices: Floats, faces: Ints, onto_vertices: sparse.csr_matrix) -> Floats:
    """Unit normals (V, 3), outward for outward faces, weighted by area."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    summed = onto_vertices @ np.cross(b - a, c - a)
    return np.asarray(summed / np.maximum(np.linalg.norm(summed, axis=1, keepdims=True), 1e-12))


def vertex_areas(vertices: Floats, faces: Ints) -> Floats:
    """Area (V,) in m^2 that each vertex stands for: a third of its triangles."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 6.0
    return np.asarray(np.bincount(faces.ravel(), np.repeat(areas, 3), minlength=len(vertices)), dtype=np.float64)
