"""The one least-squares problem: its terms, and the normal equations that they add up to.

Everything that solves for a body or a pose, or judges how sure one is, minimises a sum of squares over the blocks

    x = [shape (m), tissue (q), theta_1 (n), ..., theta_K (n)]

of which it may hold some fixed. A term is a ``Quadratic`` over some of them: J^T J and J^T r for what is seen
(``data_term``), a precision for what is known beforehand (``gaussian_term``). No two poses share a term, so the normal
matrix has the form of an arrow: shape and tissue share entries with all, a pose with itself and with them. ``Arrow``
adds it up; ``marginal_covariance`` and ``schur_complement`` integrate blocks out of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from adapt.anatomy import Floats, Ints
from adapt.match.correspondences import Correspondences
from adapt.model.derivatives import Points, mere_points
from capture.compiled import compiled_sums

SEARCH_PLANE_WEIGHT = 10.0  # point-to-plane against point-to-point, as in the paper: forgiving from far away,
PLANE_WEIGHT = 100.0  # but sliding along the skin creeps: from near by the points count less
CERTAINTY_PLANE_WEIGHT = 1e4  # nearest points follow the skin when it slides: they hardly tell where along it a pose is
SIGMA_M = 0.002  # what one independent patch of surface disagrees by where the skin is known
PATCH_M2 = 0.03**2  # errors of neighbouring points are alike: this much skin counts as one observation
_HARDLY_TOLD = 1e-6  # curvature of what is known to 1e3 rad or m


@dataclass(frozen=True)
class Quadratic:
    """A sum of squares near a point: energy 0.5 |r|^2, its gradient J^T r and Gauss-Newton matrix J^T J."""

    energy: float
    gradient: Floats
    hessian: Floats

    def __add__(self, other: Quadratic) -> Quadratic:
        return Quadratic(self.energy + other.energy, self.gradient + other.gradient, self.hessian + other.hessian)


@dataclass(frozen=True)
class Unknowns:
    """Where the blocks stand in x: m parameters of the shape, q of the tissue, n of each pose.

    >>> of = Unknowns(m=3, q=2, n=4)
    >>> of.shape, of.tissue, of.body, of.pose(1)
    (slice(0, 3, None), slice(3, 5, None), slice(0, 5, None), slice(9, 13, None))
    """

    m: int
    q: int
    n: int

    @property
    def shape(self) -> slice:
        """The shape's parameters."""
        return slice(0, self.m)

    @property
    def tissue(self) -> slice:
        """The tissue's coefficients."""
        return slice(self.m, self.m + self.q)

    @property
    def body(self) -> slice:
        """Shape and tissue."""
        return slice(0, self.m + self.q)

    def pose(self, k: int) -> slice:
        """The k-th pose."""
        start = self.m + self.q + self.n * k
        return slice(start, start + self.n)


@dataclass(frozen=True)
class Term:
    """A part of the energy that depends on one block of the unknowns."""

    block: slice
    quadratic: Quadratic


def data_term(
    skin: Points, matches: Correspondences, weights: Floats, *, plane_weight: float = PLANE_WEIGHT
) -> Quadratic:
    """Energy of matched skin points (the M matched vertices, in order, with derivatives (M, 3, n)).

    0.5 sum_i w_i [P (n_i . (v_i - t_i))^2 + |v_i - t_i|^2] / ((P + 1) sigma^2), with P the plane's weight and w_i
    (M,) the number of independent observations that the vertex stands for.
    """
    jacobian, residual = weighted(skin, matches, weights, plane_weight=plane_weight)
    flat, far = jacobian.reshape(-1, skin.d.shape[2]), residual.ravel()
    return Quadratic(0.5 * float(np.vdot(far, far)), flat.T @ far, flat.T @ flat)


def data_energy(
    skin: Floats, matches: Correspondences, weights: Floats, *, plane_weight: float = PLANE_WEIGHT
) -> float:
    """The energy of ``data_term`` alone, for matched skin points (M, 3)."""
    _, residual = weighted(mere_points(skin), matches, weights, plane_weight=plane_weight)
    return 0.5 * float(np.vdot(residual, residual))


