"""Algorithm 2: the anthropometric parameters over all example poses (paper, section 3.3).

The constraints of A are eliminated exactly by the parametrisation (model.handles.AffineSet). Unlike in the paper's
alternation, what explains the same change of the skin moves in the same Levenberg-Marquardt steps: the proportions,
the poses, and the soft tissue in the coarse modes of adapt.tissue. A long bone, a shifted shoulder and a thick
forearm look alike in one pose; alternating between them creeps. Algorithm 3 adds what the modes cannot express.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np

from adapt.anatomy import Floats, Ints
from adapt.fit.least_squares import (
    PLANE_WEIGHT,
    Quadratic,
    data_energy,
    gaussian_term,
    levenberg_marquardt,
    weighted,
)
from adapt.fit.pose import match_pose, next_gate
from adapt.fit.priors import range_term
from adapt.match.correspondences import GATE_M, Correspondences, Target
from adapt.match.skin_sample import SkinSample
from adapt.model.body import Body, make_body, pose_skin, shaped_skin
from adapt.model.pose_space import wrap
from adapt.model.shape.population import ANYBODY, Person
from adapt.model.shape.prior import ShapePrior, shape_prior
from adapt.tissue import TissueField, tissue_field
from capture.compiled import compiled_sums

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
    person: Person = ANYBODY,
    updates: int = 8,
    steps: int = 3,
    gate_m: float = GATE_M,
) -> ShapeFit:
    """Fit shape, coarse soft tissue and poses together, from ``body`` and ``thetas`` (K, n), to K clouds.

    ``person`` is what is said of whose they are.

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
        energy = ShapeEnergy(body, fine, matches, sample, of, person=person)
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
    held = np.trace(shape @ energy.prior.precision) + np.trace(covariance[of.tissue, of.tissue])
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
    person: Person = ANYBODY

    @cached_property
    def prior(self) -> ShapePrior:
        """What is known of the body's proportions beforehand."""
        return shape_prior(self.body.anatomy, self.body.affine, self.person)

    @cached_property
    def seen(self) -> Ints:
        """The vertices (U,) that any of the clouds matches."""
        return np.unique(np.concatenate([match.vertex for match in self.matches]))

    @cached_property
    def modes(self) -> Floats:
        """The tissue's modes (U, q) at these vertices."""
        return tissue_field(self.body.anatomy).modes[self.seen]

    @cached_property
    def rows(self) -> list[Ints]:
        """Where each cloud's matched vertices stand among them."""
        return [np.searchsorted(self.seen, match.vertex) for match in self.matches]

    def quadratic(self, x: Floats) -> Quadratic:
        """The energy with its gradient and its arrow-shaped normal matrix.

        A vertex moves with the tissue along one direction only, so the tissue's columns are never written out: what
        that direction shares with each of the others, vertex by vertex, is multiplied by the modes in the end.
        """
        of, gradient, hessian = self.of, np.zeros(len(x)), np.zeros((len(x), len(x)))
        shape, thickness = self._expected(x), x[of.tissue]
        energy = shape.energy + 0.5 * float(thickness @ thickness)
        gradient[: of.m], hessian[: of.m, : of.m] = shape.gradient, shape.hessian
        gradient[of.tissue], hessian[of.tissue, of.tissue] = thickness, np.eye(of.q)
        skin = shaped_skin(self.at(x), self.seen, along=tissue_field(self.body.anatomy).normals[self.seen])
        others = np.delete(np.arange(len(x)), of.tissue)
        shares = np.zeros((len(self.seen), len(others) + 2))  # then with itself, and with how far the skin is off
        for k, (match, rows) in enumerate(zip(self.matches, self.rows, strict=True)):
            weights, pose = self.sample.observations[match.vertex], of.pose(k)
            jacobian, far = weighted(skin.posed(x[pose], rows), match, weights, plane_weight=self.plane_weight)
            limits, index = range_term(self.body.anatomy, x[pose]), np.r_[pose, 0 : of.m]
            energy += 0.5 * float(np.vdot(far, far)) + limits.energy
            flat = jacobian.reshape(far.size, jacobian.shape[2])
            gradient[index] += (flat.T @ far.ravel())[:-1]
            hessian[np.ix_(index, index)] += (flat.T @ flat)[:-1, :-1]
            gradient[pose] += limits.gradient
            hessian[pose, pose] += limits.hessian + _LEAST_KNOWN * np.eye(of.n)
            _add_shares(shares, rows, jacobian, far, of.m + k * of.n, of.n)
        cross = self.modes.T @ shares
        gradient[of.tissue] += cross[:, -1]
        hessian[np.ix_(np.arange(of.m, of.m + of.q), others)] = cross[:, :-2]
        hessian[np.ix_(others, np.arange(of.m, of.m + of.q))] = cross[:, :-2].T
        rooted = np.sqrt(shares[:, -2])[:, None] * self.modes
        hessian[of.tissue, of.tissue] += rooted.T @ rooted  # a product with itself costs half of one with another
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
        return self._bodies(x[: self.of.m + self.of.q].tobytes())

    @cached_property
    def _bodies(self) -> Callable[[bytes], Body]:
        """The body of shape and tissue; it is kept a while, for where a step ends the next one starts."""

        @lru_cache(maxsize=2)
        def body(of: bytes) -> Body:
            x, anatomy = np.frombuffer(of), self.body.anatomy
            grown = tissue_field(anatomy).displacement(x[self.of.tissue])
            shape = self.body.affine.nearest_possible(x[: self.of.m])
            return make_body(anatomy, shape=shape, v_hat=self.fine + grown)

        return body

    def _expected(self, x: Floats) -> Quadratic:
        return gaussian_term(x[: self.of.m], self.prior.mean, self.prior.precision)


@compiled_sums
def _add_shares(shares: Floats, rows: Ints, jacobian: Floats, far: Floats, first: int, n: int) -> None:
    """Adds what the last column of J (M, 3, n + m + 1), the tissue's direction, shares with all columns and with r.

    ``shares`` (U, m + K n + 2) has the shape's columns, the poses' (this one's from the ``first`` on), the direction's
    own, and that of r (M, 3).
    """
    own, m = jacobian.shape[2] - 1, jacobian.shape[2] - 1 - n
    for i in range(len(rows)):
        here, share = jacobian[i], shares[rows[i]]
        x, y, z = here[0, own], here[1, own], here[2, own]
        for k in range(n):
            share[first + k] = x * here[0, k] + y * here[1, k] + z * here[2, k]
        for k in range(m):
            share[k] += x * here[0, n + k] + y * here[1, n + k] + z * here[2, n + k]
        share[len(share) - 2] += x * x + y * y + z * z
        share[len(share) - 1] += x * far[i, 0] + y * far[i, 1] + z * far[i, 2]
