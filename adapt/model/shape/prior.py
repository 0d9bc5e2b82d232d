"""How bodies differ from the template: by an overall size first, then joint by joint and bone by bone."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.model.body import Body
from adapt.model.shape.handle_space import AffineSet
from adapt.model.shape.population import (
    ANYBODY,
    MEN_M,
    Person,
    bone_measure,
    joint_measure,
    of_other_side,
    residuals,
)

SIZE_SIGMA = 0.2  # overall size against the template: children of six (0.6) and very tall men (1.25) are people, too
STATED_SIGMA = 0.02  # the same where the height is stated: the template may be no average man's, nor the height exact
OWN_SIGMA = 0.025  # of ours against the survey's measures: other end points, and a template of one body (an assumption)
GIRTH_SIGMA = 0.04  # scale of one joint against the overall size, where the survey has no measure of it
LENGTH_SIGMA = 0.06  # length of one bone against the overall size, likewise
ALIKE_SIGMA = 0.03  # one side's lengths and scales against the other's, of a body that has both (an assumption)
SIDEWAYS_SIGMA_M = 0.002  # direction of a bone: how far its end may stray sideways
_GAUGE_SIGMA_M = 1e-3  # the pose already moves the whole body: the first group stays where it is


@dataclass(frozen=True, eq=False)
class ShapePrior:
    """A Gaussian over shapes: mean (4J,) and precision (4J, 4J)."""

    mean: Floats = field(repr=False)
    precision: Floats = field(repr=False)


def shape_prior(anatomy: Anatomy, affine: AffineSet, person: Person = ANYBODY) -> ShapePrior:
    """What is known of a body's proportions before it is seen, given what is said of the person.

    Bodies differ by an overall size g first, the person's stature against the average man's. Bones' lengths and
    joints' scales follow g up to their own spread, which hangs together as in ANSUR II (``population``), and OWN_SIGMA
    for what its measures do not say of ours; where a bone or a joint has no measure there, by LENGTH_SIGMA and
    GIRTH_SIGMA. Of a bone with more than two heads (a pelvis, a chest) that goes for all pairs; the first keeps its
    direction, and from it the others stray with the bone's proportions, by GIRTH_SIGMA of their length. Where there are
    both sides, one is like the other up to ALIKE_SIGMA. g itself is integrated out: where no height is stated, any
    uniform scaling costs only SIZE_SIGMA.

    >>> from adapt.anatomy_file import load_anatomy
    >>> from adapt.model.body import make_body
    >>> from adapt.model.size import resized
    >>> arm = make_body(load_anatomy("upper-limb-right"))
    >>> larger = resized(arm, 1.0 + SIZE_SIGMA).shape - arm.shape
    >>> anybody, tall = (shape_prior(arm.anatomy, arm.affine, person) for person in (ANYBODY, Person(height_m=1.95)))
    >>> round(float(larger @ anybody.precision @ larger), 1)  # one standard deviation squared
    1.0
    >>> np.round(arm.affine.scales(tall.mean), 2).tolist()
    [1.11, 1.11, 1.08, 1.07]
    """
    information, pull = _with_size(anatomy, affine, person)
    mean = np.linalg.solve(information, pull)[:-1]
    coupling = information[:-1, -1]
    precision = information[:-1, :-1] - np.outer(coupling, coupling) / information[-1, -1]
    return ShapePrior(affine.identity + mean, np.asarray(precision))


def overall_size(body: Body) -> float:
    """How large a body is against its template: the likeliest g of ``shape_prior`` for its shape, of an average man.

    >>> from adapt.anatomy_file import load_anatomy
    >>> from adapt.model.body import make_body
    >>> from adapt.model.size import resized
    >>> arm = make_body(load_anatomy("upper-limb-right"))
    >>> round(overall_size(arm), 2), round(overall_size(resized(arm, 1.1)), 2)
    (1.0, 1.1)
    """
    full, _ = _with_size(body.anatomy, body.affine, ANYBODY)
    return float(1.0 - full[-1, :-1] @ (body.shape - body.affine.identity) / full[-1, -1])


def _with_size(anatomy: Anatomy, affine: AffineSet, person: Person) -> tuple[Floats, Floats]:
    """Information (4J + 1, 4J + 1) on [shape, g], both against the identity, and the information times the mean."""
    n, shifts, groups = len(affine.identity), affine.shift_columns, affine.groups
    surveyed: list[tuple[Floats, str]] = []  # rows whose value is a measure's residual
    rows: list[Floats] = []  # rows with one standard deviation and mean zero
    scales = {frozenset([j]): _row(n + 1, {c: 1.0, n: -1.0}) for j, c in zip(groups, affine.scale_columns, strict=True)}
    for joint in groups:
        _sort(scales[frozenset([joint])], joint_measure(joint), GIRTH_SIGMA, surveyed, rows)
    lengths: dict[frozenset[str], Floats] = {}
    begun: set[str] = set()
    for (first, second), bone in bones_between_groups(anatomy, affine).items():
        span = affine.centres[second] - affine.centres[first]
        length = float(np.linalg.norm(span))
        stray_m = max(SIDEWAYS_SIGMA_M, GIRTH_SIGMA * length) if bone in begun else SIDEWAYS_SIGMA_M
        begun.add(bone)
        for direction in _basis(span / length):
            grows = float(direction @ span)
            lengthwise = abs(grows) > 0.5 * length
            unit = length if lengthwise else stray_m
            entries = {shifts[second, k]: direction[k] / unit for k in range(3)}
            entries |= {shifts[first, k]: -direction[k] / unit for k in range(3)}
            row = _row(n + 1, entries | {n: -grows / unit})
            if lengthwise:
                lengths[frozenset((groups[first], groups[second]))] = row * np.sign(grows)
                _sort(row * np.sign(grows), bone_measure(bone), LENGTH_SIGMA, surveyed, rows)
            else:
                rows.append(row)
    if anatomy.side == "both":
        rows += [*_alike(scales), *_alike(lengths)]
    rows += [_row(n + 1, {column: 1.0 / _GAUGE_SIGMA_M}) for column in shifts[0]]
    size, sigma = _size(person)
    rows.append(_row(n + 1, {n: 1.0 / sigma}))
    pull = rows[-1] * size / sigma
    information = np.array(rows).T @ np.array(rows)
    if surveyed:
        of = np.array([row for row, _ in surveyed])
        mean, covariance = residuals(person).of(tuple(measure for _, measure in surveyed))
        precision = np.linalg.inv(covariance + OWN_SIGMA**2 * np.eye(len(of)))
        information, pull = information + of.T @ precision @ of, pull + of.T @ precision @ mean
    return np.asarray(information), np.asarray(pull)


def _alike(sizes: dict[frozenset[str], Floats]) -> list[Floats]:
    """Rows that hold sizes of one side to those of the other; ``sizes`` are told by the joints that they are of."""
    rows = []
    for joints, row in sizes.items():
        other = frozenset(of_other_side(joint) or joint for joint in joints)
        if other != joints and other in sizes and min(joints ^ other) in joints:  # each pair once
            rows.append((row - sizes[other]) / ALIKE_SIGMA)
    return rows


def _sort(
    row: Floats, measure: str | None, sigma: float, surveyed: list[tuple[Floats, str]], rows: list[Floats]
) -> None:
    """Put a row with those that have a measure in the survey, or with those that have a deviation of their own."""
    if measure is None:
        rows.append(row / sigma)
    else:
        surveyed.append((row, measure))


def _size(person: Person) -> tuple[float, float]:
    """The mean of the overall size g less 1, and its standard deviation."""
    if person.height_m is None:
        return 0.0, SIZE_SIGMA
    return person.height_m / MEN_M - 1.0, STATED_SIGMA


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
