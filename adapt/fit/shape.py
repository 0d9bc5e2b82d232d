"""Algorithm 2: the anthropometric parameters over all example poses (paper, section 3.3).

The constraints of A are eliminated exactly by the parametrisation (model.handles.AffineSet). Unlike in the paper's
alternation, what explains the same change of the skin moves in the same Levenberg-Marquardt steps: the proportions,
the poses, and the soft tissue in the coarse modes of adapt.tissue. A long bone, a shifted shoulder and a thick
forearm look alike in one pose; alternating between them creeps. Algorithm 3 adds what the modes cannot express.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from adapt.anatomy import Floats
from adapt.fit.correspondences import GATE_M, Correspondences, Target
from adapt.fit.least_squares import (
    PLANE_WEIGHT,
    SIGMA_M,
    Quadratic,
    data_energy,
    data_term,
    gaussian_term,
    levenberg_marquardt,
)
from adapt.fit.pose import match_pose, next_gate
from adapt.fit.priors import range_term
from adapt.fit.sample import SkinSample
from adapt.model.body import Body, make_body, pose_skin, pose_skin_varying
from adapt.model.pose_space import wrap
from adapt.model.shape.prior import shape_precision
from adapt.model.variation import Points
from adapt.tissue import TissueField, tissue_field

_LEAST_KNOWN = 1.0  # curvature by a pose: what no skin in sight tells is known to 1 rad or 1 m
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
        energy = ShapeEnergy(body, fine, matches, sample, of)
        before = x
        x = levenberg_marquardt(energy.quadratic, before, steps=steps, energy=energy.value)
        for k in range(len(targets)):
            x[of.pose(k)] = wrap(anatomy, x[of.pose(k)])
        body = energy.at(x)
        moved = np.abs(x - before)
        if np.delete(moved, np.arange(of.m, of.m + of.q)).max() < _STILL:
            break
    covariance = np.asarray(np.linalg.inv(energy.quadratic(x).hessian), dtype=np.float64)
    shape = covariance[: of.m, : of.m]
    held = np.trace(shape @ shape_precision(anatomy, body.affine)) + np.trace(covariance[of.tissue, of.tissue])
    return ShapeFit(body, x[of.m + of.q :].reshape(len(targets), of.n), shape, len(x) - float(held))


def split_tissue(body: Body, tissue: TissueField) -> tuple[Floats, Floats]:
    """The skin (V, 3) without its coarse tissue, which is left as it is, and that tissue's coefficients (q,)."""
    c = tissue.coefficients(body.v_hat - body.anatomy.skin_vertices)
    return body.v_hat - tissue.displacement(c), c


@dataclass(frozen=True)
class ShapeEnergy:
    """The energy of x for fixed matches in K clouds.

    ``body`` says whose anatomy; ``fine`` (V, 3) is the template skin without its coarse tissue.
    """

    body: Body
    fine: Floats
    matches: Sequence[Correspondences]
    sample: SkinSample
    of: Unknowns
    plane_weight: float = PLANE_WEIGHT

    def quadratic(self, x: Floats) -> Quadratic:
        """The energy with its gradient and its arrow-shaped normal matrix."""
        of, moved = self.of, self.at(x)
        gradient, hessian = np.zeros(len(x)), np.zeros((len(x), len(x)))
        shape, thickness = self._expected(x), x[of.tissue]
        energy = shape.energy + 0.5 * float(thickness @ thickness)
        gradient[: of.m], hessian[: of.m, : of.m] = shape.gradient, shape.hessian
        gradient[of.tissue], hessian[of.tissue, of.tissue] = thickness, np.eye(of.q)
        for k, match in enumerate(self.matches):
            index = np.r_[of.pose(k), 0 : of.m, of.tissue]
            data = _pose_data(moved, x[of.pose(k)], match, self.sample, self.plane_weight)
            limits = range_term(moved.anatomy, x[of.pose(k)])
            energy += data.energy + limits.energy
            gradient[index] += data.gradient
            gradient[of.pose(k)] += limits.gradient
            hessian[np.ix_(index, index)] += data.hessian
            hessian[of.pose(k), of.pose(k)] += limits.hessian + _LEAST_KNOWN * np.eye(of.n)
        return Quadratic(energy, gradient, hessian)

    def value(self, x: Floats) -> float:
        """The energy alone."""
        of, moved = self.of, self.at(x)
        energy = self._expected(x).energy + 0.5 * float(x[of.tissue] @ x[of.tissue])
        for k, match in enumerate(self.matches):
            skin = pose_skin(moved, x[of.pose(k)], vertices=match.vertex)
            weights = self.sample.observations[match.vertex]
            energy += data_energy(skin, match, weights, plane_weight=self.plane_weight)
            energy += range_term(moved.anatomy, x[of.pose(k)]).energy
        return energy

    def at(self, x: Floats) -> Body:
        """The body at x. A trial step may leave the model's domain: then the nearest valid one."""
        anatomy, shape = self.body.anatomy, self.body.affine.nearest_possible(x[: self.of.m])
        grown = tissue_field(anatomy).displacement(x[self.of.tissue])
        return make_body(anatomy, shape=shape, v_hat=self.fine + grown)

    def _expected(self, x: Floats) -> Quadratic:
        affine = self.body.affine
        return gaussian_term(x[: self.of.m], affine.identity, shape_precision(self.body.anatomy, affine))


def _pose_data(body: Body, theta: Floats, match: Correspondences, sample: SkinSample, plane_weight: float) -> Quadratic:
    """The data term of one pose by [theta, shape, tissue].

    A vertex moves with the tissue along one direction only, so the tissue's columns are never written out.
    """
    i, weights, tissue = match.vertex, sample.observations[match.vertex], tissue_field(body.anatomy)
    skin = pose_skin_varying(body, theta, with_shape=True, along=tissue.normals[i], vertices=i)
    by_pose_and_shape, direction = skin.d[:, :, :-1], skin.d[:, :, -1]
    lean = data_term(Points(skin.value, by_pose_and_shape), match, weights, plane_weight=plane_weight)
    scale = weights / ((plane_weight + 1.0) * SIGMA_M**2)
    along = np.einsum("ij,ij->i", match.normal, direction)
    pulled = scale[:, None] * (plane_weight * along[:, None] * match.normal + direction)  # metric times direction
    modes = tissue.modes[i]
    gradient = modes.T @ np.einsum("ij,ij->i", pulled, skin.value - match.target)
    cross = modes.T @ np.matmul(pulled[:, None, :], by_pose_and_shape)[:, 0]
    rooted = np.sqrt(np.einsum("ij,ij->i", pulled, direction))[:, None] * modes
    own = rooted.T @ rooted  # a product with itself costs half of one with another matrix
    hessian = np.block([[lean.hessian, cross.T], [cross, own]])
    return Quadratic(lean.energy, np.concatenate([lean.gradient, gradient]), hessian)
