"""How far healthy people move, for the few angles of which an open source could be read and says so.

These are ranges that a joint has, not what a movement should use: who lifts a cup bends the elbow as far as the cup
asks. Of other angles, and of whole cycles, nothing is given: no open source with the same zero, sign and movement was
read.
"""

from __future__ import annotations

from dataclasses import dataclass

from adapt.plain_words import without_side


@dataclass(frozen=True)
class Norm:
    """What healthy people ``reach`` (deg, in the coordinate's own zero and sign), of whom, and where that stands."""

    reach: str
    whose: str
    source: str


def norm_of(coordinate: str) -> Norm | None:
    """The norm of a coordinate's range; None where no source is at hand.

    >>> norm_of("knee_angle_l").reach, norm_of("hip_rotation_r")
    ('up to 138 (men), 142 (women)', None)
    """
    return _NORMS.get(without_side(coordinate))


_ZWERUS = (
    "Zwerus et al. 2019, Normative values and affecting factors for the elbow range of motion, Shoulder & Elbow 11, "
    "215-224 (PMC6555111)"
)
_SOUCIE = (
    "Soucie et al. 2011, Range of motion measurements: reference values and a database for comparison studies, "
    "Haemophilia 17, 500-507, and the table of the Centers for Disease Control and Prevention"
)
_ADULTS = "352 healthy adults, moved by themselves, by goniometer (means)"
_NORMS = {
    "elbow_flexion": Norm("-2 to 146", _ADULTS, _ZWERUS),
    "pro_sup": Norm("-87 to 80", _ADULTS, _ZWERUS),
    "knee_angle": Norm(
        "up to 138 (men), 142 (women)", "healthy people of 20 to 44, moved by an examiner, by goniometer", _SOUCIE
    ),
}
