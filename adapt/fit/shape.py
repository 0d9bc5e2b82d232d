"""Algorithm 2: the anthropometric parameters over all example poses (paper, section 3.3).

The constraints of A are eliminated exactly by the parametrisation (model.handles.AffineSet). Unlike in the paper's
alternation, what explains the same change of the skin moves in the same Levenberg-Marquardt steps: the proportions,
the poses, and the soft tissue in the coarse modes of adapt.tissue. A long bone, a shifted shoulder and a thick
forearm look alike in one pose; alternating between them creeps. Algorithm 3 adds what the modes cannot express.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from adapt.anatomy import Floats
from adapt.fit.correspondences import GATE_M, Correspondences, Target
from adapt.fit.least_squares import (
    PLANE_WEIGHT,
    SIGMA_M,
    Quadratic,
    data_term,
    gaussian_term,
    levenberg_marquardt,
)
from adapt.fit.pose import match_pose, next_gate, wrap
from adapt.fit.priors import range_term, shape_precision
from adapt.fit.sample import SkinSample
from adapt.model.body import Body, make_body, pose_skin_by_v_hat, pose_skin_varying
from adapt.tissue import TissueField, tissue_field

_STILL = 2e-4  # rad, m, and the scales' 1: what moves less between two updates has converged


@dataclass(frozen=True)
class ShapeFit:
    """A body and its K poses (K, n) after algorithm 2, with the covariance (m, m) of the shape.

    ``parameters`` is the effective number of parameters: those that the data decided, not the priors.
    """

    body: Body
    thetas: Floats
    covariance: Floats = field(repr=False)
    parameters: float


@dataclass(frozen=True)
class Unknowns:
    """x = [shape (m), tissue (q), theta_1 (n), ..., theta_K (n)]."""

    m: int
    q: int
    n: int

    @property
    def tissue(self) -> slice:
        """Where the tissue's coefficients stand in x."""
        return slice(self.m, self.m + self.q)

    def pose(self, k: int) -> slice:
        """Where the k-th pose stands in x."""
        start = self.m + self.q + self.n * k
        return slice(start, start + self.n)


def fit_shape(
    body: Body,
    targets: list[Target],
    thetas: Floats,
    sample: SkinSample,
    *,
    updates: int = 8,
    steps: int = 3,
    gate_m: float = GATE_M,
) -> ShapeFit:
    """Fit shape, coarse soft tissue and poses together, from ``body`` and ``thetas`` (K, n), to K clouds.

    Raises:
        FitError: a pose finds too few correspondences.
    """
    anatomy, tissue = body.anatomy, tissue_field(body.anatomy)
    fine, c = split_tissue(body, tissue)
    of = Unknowns(len(body.shape), len(c), len(anatomy.coordinates))
    x = np.concatenate([body.shape, c, thetas.ravel()])
    gates = [gate_m] * len(targets)
    for _ in range(updates):
        matches = [match_pose(body, target, x[of.pose(k)], sample, gate_m=gates[k]) for k, target in enumerate(targets)]
        gates = [next_gate(match, gate_m) for match in matches]
        evaluate = shape_energy(body, fine, matches, sample, of)
        before = x
        x = levenberg_marquardt(evaluate, before, steps=steps)
        for k in range(len(targets)):
            x[of.pose(k)] = wrap(anatomy, x[of.pose(k)])
        body = _body(body, fine, tissue, x, of)
        moved = np.abs(x - before)
        if np.delete(moved, np.arange(of.m, of.m + of.q)).max() < _STILL:
            break
    covariance = np.asarray(np.linalg.inv(evaluate(x).hessian), dtype=np.float64)
    shape = covariance[: of.m, : of.m]
    held = np.trace(shape @ shape_precision(anatomy, body.affine)) + np.trace(covariance[of.tissue, of.tissue])
    return ShapeFit(body, x[of.m + of.q :].reshape(len(targets), of.n), shape, len(x) - float(held))


