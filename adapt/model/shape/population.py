"""How people's limbs vary: with stature, mass and sex where they are stated, and together with each other.

Logarithms of measures are taken to be normal for either sex, with means and full covariances of ANSUR II
(``ansur2.json``, of 4,082 men and 1,986 women; how it is made: ``adapt.template_builder.population``). What somebody
states is conditioned on; where the sex is not stated, either is as likely beforehand, and what is stated weighs them.

A measure's *residual* is the logarithm of how much larger it is than the average man's, beyond what the stature is: the
average man has zeros, and so has whoever is as well proportioned as he is.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np

from adapt.anatomy import Floats
from capture.errors import FitError

POPULATION = Path(__file__).with_name("ansur2.json")
MEN_M = 1.755  # the average man's stature (geometric mean)
SEXES = ("male", "female")

# What of the survey says how a bone's length and a joint's scale vary. A joint's bony breadth where there is one; the
# girths of flesh beside it vary with fat, which the soft tissue takes up (``adapt.tissue``), and bone does not follow.
BONE_MEASURES = {
    "humerus": "upper arm",
    "ulna": "forearm length",
    "radius": "forearm length",
    "hand": "palm",
    "pelvis": "pelvis breadth",
    "femur": "thigh",
    "tibia": "shank",
    "foot": "foot",
}
JOINT_MEASURES = {
    "wrist": "wrist girth",
    "knuckles": "hand breadth",
    "crest": "pelvis breadth",
    "ankle": "ankle breadth",
    "toes": "foot breadth",
}

_SIDES = {"_r": "_l", "_l": "_r"}  # how names of a body that has both sides end

_HEIGHT_M, _MASS_KG = (0.9, 2.4), (10.0, 250.0)  # what is believed of somebody
_SURVEYED_M = (1.45, 2.0)  # of other statures the survey says next to nothing: a child is no small soldier
_SURVEYED_KG = (40.0, 140.0)
_STATED = {"stature": 0.01, "mass": 0.04}  # standard deviation of what people state, as a share (an assumption)


@dataclass(frozen=True)
class Person:
    """What somebody says of a person; None where nothing is said.

    Raises:
        FitError: a height or a mass that nobody has, or another word for the sex than ``male`` and ``female``.
    """

    height_m: float | None = None
    mass_kg: float | None = None
    sex: str | None = None

    def __post_init__(self) -> None:
        for name, value, (least, most), unit in (
            ("height", self.height_m, _HEIGHT_M, "m"),
            ("mass", self.mass_kg, _MASS_KG, "kg"),
        ):
            if value is not None and not least <= value <= most:
                remedy = f"give {'metres' if unit == 'm' else 'kilograms'}, {least:g} to {most:g}"
                raise FitError(f"a {name} of {value:g} {unit} is nobody's", remedy=remedy)
        if self.sex not in (None, *SEXES):
            raise FitError(f"the survey knows no sex {self.sex!r}", remedy="give male or female, or nothing")

    @property
    def is_unknown(self) -> bool:
        """Whether nothing is said."""
        return self.height_m is None and self.mass_kg is None and self.sex is None

    @property
    def is_surveyed(self) -> bool:
        """Whether the survey has people of this height and mass."""
        return _within(self.height_m, _SURVEYED_M) and _within(self.mass_kg, _SURVEYED_KG)

    def in_words(self) -> str:
        """What is said, in words.

        >>> Person(1.78, sex="male").in_words()
        '1.78 m, male'
        """
        height = [] if self.height_m is None else [f"{self.height_m:.2f} m"]
        mass = [] if self.mass_kg is None else [f"{self.mass_kg:g} kg"]
        return ", ".join(height + mass + ([] if self.sex is None else [self.sex]))


ANYBODY = Person()


@dataclass(frozen=True, eq=False)
class Residuals:
    """Mean (K,) and covariance (K, K) of the residuals of ``measures``."""

    measures: tuple[str, ...]
    mean: Floats = field(repr=False)
    covariance: Floats = field(repr=False)

    def of(self, measures: tuple[str, ...]) -> tuple[Floats, Floats]:
        """Mean (N,) and covariance (N, N) of some of the measures; one may be named more than once."""
        rows = [self.measures.index(name) for name in measures]
        return self.mean[rows], self.covariance[np.ix_(rows, rows)]


def bone_measure(bone: str) -> str | None:
    """The survey's measure of a bone, on either side; None where there is none.

    >>> bone_measure("femur"), bone_measure("femur_l"), bone_measure("patella_l")
    ('thigh', 'thigh', None)
    """
    return BONE_MEASURES.get(_without_side(bone))


def joint_measure(joint: str) -> str | None:
    """The same of a joint's thickness.

    >>> joint_measure("wrist_r"), joint_measure("elbow_r")
    ('wrist girth', None)
    """
    return JOINT_MEASURES.get(_without_side(joint))


def of_other_side(name: str) -> str | None:
    """The name of the other side's bone or joint in a body that has both; None in the middle.

    >>> of_other_side("femur_r"), of_other_side("pelvis")
    ('femur_l', None)
    """
    end = _SIDES.get(name[-2:])
    return None if end is None else name[:-2] + end


def _without_side(name: str) -> str:
    return name[:-2] if name[-2:] in _SIDES else name


@lru_cache(maxsize=16)
def residuals(person: Person) -> Residuals:
    """How the measures of people like that one vary, beyond their stature.

    A height beyond the survey's says nothing of proportions, nor does a mass.

    >>> anybody, tall = residuals(ANYBODY), residuals(Person(1.95, sex="male"))
    >>> mean, covariance = anybody.of(("shank",))
    >>> np.round(100 * np.r_[mean, covariance[0] ** 0.5], 1).tolist()  # per cent
    [1.1, 3.9]
    >>> mean, covariance = tall.of(("shank",))  # tall men have longer shanks still
    >>> np.round(100 * np.r_[mean, covariance[0] ** 0.5], 1).tolist()
    [3.1, 3.5]
    """
    stated = person if person.is_surveyed else Person(sex=person.sex)
    measures, means, covariances, weights = *_survey(), []
    sexes = [k for k, sex in enumerate(SEXES) if stated.sex in (None, sex)]
    conditioned = []
    for k in sexes:
        mean, covariance, log_likelihood = _given(stated, measures, means[k], covariances[k])
        conditioned.append((mean, covariance))
        weights.append(log_likelihood)
    share = np.exp(np.array(weights) - max(weights))
    share /= share.sum()
    beyond = _beyond_stature(measures)
    centres = np.array([beyond @ (mean - means[0]) for mean, _ in conditioned])
    mean = share @ centres
    within = sum(s * beyond @ covariance @ beyond.T for s, (_, covariance) in zip(share, conditioned, strict=True))
    between = (share * (centres - mean).T) @ (centres - mean)
    return Residuals(measures, mean, np.asarray(within + between))


def _given(person: Person, measures: tuple[str, ...], mean: Floats, covariance: Floats) -> tuple[Floats, Floats, float]:
    """Mean (K,) and covariance (K, K) of one sex's logarithms given what is stated, and how likely (log) that was."""
    values = {"stature": person.height_m, "mass": person.mass_kg}
    known = {name: value for name, value in values.items() if value is not None}
    if not known:
        return mean, covariance, 0.0
    rows = [measures.index(name) for name in known]
    off = np.log(list(known.values())) - mean[rows]
    spread = covariance[np.ix_(rows, rows)] + np.diag([_STATED[name] ** 2 for name in known])
    gain = np.linalg.solve(spread, covariance[rows]).T
    likely = -0.5 * (off @ np.linalg.solve(spread, off) + np.linalg.slogdet(spread)[1])
    return mean + gain @ off, covariance - gain @ covariance[rows], float(likely)


