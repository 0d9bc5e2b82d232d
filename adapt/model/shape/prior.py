"""How bodies differ from the template: by an overall size first, then joint by joint and bone by bone."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.model.body import Body
from adapt.model.shape.handle_space import AffineSet

SIZE_SIGMA = 0.2  # overall size against the template: children of six (0.6) and very tall men (1.25) are people, too
GIRTH_SIGMA = 0.04  # scale of one joint against the overall size
LENGTH_SIGMA = 0.06  # length of one bone against the overall size
SIDEWAYS_SIGMA_M = 0.002  # direction of a bone: how far its end may stray sideways
_GAUGE_SIGMA_M = 1e-3  # the pose already moves the whole body: the first group stays where it is


def shape_precision(anatomy: Anatomy, affine: AffineSet) -> Floats:
    """Precision (4J, 4J) of a Gaussian over shapes, centred on the identity.

    Bodies differ by an overall size g first; joints' scales and bones' lengths follow g up to their own
    spread. g itself is integrated out, so any uniform scaling costs only SIZE_SIGMA.

    >>> from adapt.anatomy_file import load_anatomy
    >>> from adapt.model.body import make_body
    >>> from adapt.model.size import resized
    >>> arm = make_body(load_anatomy("upper-limb-right"))
    >>> larger = resized(arm, 1.0 + SIZE_SIGMA).shape - arm.shape
    >>> round(float(larger @ shape_precision(arm.anatomy, arm.affine) @ larger), 2)  # one standard deviation squared
    0.99
    """
    full = _with_size(anatomy, affine)
    return np.asarray(full[:-1, :-1] - np.outer(full[:-1, -1], full[-1, :-1]) / full[-1, -1])


def overall_size(body: Body) -> float:
    """How large a body is against its template: the likeliest g of ``shape_precision`` for its shape.

    >>> from adapt.anatomy_file import load_anatomy
    >>> from adapt.model.body import make_body
    >>> from adapt.model.size import resized
    >>> arm = make_body(load_anatomy("upper-limb-right"))
    >>> round(overall_size(arm), 2), round(overall_size(resized(arm, 1.1)), 2)
    (1.0, 1.1)
    """
    full = _with_size(body.anatomy, body.affine)
    return float(1.0 - full[-1, :-1] @ (body.shape - body.affine.identity) / full[-1, -1])


def _with_size(anatomy: Anatomy, affine: AffineSet) -> Floats:
    """Precision (4J + 1, 4J + 1) of [shape, g], both against the identity."""
    n, shifts = len(affine.identity), affine.shift_columns
    rows = [_row(n + 1, {n: 1.0 / SIZE_SIGMA})]
    rows += [_row(n + 1, {column: 1.0 / GIRTH_SIGMA, n: -1.0 / GIRTH_SIGMA}) for column in affine.scale_columns]
    for first, second in bones_between_groups(anatomy, affine):
        span = affine.centres[second] - affine.centres[first]
        length = float(np.linalg.norm(span))
        for direction in _basis(span / length):
            grows = float(direction @ span)
            sigma = LENGTH_SIGMA * length if abs(grows) > 0.5 * length else SIDEWAYS_SIGMA_M
            entries = {shifts[second, k]: direction[k] / sigma for k in range(3)}
            entries |= {shifts[first, k]: -direction[k] / sigma for k in range(3)}
            rows.append(_row(n + 1, entries | {n: -grows / sigma}))
    rows += [_row(n + 1, {column: 1.0 / _GAUGE_SIGMA_M}) for column in shifts[0]]
    stacked = np.array(rows)
    return np.asarray(stacked.T @ stacked)


def bones_between_groups(anatomy: Anatomy, affine: AffineSet) -> dict[tuple[int, int], str]:
    """All pairs of handle groups that a bone spans, and the first bone that does; a kneecap within one spans none.

    >>> from adapt.anatomy_file import load_anatomy
    >>> from adapt.model.shape.handle_space import affine_set
    >>> leg = load_anatomy("lower-limb-right")
    >>> bones_between_groups(leg, affine_set(leg))
    {(0, 1): 'pelvis', (1, 2): 'femur', (2, 3): 'tibia', (3, 4): 'foot'}
    """
    pairs: dict[tuple[int, int], str] = {}
    for bone in anatomy.bones:
        groups = dict.fromkeys(affine.groups.index(h.joint) for h in anatomy.handles if h.bone == bone.name)
        for pair in combinations(groups, 2):
            pairs.setdefault(pair, bone.name)
    return pairs


def _basis(direction: Floats) -> Floats:
    """A rotation's rows (3, 3), the first along ``direction``."""
    _, _, rows = np.linalg.svd(direction[None])
    return np.asarray(rows)


def _row(n: int, entries: dict[int, float]) -> Floats:
    row = np.zeros(n)
    for index, value in entries.items():
        row[index] = value
    return row
