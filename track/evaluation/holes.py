"""Holes of a surface, such as where a limb is cut from its body."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from adapt.template_builder.meshes import Mesh


def closed(mesh: Mesh) -> Mesh:
    """The mesh with every hole filled by a fan about the middle of its edge."""
    halves = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])
    _, index, count = np.unique(np.sort(halves, axis=1), axis=0, return_inverse=True, return_counts=True)
    edge = halves[count[index] == 1]
    n = len(mesh.vertices)
    _, label = connected_components(sparse.coo_matrix((np.ones(len(edge)), edge.T), shape=(n, n)), directed=False)
    holes, hole = np.unique(label[edge[:, 0]], return_inverse=True)
    middles = [mesh.vertices[np.unique(edge[hole == k])].mean(axis=0) for k in range(len(holes))]
    fans = np.column_stack([edge[:, ::-1], n + hole])
    return Mesh(np.concatenate([mesh.vertices, *(m[None] for m in middles)]), np.concatenate([mesh.faces, fans]))
