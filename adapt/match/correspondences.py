"""find_corres (paper, section 3.3): for each skin vertex a target in the cloud, or none.

A vertex gets no target when the nearest point that an eligible sensor saw is farther than the gate, when the
normals disagree, when the target lies on the scan's boundary, or when no sensor can see the vertex.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from adapt.anatomy import Floats, Ints
from adapt.match.point_grid import PointGrid
from adapt.match.visibility import visible_vertices
from capture.cloud.fuse import Cloud, View

GATE_M = 0.04  # the paper's 4 cm


@dataclass(frozen=True)
class Correspondences:
    """M matches in the cloud's frame.

    Vertex index (M,), target point (M, 3), the vertex's own normal (M, 3), and how far (m) the vertex stood from its
    target along it when they were matched (M,). The plane of point-to-plane is the model's, not the cloud's: normals
    of a cloud are noisy, and lean where its surface ends (docs/accuracy.md tells what that costs). ``trust`` (M,) is
    how much each counts for the pose that it was found in, 1 on calm skin (``adapt.match.bending_skin``).
    """

    vertex: Ints
    target: Floats
    normal: Floats
    distance: Floats
    trust: Floats

    def __len__(self) -> int:
        return len(self.vertex)

    def at(self, chosen: Ints | slice) -> Correspondences:
        """Some of the matches."""
        return Correspondences(
            self.vertex[chosen], self.target[chosen], self.normal[chosen], self.distance[chosen], self.trust[chosen]
        )


@dataclass(frozen=True)
class Target:
    """A cloud prepared for many searches: one grid per sensor."""

    cloud: Cloud

    @cached_property
    def parts(self) -> list[tuple[View, Ints, PointGrid]]:
        """View, indices of its points in the cloud, and their grid; sensors that saw nothing are left out."""
        parts = []
        for number, view in enumerate(self.cloud.views):
            index: Ints = np.flatnonzero(self.cloud.sensor == number)
            if len(index):
                parts.append((view, index, PointGrid(self.cloud.points[index])))
        return parts


def find_corres(
    target: Target, vertices: Floats, normals: Floats, eligible: Ints, *, gate_m: float = GATE_M
) -> Correspondences:
    """Targets for the posed skin ``vertices`` (V, 3) with unit ``normals``; only ``eligible`` vertices (indices).

    Each vertex takes the nearest point among the sensors that can see it. All are trusted alike: of how the skin has
    come to lie there nothing is known here.
    """
    best = np.full(len(eligible), np.inf)
    match = np.full(len(eligible), -1, dtype=np.int64)
    points, outward = vertices[eligible], normals[eligible]
    for view, index, grid in target.parts:
        seen = np.flatnonzero(visible_vertices(view, points, outward))
        distance, nearest = grid.query(points[seen], distance_upper_bound=gate_m)
        closer = distance < best[seen]
        best[seen[closer]] = distance[closer]
        match[seen[closer]] = index[nearest[closer]]
    cloud = target.cloud
    kept = match >= 0
    kept[kept] = ~cloud.boundary[match[kept]]
    kept[kept] = np.einsum("ij,ij->i", outward[kept], cloud.normals[match[kept]]) > 0.0
    points, match = points[kept], match[kept]
    normal, matched = outward[kept], cloud.points[match]
    apart = np.einsum("ij,ij->i", normal, points - matched)
    return Correspondences(eligible[kept], matched, normal, apart, np.ones(len(match)))