def weighted(skin: Points, matches: Correspondences, weights: Floats, *, plane_weight: float) -> tuple[Floats, Floats]:
    """J (M, 3, n) and r (M, 3) of which ``data_term`` is made: the energy is 0.5 |r|^2, and J is r's derivative.

    With the scale s = w / ((P + 1) sigma^2) of a match, (v - t) is multiplied by the root of its metric,
    s^(1/2) (I + ((1 + P)^(1/2) - 1) n n^T).
    """
    jacobian, residual = np.zeros_like(skin.d), np.zeros_like(skin.value)
    scale = np.sqrt(weights / ((plane_weight + 1.0) * SIGMA_M**2))
    more = math.sqrt(1.0 + plane_weight) - 1.0
    _weigh(skin.d, skin.value, matches.target, matches.normal, scale, more, jacobian, residual)
    return jacobian, residual


@compiled_sums
def _weigh(
    d: Floats,
    value: Floats,
    target: Floats,
    normal: Floats,
    scale: Floats,
    more: float,
    jacobian: Floats,
    residual: Floats,
) -> None:
    d_along = np.zeros(d.shape[2])
    for i in range(len(value)):
        s, a, b, c = scale[i], normal[i, 0], normal[i, 1], normal[i, 2]
        x, y, z = value[i, 0] - target[i, 0], value[i, 1] - target[i, 1], value[i, 2] - target[i, 2]
        along = more * (a * x + b * y + c * z)
        residual[i, 0], residual[i, 1] = s * (x + along * a), s * (y + along * b)
        residual[i, 2] = s * (z + along * c)
        for k in range(d.shape[2]):
            d_along[k] = more * (a * d[i, 0, k] + b * d[i, 1, k] + c * d[i, 2, k])
        for j in range(3):  # one array at a time is written: so the machine need not ask whether they overlap
            for k in range(d.shape[2]):
                jacobian[i, j, k] = s * (d[i, j, k] + normal[i, j] * d_along[k])


def gaussian_term(x: Floats, mean: Floats, precision: Floats) -> Quadratic:
    """A Gaussian prior: 0.5 (x - mean)^T precision (x - mean).

    >>> prior = gaussian_term(np.array([3.0]), np.array([1.0]), np.array([[4.0]]))  # a standard deviation of 0.5
    >>> prior.energy, prior.gradient.tolist(), prior.hessian.tolist()
    (8.0, [8.0], [[4.0]])
    """
    pull = precision @ (x - mean)
    return Quadratic(0.5 * float((x - mean) @ pull), pull, precision)


def data_blocks(
    skin: Points, matches: Correspondences, weights: Floats, *, plane_weight: float = PLANE_WEIGHT
) -> tuple[Floats, Floats]:
    """Normal matrices (M, 3, 3) and gradients (M, 3) of ``data_term`` match by match.

    ``skin`` has derivatives (M, 3, 3) by parameters of each match's own.
    """
    jacobian, residual = weighted(skin, matches, weights, plane_weight=plane_weight)
    turned = np.swapaxes(jacobian, 1, 2)
    return np.matmul(turned, jacobian), np.matmul(turned, residual[:, :, None])[:, :, 0]


