"""What a triangle mesh knows about itself: normals, areas, edges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from adapt.anatomy import Floats, Ints


def incidence(faces: Ints, n_vertices: int) -> sparse.csr_matrix:
    """The (V, F) matrix that sums a quantity of the faces (F, 3) onto their vertices.

    >>> incidence(np.array([[0, 1, 2], [0, 2, 3]]), 4).toarray().tolist()
    [[1.0, 1.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
    """
    rows, columns = faces.ravel(), np.repeat(np.arange(len(faces)), 3)
    return sparse.csr_matrix((np.ones(rows.size), (rows, columns)), shape=(n_vertices, len(faces)))


def vertex_normals(vertices: Floats, faces: Ints, onto_vertices: sparse.csr_matrix) -> Floats:
    """Unit normals, outward for outward faces, weighted by area: one for each row of ``onto_vertices`` (M, F).

    >>> square, faces = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]]), np.array([[0, 1, 2], [0, 2, 3]])
    >>> vertex_normals(square, faces, incidence(faces, 4)).tolist()
    [[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]]
    """
    summed = onto_vertices @ _doubled_areas(vertices, faces)
    length = np.sqrt(np.einsum("ij,ij->i", summed, summed))
    return np.asarray(summed / np.maximum(length, 1e-12)[:, None])


def vertex_areas(vertices: Floats, faces: Ints) -> Floats:
    """Area (V,) in m^2 that each vertex stands for: a third of its triangles.

    >>> square, faces = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]]), np.array([[0, 1, 2], [0, 2, 3]])
    >>> vertex_areas(square, faces).round(3).tolist()
    [0.333, 0.167, 0.333, 0.167]
    """
    areas = np.linalg.norm(_doubled_areas(vertices, faces), axis=1) / 6.0
    return np.asarray(np.bincount(faces.ravel(), np.repeat(areas, 3), minlength=len(vertices)), dtype=np.float64)


def _doubled_areas(vertices: Floats, faces: Ints) -> Floats:
    """The cross product (F, 3) of two sides of each face; ``np.cross`` takes several times as long."""
    a, b, c = (vertices.take(corner, axis=0) for corner in faces.T)
    (ux, uy, uz), (vx, vy, vz) = (b - a).T, (c - a).T
    return np.stack([uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx], axis=1)


def submesh(vertices: Floats, faces: Ints, kept: NDArray[np.bool_]) -> tuple[Floats, Ints]:
    """The part of a mesh whose vertices (V,) are kept: those vertices, and the faces between them.

    >>> square, faces = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]]), np.array([[0, 1, 2], [0, 2, 3]])
    >>> part, between = submesh(square, faces, np.array([True, False, True, True]))
    >>> len(part), between.tolist()
    (3, [[0, 1, 2]])
    """
    renumbered = np.cumsum(kept) - 1
    return vertices[kept], renumbered[faces[kept[faces].all(axis=1)]]
