"""What is known before the data: joint ranges, and how bodies differ from the template."""

from __future__ import annotations

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.fit.least_squares import Quadratic
from adapt.model.body import Body
from adapt.model.handles import AffineSet

RANGE_SIGMA_RAD = np.deg2rad(2.0)  # how softly a joint's range ends
SIZE_SIGMA = 0.2  # overall size against the template: children of six (0.6) and very tall men (1.25) are people, too
GIRTH_SIGMA = 0.04  # scale of one joint against the overall size
LENGTH_SIGMA = 0.06  # length of one bone against the overall size
SIDEWAYS_SIGMA_M = 0.002  # direction of a bone: how far its end may stray sideways
_GAUGE_SIGMA_M = 1e-3  # the pose already moves the whole body: the first group stays where it is


def range_term(anatomy: Anatomy, theta: Floats) -> Quadratic:
    """Zero inside the joint ranges, quadratic outside."""
    low = np.array([coordinate.low for coordinate in anatomy.coordinates])
    high = np.array([coordinate.high for coordinate in anatomy.coordinates])
    residual = (theta - np.clip(theta, low, high)) / RANGE_SIGMA_RAD
    outside = (residual != 0.0) / RANGE_SIGMA_RAD
    return Quadratic(0.5 * float(residual @ residual), outside * residual, np.diag(outside**2))


def shape_precision(anatomy: Anatomy, affine: AffineSet) -> Floats:
    """Precision (4J, 4J) of a Gaussian over shapes, centred on the identity.

    Bodies differ by an overall size g first; joints' scales and bones' lengths follow g up to their own
    spread. g itself is integrated out, so any uniform scaling costs only SIZE_SIGMA.
    """
    full = _with_size(anatomy, affine)
    return np.asarray(full[:-1, :-1] - np.outer(full[:-1, -1], full[-1, :-1]) / full[-1, -1])


def overall_size(body: Body) -> float:
    """How large a body is against its template: the likeliest g of ``shape_precision`` for its shape."""
    full = _with_size(body.anatomy, body.affine)
    return float(1.0 - full[-1, :-1] @ (body.shape - body.affine.identity) / full[-1, -1])


def _with_size(anatomy: Anatomy, affine: AffineSet) -> Floats:
    """Precision (4J + 1, 4J + 1) of [shape, g], both against the identity."""
    n = len(affine.identity)
    rows = [_row(n + 1, {n: 1.0 / SIZE_SIGMA})]
    for j in range(len(affine.groups)):
        rows.append(_row(n + 1, {4 * j: 1.0 / GIRTH_SIGMA, n: -1.0 / GIRTH_SIGMA}))
    for first, second in bones_between_groups(anatomy, affine):
        span = affine.centres[second] - affine.centres[first]
        length = float(np.linalg.norm(span))
        for direction in _basis(span / length):
            grows = float(direction @ span)
            sigma = LENGTH_SIGMA * length if abs(grows) > 0.5 * length else SIDEWAYS_SIGMA_M
            entries = {4 * second + 1 + k: direction[k] / sigma for k in range(3)}
            entries |= {4 * first + 1 + k: -direction[k] / sigma for k in range(3)}
            rows.append(_row(n + 1, entries | {n: -grows / sigma}))
    rows += [_row(n + 1, {1 + k: 1.0 / _GAUGE_SIGMA_M}) for k in range(3)]
    stacked = np.array(rows)
    return np.asarray(stacked.T @ stacked)


def bones_between_groups(anatomy: Anatomy, affine: AffineSet) -> list[tuple[int, int]]:
    """Pairs of handle groups that a bone spans, each once; a bone within one group (a kneecap) spans none."""
    pairs = []
    for bone in anatomy.bones:
        groups = [affine.groups.index(h.joint) for h in anatomy.handles if h.bone == bone.name]
        if groups[0] != groups[-1]:
            pairs.append((groups[0], groups[-1]))
    return list(dict.fromkeys(pairs))


def _basis(direction: Floats) -> Floats:
    """A rotation's rows (3, 3), the first along ``direction``."""
    _, _, rows = np.linalg.svd(direction[None])
    return np.asarray(rows)


def _row(n: int, entries: dict[int, float]) -> Floats:
    row = np.zeros(n)
    for index, value in entries.items():
        row[index] = value
    return row