def _beyond_stature(measures: tuple[str, ...]) -> Floats:
    """(K, K): logarithms less that of the stature; the stature's own is left as it is."""
    beyond = np.eye(len(measures))
    stature = measures.index("stature")
    beyond[:, stature] -= 1.0
    beyond[stature, stature] = 1.0
    return beyond


def of_men_and_women(measure: str) -> tuple[Floats, Floats]:
    """Means (2,) of a measure, in m, in men and in women, and deviations (2,) of its logarithm.

    >>> means, deviations = of_men_and_women("foot")
    >>> (1e3 * means).round().tolist(), (100 * deviations).round(1).tolist()
    ([271.0, 246.0], [4.8, 5.1])
    """
    measures, means, covariances = _survey()
    k = measures.index(measure)
    return np.exp(means[:, k]), np.sqrt(covariances[:, k, k])


@lru_cache(maxsize=1)
def _survey() -> tuple[tuple[str, ...], Floats, Floats]:
    """The measures, and means (2, K) and covariances (2, K, K) of their logarithms in men and women."""
    table = json.loads(POPULATION.read_text(encoding="utf-8"))
    means = np.array([table[sex]["mean"] for sex in SEXES])
    return tuple(table["measures"]), means, np.array([table[sex]["covariance"] for sex in SEXES])


def _within(value: float | None, interval: tuple[float, float]) -> bool:
    return value is None or interval[0] <= value <= interval[1]
