"""Soft tissue between skin and bone: where it is thin, the skin tells where the bone is.

Muscle and fat differ between people where there is muscle and fat; over an epicondyle or a styloid there is hardly
any. So the skin's displacement along its normal is taken to be a random field u(x) = sigma(x) z(x): sigma is a share
of the tissue's depth, z a smooth field of unit variance (Matern, order 1, on the skin's surface; as a stochastic
differential equation in Lindgren, Rue & Lindstrom 2011). The surface's Laplacian diagonalises z, so that a moderate
number of its eigenmodes with independent coefficients is the whole model.

The share is that at which the mean of u around a limb varies as girths do between people whose lengths, bony breadths
and neighbouring girths are alike: what handles say of a person is then known (a survey of 6,068 people,
``track.evaluation.tissue_share``, docs/uncertainty.md). By that alone tissue would go on varying more, the deeper it
is. It is not let: what moves deep skin by much within RANGE_M looks like a longer bone (same page).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import eigsh
from scipy.spatial import cKDTree

from adapt.anatomy import Anatomy, Floats
from adapt.model.surface import incidence, vertex_normals

SHARE = 0.1  # standard deviation of the skin's displacement per depth of tissue
DEEP_M = 0.02  # tissue deeper than this varies no more (an assumption)
RANGE_M = 0.1  # skin farther apart than this varies independently (an assumption)
MODES = 150
_SHIFT = 1.0  # 1/m^2: the constant mode's eigenvalue is 0, which a factorisation cannot have


@dataclass(frozen=True, eq=False)
class TissueField:
    """u = modes @ c with c ~ N(0, identity), in metres along the template's ``normals`` (V, 3).

    ``remainder`` (V,) is the standard deviation (m) of what the K modes (V, K) leave out.
    """

    modes: Floats = field(repr=False)
    normals: Floats = field(repr=False)
    remainder: Floats = field(repr=False)
    projection: Floats = field(repr=False)  # (K, V), from displacements along the normals to coefficients

    def displacement(self, coefficients: Floats) -> Floats:
        """Displacement (V, 3) m of the template skin for coefficients (K,)."""
        return np.asarray((self.modes @ coefficients)[:, None] * self.normals)

    def coefficients(self, displacement: Floats) -> Floats:
        """The coefficients (K,) nearest to a displacement (V, 3) m of the template skin, by area."""
        return np.asarray(self.projection @ np.einsum("ij,ij->i", displacement, self.normals))


@lru_cache(maxsize=8)
def tissue_depth(anatomy: Anatomy) -> Floats:
    """Distance (V,) in metres from each skin vertex to the nearest bone, at rest.

    >>> from adapt.anatomy_file import load_anatomy
    >>> depth = tissue_depth(load_anatomy("upper-limb-right"))
    >>> [round(1e3 * float(value)) for value in (depth.min(), depth.max())]  # mm
    [2, 76]
    """
    bones = cKDTree(np.concatenate([bone.vertices for bone in anatomy.bones]))
    return np.asarray(bones.query(anatomy.skin_vertices)[0])


def tissue_deviation(anatomy: Anatomy) -> Floats:
    """Standard deviation (V,) in metres of the skin's displacement between people whom the handles made alike.

    >>> from adapt.anatomy_file import load_anatomy
    >>> deviation = tissue_deviation(load_anatomy("upper-limb-right"))
    >>> [round(1e3 * float(value), 1) for value in (deviation.min(), deviation.max())]  # mm
    [0.2, 2.0]
    """
    return np.asarray(SHARE * np.minimum(tissue_depth(anatomy), DEEP_M))


@lru_cache(maxsize=4)
def tissue_field(anatomy: Anatomy) -> TissueField:
    """The random field of an anatomy's soft tissue.

    With L phi = mu M phi and phi mass-orthonormal, the coefficient of phi has the variance
    4 pi kappa^2 / (kappa^2 + mu)^2, kappa = sqrt(8) / RANGE_M.
    """
    import igl

    vertices, faces = anatomy.skin_vertices, anatomy.skin_faces
    stiffness = -sparse.csc_matrix(igl.cotmatrix(vertices, faces))
    mass = sparse.csc_matrix(igl.massmatrix(vertices, faces, igl.MASSMATRIX_TYPE_VORONOI))
    mu, phi = eigsh(stiffness, k=min(MODES, len(vertices) - 2), M=mass, sigma=-_SHIFT, v0=np.ones(len(vertices)))
    kappa2 = 8.0 / RANGE_M**2
    spread = np.sqrt(4.0 * np.pi * kappa2) / (kappa2 + np.maximum(mu, 0.0))
    sigma = np.maximum(tissue_deviation(anatomy), 1e-6)
    phi = phi * _signs(mass @ phi)
    unit = spread * phi
    left_out = np.sqrt(np.maximum(0.0, 1.0 - (unit**2).sum(axis=1)))
    return TissueField(
        modes=sigma[:, None] * unit,
        normals=vertex_normals(vertices, faces, incidence(faces, len(vertices))),
        remainder=sigma * left_out,
        projection=(phi / spread).T @ (mass @ sparse.diags(1.0 / sigma)),
    )


def _signs(weighted: Floats) -> Floats:
    """Signs (K,) that make modes (V, K), weighted by area, the same wherever they are worked out.

    An eigenvector's sign is arbitrary, but subjects' files hold covariances of the coefficients. Each mode is turned
    to agree with one random field, with which none is likely to be uncorrelated.
    """
    field = np.random.default_rng(0).normal(size=len(weighted))
    return np.asarray(np.where(field @ weighted < 0.0, -1.0, 1.0))