class Arrow:
    """The sum of terms over shape, tissue and K poses: the energy, its gradient and the arrow-shaped normal matrix.

    A vertex moves with the tissue along one direction only, so the tissue's columns are never written out: what that
    direction shares with each of the others, vertex by vertex, is multiplied by the modes in the end. ``modes`` (U, q)
    are the tissue's at U vertices.
    """

    def __init__(self, of: Unknowns, poses: int, modes: Floats) -> None:
        size = of.m + of.q + of.n * poses
        self._of, self._modes = of, modes
        self._energy, self._gradient, self._hessian = 0.0, np.zeros(size), np.zeros((size, size))
        # With the shape, with the poses, with itself, and with how far the skin is off.
        self._shares = np.zeros((len(modes), size - of.q + 2))

    def add(self, *terms: Term) -> None:
        """Add terms that depend on one block each."""
        for term in terms:
            self._energy += term.quadratic.energy
            self._gradient[term.block] += term.quadratic.gradient
            self._hessian[term.block, term.block] += term.quadratic.hessian

    def add_across(self, k: int, quadratic: Quadratic) -> None:
        """Add a term over the k-th pose and the shape, in this order."""
        index = np.r_[self._of.pose(k), self._of.shape]
        self._energy += quadratic.energy
        self._gradient[index] += quadratic.gradient
        self._hessian[np.ix_(index, index)] += quadratic.hessian

    def add_matches(
        self,
        k: int,
        rows: Ints,
        skin: Points,
        matches: Correspondences,
        weights: Floats,
        *,
        plane_weight: float = PLANE_WEIGHT,
    ) -> None:
        """Add the ``data_term`` of skin in the k-th pose.

        ``rows`` (M,) are where its matched vertices stand among the U; each stands there once. The skin's derivatives
        (M, 3, n + m + 1) are by the pose, by the shape, and along the direction in which the tissue moves a vertex.
        """
        of = self._of
        jacobian, far = weighted(skin, matches, weights, plane_weight=plane_weight)
        flat = jacobian.reshape(far.size, jacobian.shape[2])
        gradient, hessian = (flat.T @ far.ravel())[:-1], (flat.T @ flat)[:-1, :-1]
        self.add_across(k, Quadratic(0.5 * float(np.vdot(far, far)), gradient, hessian))
        _add_shares(self._shares, rows, jacobian, far, of.m + k * of.n, of.n)

    def of_pose(self, k: int) -> tuple[Floats, Floats]:
        """What the k-th pose shares with itself (n, n), and with shape and tissue (n, m + q)."""
        pose, first = self._of.pose(k), self._of.m + k * self._of.n
        with_tissue = self._shares[:, first : first + self._of.n].T @ self._modes
        return self._hessian[pose, pose], np.hstack([self._hessian[pose, self._of.shape], with_tissue])

    def quadratic(self) -> Quadratic:
        """The sum."""
        of, gradient, hessian = self._of, self._gradient.copy(), self._hessian.copy()
        tissue = np.arange(of.tissue.start, of.tissue.stop)
        others = np.delete(np.arange(len(gradient)), tissue)
        cross = self._modes.T @ self._shares
        gradient[tissue] += cross[:, -1]
        hessian[np.ix_(tissue, others)] = cross[:, :-2]
        hessian[np.ix_(others, tissue)] = cross[:, :-2].T
        rooted = np.sqrt(self._shares[:, -2])[:, None] * self._modes
        hessian[of.tissue, of.tissue] += rooted.T @ rooted  # a product with itself costs half of one with another
        return Quadratic(self._energy, gradient, hessian)


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


def marginal_covariance(hessian: Floats, kept: slice) -> Floats:
    """Covariance (k, k) of some unknowns, all others integrated out: their block of the normal matrix' inverse.

    >>> marginal_covariance(np.array([[2.0, 1.0], [1.0, 1.0]]), slice(0, 1)).tolist()
    [[1.0]]
    """
    return np.asarray(np.linalg.inv(hessian)[kept, kept])


def schur_complement(hessian: Floats, gone: slice) -> Floats:
    """The normal matrix (k, k) of the other unknowns once those that are ``gone`` are integrated out.

    >>> schur_complement(np.array([[2.0, 1.0], [1.0, 1.0]]), slice(1, 2)).tolist()
    [[1.0]]
    """
    out = np.arange(len(hessian))[gone]
    kept = np.delete(np.arange(len(hessian)), out)
    across = hessian[np.ix_(out, kept)]
    return np.asarray(hessian[np.ix_(kept, kept)] - across.T @ np.linalg.solve(hessian[gone, gone], across))


def lever(hessian: Floats, cross: Floats) -> Floats:
    """How far (n, k) the best point moves against what shares ``cross`` (n, k) with it: H^-1 cross.

    What nothing tells moves nowhere.

    >>> lever(np.array([[4.0]]), np.array([[2.0]])).round(4).tolist()
    [[0.5]]
    """
    return np.asarray(np.linalg.solve(hessian + _HARDLY_TOLD * np.eye(len(hessian)), cross))


def effective_parameters(whole: Quadratic, known: Iterable[Term]) -> float:
    """How many of N unknowns the data decided, not what was ``known`` beforehand: N - trace(H^-1 H_known).

    >>> one = Term(slice(0, 1), gaussian_term(np.zeros(1), np.zeros(1), np.array([[3.0]])))
    >>> effective_parameters(Quadratic(0.0, np.zeros(2), np.diag([4.0, 1.0])), [one])  # of the first, 1/4 is the data's
    1.25
    """
    held = [np.trace(marginal_covariance(whole.hessian, term.block) @ term.quadratic.hessian) for term in known]
    return len(whole.gradient) - float(sum(held))
