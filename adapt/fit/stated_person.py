"""What it buys to know a person's height, mass and sex: how long each bone is, and how sure that is with and without.

Both posteriors are Gaussians with the same data: taking one prior's precision from the information and adding the
other's gives the deviation that the same clouds would have left without knowing.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from adapt.anatomy import Floats
from adapt.fit.alternate import Adaptation
from adapt.fit.posterior import deviation_along, with_other_prior
from adapt.model.body import Body
from adapt.model.shape.population import ANYBODY, Person
from adapt.model.shape.prior import bones_between_groups, shape_prior


@dataclass(frozen=True)
class ToldLength:
    """A bone between two joints' centres (mm): expected beforehand, fitted, and how sure that is with and without."""

    bone: str
    expected_mm: float
    expected_sd_mm: float
    length_mm: float
    sd_mm: float
    sd_of_anybody_mm: float


def lengths_told(body: Body, covariance: Floats, person: Person) -> list[ToldLength]:
    """The bones' lengths of a body whose shape and tissue (m + q) have that covariance, adapted as that person's."""
    mine, anybodys = (shape_prior(body.anatomy, body.affine, one) for one in (person, ANYBODY))
    without = with_other_prior(covariance, mine.precision, anybodys.precision)
    expected: Floats = np.asarray(np.linalg.inv(mine.precision), dtype=np.float64)
    told = []
    for (first, second), bone in bones_between_groups(body.anatomy, body.affine).items():
        length, along = _length(body, body.shape, first, second)
        usual, _ = _length(body, mine.mean, first, second)
        before, sd, of_anybody = (1e3 * deviation_along(known, along) for known in (expected, covariance, without))
        told.append(ToldLength(bone, 1e3 * usual, before, 1e3 * length, sd, of_anybody))
    return told


def _length(body: Body, shape: Floats, first: int, second: int) -> tuple[float, Floats]:
    """A bone's length (m) in a shape (m,), and its derivative (m,) by the shape."""
    heads = body.affine.heads(shape)
    span = heads[second] - heads[first]
    length, along = float(np.linalg.norm(span)), np.zeros(len(shape))
    along[body.affine.shift_columns[second]] = span / length
    along[body.affine.shift_columns[first]] -= span / length
    return length, along


def person_report(adaptation: Adaptation, person: Person) -> dict[str, Any]:
    """What a subject's report says of the stated person; nothing where nothing is stated."""
    if person.is_unknown:
        return {}
    told = lengths_told(adaptation.body, adaptation.covariance, person)
    return {"person": asdict(person), "lengths": [asdict(length) for length in told]}
