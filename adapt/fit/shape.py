"""Algorithm 2: the anthropometric parameters over all example poses (paper, section 3.3).

The constraints of A are eliminated exactly by the parametrisation (model.handles.AffineSet). Unlike in the paper's
alternation, what explains the same change of the skin moves in the same Levenberg-Marquardt steps: the proportions,
the poses, and the soft tissue in the coarse modes of adapt.tissue. A long bone, a shifted shoulder and a thick
forearm look alike in one pose; alternating between them creeps. Algorithm 3 adds what the modes cannot express.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from adapt.anatomy import Floats, Ints
from adapt.fit.least_squares import levenberg_marquardt
from adapt.fit.pose import match_pose, next_gate
from adapt.fit.priors import held_term, range_term
from adapt.fit.problem import (
    PLANE_WEIGHT,
    Arrow,
    Quadratic,
    Term,
    Unknowns,
    data_energy,
    effective_parameters,
    gaussian_term,
)
from adapt.match.correspondences import GATE_M, Correspondences, Target
from adapt.match.skin_sample import SkinSample
from adapt.model.body import Body, make_body, pose_skin, shaped_skin
from adapt.model.pose_space import wrap
from adapt.model.shape.population import ANYBODY, Person
from adapt.model.shape.prior import ShapePrior, shape_prior
from adapt.tissue import TissueField, tissue_field

_LEAST_KNOWN = 1.0  # curvature by a pose: what no skin in sight tells is known to 1 rad or 1 m
_STILL = 2e-4  # rad, m, and the scales' 1: what moves less between two updates has converged


@dataclass(frozen=True)
class ShapeFit:
    """A body and its K poses (K, n) after algorithm 2.

    ``parameters`` is the effective number of parameters: those that the data decided, not the priors.
    """

    body: Body
    thetas: Floats
    parameters: float


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
        if np.delete(moved, of.tissue).max() < _STILL:
            break
    decided = effective_parameters(energy.quadratic(x), energy.expected(x))
    return ShapeFit(body, x[of.body.stop :].reshape(len(targets), of.n), decided)


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
        """The tissue's modes (U, q) at these vertices, each mode in one piece: so products of them are the fastest."""
        return np.asfortranarray(tissue_field(self.body.anatomy).modes[self.seen])

    @cached_property
    def rows(self) -> list[Ints]:
        """Where each cloud's matched vertices stand among them."""
        return [np.searchsorted(self.seen, match.vertex) for match in self.matches]

    def quadratic(self, x: Floats) -> Quadratic:
        """The energy with its gradient and its arrow-shaped normal matrix."""
        of, anatomy = self.of, self.body.anatomy
        arrow = Arrow(of, len(self.matches), self.modes)
        arrow.add(*self.expected(x))
        skin = shaped_skin(self.at(x), self.seen, along=tissue_field(anatomy).normals[self.seen])
        for k, (match, rows) in enumerate(zip(self.matches, self.rows, strict=True)):
            weights, pose = self.sample.counts(match), of.pose(k)
            posed = skin.posed(x[pose], rows)
            arrow.add_matches(k, rows, posed, match, weights, plane_weight=self.plane_weight)
            arrow.add(Term(pose, range_term(anatomy, x[pose])), Term(pose, self._hardly_told))
            arrow.add_across(k, held_term(self.at(x), x[pose], with_shape=True))
        return arrow.quadratic()

    def value(self, x: Floats) -> float:
        """The energy alone."""
        of, moved = self.of, self.at(x)
        energy = sum(term.quadratic.energy for term in self.expected(x))
        for k, match in enumerate(self.matches):
            skin = pose_skin(moved, x[of.pose(k)], vertices=match.vertex)
            weights = self.sample.counts(match)
            energy += data_energy(skin, match, weights, plane_weight=self.plane_weight)
            energy += range_term(moved.anatomy, x[of.pose(k)]).energy + held_term(moved, x[of.pose(k)]).energy
        return energy

    def expected(self, x: Floats) -> tuple[Term, Term]:
        """What is known beforehand of shape and tissue."""
        of = self.of
        shape = gaussian_term(x[of.shape], self.prior.mean, self.prior.precision)
        return Term(of.shape, shape), Term(of.tissue, gaussian_term(x[of.tissue], np.zeros(of.q), np.eye(of.q)))

    @cached_property
    def _hardly_told(self) -> Quadratic:
        """Keeps the normal matrix regular where no skin in sight tells of a pose; it pulls nowhere."""
        return Quadratic(0.0, np.zeros(self.of.n), _LEAST_KNOWN * np.eye(self.of.n))

    def at(self, x: Floats) -> Body:
        """The body at x. A trial step may leave the model's domain: then the nearest valid one."""
        return self._bodies(x[self.of.body].tobytes())

    @cached_property
    def _bodies(self) -> Callable[[bytes], Body]:
        """The body of shape and tissue; it is kept a while, for where a step ends the next one starts."""

        @lru_cache(maxsize=2)
        def body(of: bytes) -> Body:
            x, anatomy = np.frombuffer(of), self.body.anatomy
            grown = tissue_field(anatomy).displacement(x[self.of.tissue])
            shape = self.body.affine.nearest_possible(x[self.of.shape])
            return make_body(anatomy, shape=shape, v_hat=self.fine + grown)

        return body
