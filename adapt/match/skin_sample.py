"""Which skin vertices take part in fitting, and how much each counts."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy import sparse

from adapt.anatomy import Anatomy, Floats, Ints
from adapt.fit.problem import PATCH_M2, SIGMA_M
from adapt.match.correspondences import Correspondences
from adapt.model.compiled.normals import fill_normals
from adapt.model.surface import incidence, vertex_areas
from adapt.tissue import tissue_field

_LEAST_WEIGHT = 0.02  # vertices that count less than this are not worth a search


@dataclass(frozen=True)
class SkinSample:
    """The eligible vertices (M,) of an anatomy and, for ALL V, the independent observations each stands for.

    A vertex stands for its area in units of PATCH_M2 times the anatomy's fit weight, so finely meshed parts
    count no more than coarse ones.
    """

    vertices: Ints
    observations: Floats  # (V,)
    faces: Ints = field(repr=False)  # (F, 3): those that touch the eligible vertices
    onto_vertices: sparse.csr_matrix = field(repr=False)  # (M, F)

    def counts(self, matches: Correspondences) -> Floats:
        """The independent observations (M,) that each of some matches stands for, as far as it is trusted."""
        return np.asarray(self.observations[matches.vertex] * matches.trust)

    def normals(self, skin: Floats) -> Floats:
        """Unit normals (V, 3) of the posed skin (V, 3) at the eligible vertices, zero elsewhere."""
        normals = np.zeros_like(skin)
        onto = self.onto_vertices
        fill_normals(skin, self.faces, onto.indptr, onto.indices, self.vertices, normals)
        return normals


def weighted_by_tissue(sample: SkinSample, anatomy: Anatomy) -> SkinSample:
    """The same vertices, counted by how well they tell where the bones are before the skin itself is adapted.

    An observation's variance grows from SIGMA_M^2 by that of the soft tissue which the coarse modes leave out.
    """
    share = SIGMA_M**2 / (SIGMA_M**2 + tissue_field(anatomy).remainder ** 2)
    return replace(sample, observations=sample.observations * share)


def sample_skin(anatomy: Anatomy, *, at_most: int | None = None, seed: int = 0) -> SkinSample:
    """All vertices that count, or a random choice of ``at_most`` of them, spread evenly over the area.

    >>> from adapt.anatomy_file import load_anatomy
    >>> arm = load_anatomy("upper-limb-right")
    >>> some, every = sample_skin(arm, at_most=600), sample_skin(arm)
    >>> len(some.vertices), len(every.vertices) < len(arm.skin_vertices)  # some skin does not count
    (600, True)
    >>> bool(np.isclose(some.observations.sum(), every.observations[every.vertices].sum()))
    True
    """
    faces, n = anatomy.skin_faces, len(anatomy.skin_vertices)
    areas = vertex_areas(anatomy.skin_vertices, faces)
    observations = anatomy.fit_weight * areas / PATCH_M2
    eligible = np.flatnonzero(anatomy.fit_weight > _LEAST_WEIGHT)
    if at_most is not None and at_most < len(eligible):
        total = observations[eligible].sum()
        rng = np.random.default_rng(seed)
        chosen = rng.choice(eligible, at_most, replace=False, p=areas[eligible] / areas[eligible].sum(), shuffle=False)
        eligible = np.sort(chosen)
        spread = anatomy.fit_weight[eligible]
        observations = np.zeros(n)
        observations[eligible] = spread * total / spread.sum()
    touching = faces[np.isin(faces, eligible).any(axis=1)]
    return SkinSample(eligible, observations, touching, incidence(touching, n)[eligible])
