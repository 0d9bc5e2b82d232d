"""Algorithm 3: the template skin itself, what bones do not explain (paper, section 3.3).

Solved for the displacement d = v_hat - template, with v linear in v_hat around the current one:

    argmin_d  sum_k data_k(v_k(d)) + 0.5 STIFFNESS |L e|^2_{M^-1} + 0.5 sum_i M_ii |e_i|^2 / (sigma_i^2 PATCH)

where e = d - c is what d adds to its present coarse part c, in the modes of adapt.tissue, which algorithm 2 has weighed
against all that is known of tissue and which is not to be taken back where nobody looked. L is the cotangent Laplacian
and M the mass matrix of the template, so skin that nobody saw follows its neighbours smoothly; sigma_i is what the soft
tissue under vertex i allows.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, cg, splu

from adapt.anatomy import Anatomy, Floats
from adapt.fit.problem import data_blocks
from adapt.match.correspondences import Correspondences
from adapt.match.skin_sample import SkinSample
from adapt.model.body import Body, make_body, pose_skin_by_v_hat
from adapt.tissue import tissue_deviation, tissue_field
from capture.errors import FitError

STIFFNESS = 4.0  # 1/m^2: 5 mm of soft tissue within 2 cm of skin costs about as much as one observation
_SOFT_PATCH_M2 = 0.04**2  # soft tissue of a patch of this area moves as one
_LEAST_DEVIATION_M = 0.001  # skin over bone can still differ by this much


class Factor:
    """The factor that makes solving for the skin fast, kept from one update to the next.

    The first update's serves the others as well: systems of bodies so near to each other take no more steps with it.
    """

    def __init__(self) -> None:
        self._solve: Callable[[Floats], Floats] | None = None

    def of(self, blocks: Floats, smooth: sparse.csr_matrix) -> Callable[[Floats], Floats]:
        """What solves for (V, 3), nearly: one factor for all coordinates, without the blocks' anisotropy."""
        if self._solve is None:
            isotropic = sparse.diags(np.trace(blocks, axis1=1, axis2=2) / 3.0)
            factor = splu((isotropic + smooth).tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
            self._solve = factor.solve
        return self._solve


def fit_skin(
    body: Body,
    thetas: Floats,
    matches: list[Correspondences],
    sample: SkinSample,
    *,
    factor: Factor | None = None,
) -> Body:
    """The body with its v_hat moved towards K clouds, for fixed poses (K, n), shape and matches.

    ``factor`` is one that earlier updates have used.

    Raises:
        FitError: the linear system could not be solved.
    """
    blocks, pull = _data_blocks(body, thetas, matches, sample)
    template = body.anatomy.skin_vertices
    smooth = _regulariser(body.anatomy)
    displacement = body.v_hat - template
    tissue = tissue_field(body.anatomy)
    coarse = tissue.displacement(tissue.coefficients(displacement))
    right = np.einsum("ijk,ik->ij", blocks, displacement) - pull + smooth @ coarse

    def apply_system(flat: Floats) -> Floats:
        d = flat.reshape(-1, 3)
        return np.asarray(np.einsum("ijk,ik->ij", blocks, d) + smooth @ d).ravel()

    solve = (factor or Factor()).of(blocks, smooth)
    size = (displacement.size, displacement.size)
    solution, status = cg(
        LinearOperator(size, matvec=apply_system, dtype=np.float64),
        right.ravel(),
        x0=displacement.ravel(),
        rtol=1e-6,
        maxiter=500,
        M=LinearOperator(size, matvec=lambda r: solve(r.reshape(-1, 3)).ravel(), dtype=np.float64),
    )
    if status != 0:
        raise FitError("the skin's linear system did not converge", remedy="report this with the recording")
    return make_body(body.anatomy, shape=body.shape, v_hat=template + solution.reshape(-1, 3))


def _data_blocks(
    body: Body, thetas: Floats, matches: list[Correspondences], sample: SkinSample
) -> tuple[Floats, Floats]:
    """Normal matrix (V, 3, 3) and gradient (V, 3) of the data by each vertex's own v_hat."""
    blocks, pull = np.zeros((len(body.v_hat), 3, 3)), np.zeros((len(body.v_hat), 3))
    for theta, match in zip(thetas, matches, strict=True):
        i = match.vertex
        skin = pose_skin_by_v_hat(body, theta, vertices=i)
        block, gradient = data_blocks(skin, match, sample.counts(match))
        blocks[i] += block
        pull[i] += gradient
    return blocks, pull


@lru_cache(maxsize=4)
def _regulariser(anatomy: Anatomy) -> sparse.csr_matrix:
    """The (V, V) matrix of the smoothness and size terms, the same for each coordinate."""
    import igl

    vertices, faces = anatomy.skin_vertices, anatomy.skin_faces
    laplacian = sparse.csr_matrix(igl.cotmatrix(vertices, faces))
    mass = np.asarray(igl.massmatrix(vertices, faces, igl.MASSMATRIX_TYPE_VORONOI).diagonal())
    bilaplacian = laplacian @ sparse.diags(1.0 / mass) @ laplacian
    variance = tissue_deviation(anatomy) ** 2 + _LEAST_DEVIATION_M**2
    return sparse.csr_matrix(STIFFNESS * bilaplacian + sparse.diags(mass / (variance * _SOFT_PATCH_M2)))