def split_tissue(body: Body, tissue: TissueField) -> tuple[Floats, Floats]:
    """The skin (V, 3) without its coarse tissue, which is left as it is, and that tissue's coefficients (q,)."""
    c = tissue.coefficients(body.v_hat - body.anatomy.skin_vertices)
    return body.v_hat - tissue.displacement(c), c


def _body(body: Body, fine: Floats, tissue: TissueField, x: Floats, of: Unknowns) -> Body:
    """The body at x. A trial step may leave the model's domain: then the nearest valid one."""
    shape = x[: of.m].copy()
    shape[::4] = np.maximum(shape[::4], 0.1)
    return make_body(body.anatomy, shape=shape, v_hat=fine + tissue.displacement(x[of.tissue]))


def shape_energy(
    body: Body,
    fine: Floats,
    matches: list[Correspondences],
    sample: SkinSample,
    of: Unknowns,
    *,
    plane_weight: float = PLANE_WEIGHT,
) -> Callable[[Floats], Quadratic]:
    """The energy of x with its arrow-shaped normal matrix, for fixed matches.

    ``body`` says whose anatomy; ``fine`` (V, 3) is the template skin without its coarse tissue.
    """
    tissue = tissue_field(body.anatomy)
    identity, precision = body.affine.identity, shape_precision(body.anatomy, body.affine)

    def evaluate(x: Floats) -> Quadratic:
        moved = _body(body, fine, tissue, x, of)
        gradient, hessian = np.zeros(len(x)), np.zeros((len(x), len(x)))
        shape, thickness = gaussian_term(x[: of.m], identity, precision), x[of.tissue]
        energy = shape.energy + 0.5 * float(thickness @ thickness)
        gradient[: of.m], hessian[: of.m, : of.m] = shape.gradient, shape.hessian
        gradient[of.tissue], hessian[of.tissue, of.tissue] = thickness, np.eye(of.q)
        for k, match in enumerate(matches):
            index = np.r_[of.pose(k), 0 : of.m, of.tissue]
            data = _pose_data(moved, x[of.pose(k)], match, sample, tissue, plane_weight)
            limits = range_term(body.anatomy, x[of.pose(k)])
            energy += data.energy + limits.energy
            gradient[index] += data.gradient
            gradient[of.pose(k)] += limits.gradient
            hessian[np.ix_(index, index)] += data.hessian
            hessian[of.pose(k), of.pose(k)] += limits.hessian
        return Quadratic(energy, gradient, hessian)

    return evaluate


def _pose_data(
    body: Body, theta: Floats, match: Correspondences, sample: SkinSample, tissue: TissueField, plane_weight: float
) -> Quadratic:
    """The data term of one pose by [theta, shape, tissue].

    A vertex moves with the tissue along one direction only, so the tissue's columns are never written out.
    """
    i, weights = match.vertex, sample.observations[match.vertex]
    skin = pose_skin_varying(body, theta, with_shape=True, vertices=i)
    lean = data_term(skin, match, weights, plane_weight=plane_weight)
    by_v_hat = pose_skin_by_v_hat(body, theta, vertices=i)
    direction = np.matmul(by_v_hat.d, tissue.normals[i][:, :, None])[:, :, 0]
    scale = weights / ((plane_weight + 1.0) * SIGMA_M**2)
    along = np.einsum("ij,ij->i", match.normal, direction)
    pulled = scale[:, None] * (plane_weight * along[:, None] * match.normal + direction)  # metric times direction
    modes = tissue.modes[i]
    gradient = modes.T @ np.einsum("ij,ij->i", pulled, skin.value - match.target)
    cross = modes.T @ np.matmul(pulled[:, None, :], skin.d)[:, 0]
    own = modes.T @ (np.einsum("ij,ij->i", pulled, direction)[:, None] * modes)
    hessian = np.block([[lean.hessian, cross.T], [cross, own]])
    return Quadratic(lean.energy, np.concatenate([lean.gradient, gradient]), hessian)
