"""Algorithm 2: the anthropometric parameters over all example poses (paper, section 3.3).

The constraints of A are eliminated exactly by the parametrisation (model.handles.AffineSet). Unlike the paper's
alternation, the poses move along with the shape in the same Levenberg-Marquardt steps: bone length and shoulder
position explain the same change of the skin, and alternating between them creeps.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from adapt.anatomy import Floats
from adapt.fit.correspondences import GATE_M, Correspondences, Target
from adapt.fit.least_squares import Quadratic, data_term, gaussian_term, levenberg_marquardt
from adapt.fit.pose import match_pose, next_gate, wrap
from adapt.fit.priors import range_term, shape_precision
from adapt.fit.sample import SkinSample
from adapt.model.body import Body, make_body, pose_skin_varying


@dataclass(frozen=True)
class ShapeFit:
    """A body and its K poses (K, n) after algorithm 2, with the covariance (m, m) of the shape."""

    body: Body
    thetas: Floats
    covariance: Floats = field(repr=False)


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
    """Fit shape and poses together, from ``body`` and ``thetas`` (K, n), to K clouds.

    Raises:
        FitError: a pose finds too few correspondences.
    """
    precision = shape_precision(body.anatomy, body.affine)
    m, gates = len(body.shape), [gate_m] * len(targets)
    for _ in range(updates):
        matches = [
            match_pose(body, target, theta, sample, gate_m=gate)
            for target, theta, gate in zip(targets, thetas, gates, strict=True)
        ]
        gates = [next_gate(match, gate_m) for match in matches]
        evaluate = _energy(body, matches, sample, precision)
        before = np.concatenate([body.shape, thetas.ravel()])
        x = levenberg_marquardt(evaluate, before, steps=steps)
        body = make_body(body.anatomy, shape=x[:m], v_hat=body.v_hat)
        thetas = np.array([wrap(body.anatomy, theta) for theta in x[m:].reshape(thetas.shape)])
        if np.abs(x - before).max() < 2e-4:
            break
    hessian = evaluate(np.concatenate([body.shape, thetas.ravel()])).hessian
    return ShapeFit(body, thetas, np.linalg.inv(hessian)[:m, :m])


def _energy(body: Body, matches: list[Correspondences], sample: SkinSample, precision: Floats):  # type: ignore[no-untyped-def]
    """The energy of x = [shape (m), theta_1 (n), ..., theta_K (n)] with its arrow-shaped normal matrix."""
    anatomy, affine = body.anatomy, body.affine
    n, m = len(anatomy.coordinates), len(body.shape)

    def evaluate(x: Floats) -> Quadratic:
        moved = make_body(anatomy, shape=np.r_[_positive_scales(x[:m])], v_hat=body.v_hat)
        prior = gaussian_term(x[:m], affine.identity, precision)
        energy, gradient, hessian = prior.energy, np.zeros(len(x)), np.zeros((len(x), len(x)))
        gradient[:m], hessian[:m, :m] = prior.gradient, prior.hessian
        for k, match in enumerate(matches):
            part = slice(m + n * k, m + n * (k + 1))
            index = np.r_[part, 0:m]
            skin = pose_skin_varying(moved, x[part], with_shape=True, vertices=match.vertex)
            data = data_term(skin, match, sample.observations[match.vertex])
            limits = range_term(anatomy, x[part])
            energy += data.energy + limits.energy
            gradient[index] += data.gradient
            gradient[part] += limits.gradient
            hessian[np.ix_(index, index)] += data.hessian
            hessian[part, part] += limits.hessian
        return Quadratic(energy, gradient, hessian)

    return evaluate


def _positive_scales(shape: Floats) -> Floats:
    """A trial step may leave the model's domain; its energy is then that of the nearest valid shape."""
    kept = shape.copy()
    kept[::4] = np.maximum(kept[::4], 0.1)
    return kept
