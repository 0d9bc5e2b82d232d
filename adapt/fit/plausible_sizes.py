"""Whether anybody has bones of such a size: a body that came out otherwise is no person's, however well it fits.

Lengths of grown-ups are those of ANSUR II (``adapt.model.shape.population``), between landmarks on the skin. Children
of six are taken to be grown-ups on a smaller scale: their stature is 115.1 cm with a deviation of 5.1 cm (WHO growth
reference 2007, height for age at 72 months, girls: M 115.1244 cm, S 0.04447; boys are 0.8 cm taller and vary less),
and their limbs are as much shorter again as their stature is lower by its share of leg, stature less sitting height:
0.477 in men (ANSUR II), 0.45 at six.

Assumptions go with that: 0.45 lies between two surveys of which only tables at second hand were at hand (0.446 in
Snyder and others 1977, 0.459 in Fredriks and others 2005); an arm is shorter by the share that a leg is; the template's
bones are the average man's within 7 %, the distance between two joints' centres varies as that between the landmarks on
the skin does, and a bone is told to a few per cent by the fit: together _ALLOWED.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np

from adapt.model.body import Body
from adapt.model.shape.population import bone_measure, of_men_and_women
from adapt.model.shape.prior import bones_between_groups
from capture.errors import FitError

_DEVIATIONS = 3.29  # of a normal distribution, either way: 99.9 % lie within
_ALLOWED = 1.18
_CHILD = 1151.24 * (1.0 - _DEVIATIONS * 0.04447) / 1756.2 * 0.45 / 0.477
"""The smallest girl of six against the average man, in limbs."""
_NEIGHBOURS = 1.19 * _ALLOWED
"""How far two neighbours' ratio may be from the template's. ANSUR II, 99.9 % of people of one sex: thigh and
shank 1.19, forearm and upper arm 1.17, hand and forearm 1.17, shank and foot 1.16."""
_PELVIS_AND_THIGH = 1.35 * _ALLOWED
"""The same of a pelvis and a thigh: 1.35 (women; men 1.29)."""
_LEAST_GIRTH, _LARGEST_GIRTH = 0.44, 1.5  # a joint's scale; assumed: thickness varies more than length

_REMEDY = (
    "likely causes, first things first: depth in another unit, a wrong focal length, the other side's anatomy, "
    "something else than the limb (narrow the region, or give first poses)"
)


def _plausible(measure: str) -> tuple[float, float]:
    """What 99.9 % exceed, of children of six and of grown women, and what 99.9 % of men stay below: of men's mean."""
    (man, woman), (man_sd, woman_sd) = of_men_and_women(measure)
    return min(_CHILD, woman / man * np.exp(-_DEVIATIONS * woman_sd)), float(np.exp(_DEVIATIONS * man_sd))


@dataclass(frozen=True)
class BoneLength:
    """A bone between two joints' centres (m), the template's, and what 99.9 % of people have (m)."""

    bone: str
    joints: frozenset[int]
    length_m: float
    template_m: float
    least_m: float
    largest_m: float


def bone_lengths(body: Body) -> list[BoneLength]:
    """The bones that span from joint to joint, parallel ones once, from the trunk outwards.

    >>> from adapt.anatomy_file import load_anatomy
    >>> from adapt.model.body import make_body
    >>> [(bone.bone, round(bone.length_m, 2)) for bone in bone_lengths(make_body(load_anatomy("upper-limb-right")))]
    [('humerus', 0.3), ('ulna', 0.25), ('hand', 0.1)]
    """
    heads, template = body.affine.heads(body.shape), body.affine.centres
    lengths = []
    for (first, last), bone in bones_between_groups(body.anatomy, body.affine).items():
        length, usual = (float(np.linalg.norm(points[last] - points[first])) for points in (heads, template))
        least, largest = _plausible(bone_measure(bone) or "stature")
        joints = frozenset((first, last))
        lengths.append(BoneLength(bone, joints, length, usual, least * usual / _ALLOWED, largest * usual * _ALLOWED))
    return lengths


def refuse_what_nobody_is(body: Body, where: Path) -> None:
    """Refuse a body of which a bone, two neighbouring bones or a joint have a size that nobody has.

    Raises:
        FitError: it names the bone, its size, what people have, and the causes in order of likelihood.
    """
    bones = bone_lengths(body)
    strange = [bone for bone in bones if not bone.least_m <= bone.length_m <= bone.largest_m]
    if strange:
        worst = max(strange, key=lambda bone: abs(np.log(bone.length_m / bone.template_m)))
        raise FitError(
            f"the {worst.bone} came out {_mm(worst.length_m)} mm long, {worst.length_m / worst.template_m:.2f} of the "
            f"template's; 99.9 % of people from six years on have {_mm(worst.least_m)} to {_mm(worst.largest_m)} mm",
            where=where,
            remedy=_REMEDY,
        )
    for one, other in combinations([bone for bone in bones if bone_measure(bone.bone)], 2):
        if one.bone == other.bone or not one.joints & other.joints:
            continue
        ratio = (one.length_m / one.template_m) / (other.length_m / other.template_m)
        allowed = _PELVIS_AND_THIGH if "pelvis" in (one.bone, other.bone) else _NEIGHBOURS
        if max(ratio, 1.0 / ratio) > allowed:
            usual = one.template_m / other.template_m
            raise FitError(
                f"the {one.bone} came out {_mm(one.length_m)} mm long and the {other.bone} {_mm(other.length_m)} mm, "
                f"{ratio * usual:.2f} to 1; people have {usual / allowed:.2f} to {usual * allowed:.2f} to 1",
                where=where,
                remedy="the limb is probably laid along something else, or a part of it was never seen: narrow the "
                "region, choose other frames, or give first poses",
            )
    scales = body.affine.scales(body.shape)
    joint = int(np.abs(np.log(scales)).argmax())
    if not _LEAST_GIRTH <= scales[joint] <= _LARGEST_GIRTH:
        raise FitError(
            f"the {body.affine.groups[joint]} came out {scales[joint]:.2f} times as thick as the template's; people "
            f"have {_LEAST_GIRTH} to {_LARGEST_GIRTH}",
            where=where,
            remedy=_REMEDY,
        )


def _mm(length_m: float) -> str:
    return f"{1e3 * length_m:.0f}"
