"""The rival hypothesis: would the other side's limb explain the same clouds better?

A right arm and a left one have the same sizes and bend the same way; what tells them apart is small (where the thumb
is, how the forearm's bones lie), and a fit of the wrong side looks good in every figure of its own. So the mirror image
of the anatomy is fitted to the same example poses, both sides alike: from the same proportions, with the same soft
tissue free. The patches of skin of each then disagree with the clouds by a standard deviation; with N distinct patches
seen, N log(other / asked) is how much likelier (nats) the asked side makes what was seen, its own priors added.
Patches are counted once for all poses: where a template is wrong it is wrong in every pose.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from adapt.anatomy import Anatomy, Floats
from adapt.fit.never_seen import Bools, without
from adapt.fit.noise import patch_misfit
from adapt.fit.shape import ShapeFit, fit_shape
from adapt.match.bending_skin import bend_trust
from adapt.match.correspondences import Target
from adapt.match.skin_sample import SkinSample, sample_skin, weighted_by_tissue
from adapt.match.visibility import depth_of
from adapt.mirror import mirrored_body, mirrored_name
from adapt.model.body import Body, make_body, pose_skin
from adapt.model.pose_space import joint_coordinates, moved_rigidly
from adapt.model.shape.population import ANYBODY, Person
from adapt.model.shape.prior import shape_prior
from adapt.model.size import resized
from adapt.own_anatomy import other_side_asked
from adapt.search.first_pose import try_pose
from adapt.search.pose_score import skin_apart
from capture.errors import FitError
from capture.rigid import exp_so3

_SAMPLED_VERTICES = 2000
_COARSE_VERTICES = 300
_SWEEP = 5  # values tried of each joint coordinate over its range
_TRIED = 3  # starts refined of each pose
_UPDATES = 6
_GATE_M = 0.02
_MOST_M = 0.01  # a part that goes astray counts as this far off, however far it is

_MOST_APART_M = 0.0028
"""Patches of bare skin lie within 1.8 mm of what sensors see up to _NEAR_M away, wrong fits 3.3 mm: 1.6 and 3 mm where
tissue was taken to vary twice as much, times what that change did to a leg measured with both."""
_NEAR_M = 2.2

_CLEARLY = 0.93  # the other side's skin must also lie nearer to the clouds by this factor, likely proportions or not
_BESIDE_NATS, _MOST_BESIDE_NATS = 3.0, 12.0  # a step crosses over in fewer than one pose of twenty; steps repeat

TOLD = 20.0
"""Support (nats) from which on a side is told. What an upper arm alone says of its side stays below; the limbs of the
thresholds' half of the situations in docs/field-trials.md lie at 129 and more."""


@dataclass(frozen=True)
class SideEvidence:
    """How well the asked side and the other one explain the same clouds.

    ``asked_m`` and ``other_m`` are the standard deviations (m) of patches of skin from the clouds, ``patches`` how many
    distinct ones were seen, ``prior`` how much likelier (nats) the asked side's proportions are than the other's,
    ``beside`` in how many poses the limb lies on its side of another one in sight (``own_side``).
    """

    asked_m: float
    other_m: float
    patches: int
    prior: float
    beside: int = 0

    @property
    def support(self) -> float:
        """How much likelier (nats) the asked side makes what was seen; negative where the other side does."""
        placed = min(_BESIDE_NATS * self.beside, _MOST_BESIDE_NATS)
        return float(self.patches * np.log(self.other_m / self.asked_m) + self.prior + placed)

    @property
    def told(self) -> bool:
        """Whether the data tell that it is the asked side."""
        return self.support > TOLD


def refuse_the_other_side(evidence: SideEvidence | None, anatomy: Anatomy, *, where: Path) -> None:
    """Raise FitError where the other side explains the clouds clearly better than the one that was asked for."""
    if evidence is None or evidence.support > -TOLD or evidence.other_m > _CLEARLY * evidence.asked_m:
        return
    other = mirrored_name(anatomy.name)
    raise FitError(
        f"what was seen is clearly nearer to {other} ({1e3 * evidence.other_m:.1f} mm off) than to {anatomy.name} "
        f"({1e3 * evidence.asked_m:.1f} mm)",
        where=where,
        remedy=f"ask for {other_side_asked(anatomy)}; if the sensors' driver mirrors its images, "
        "`bonetrack import --mirrored`",
    )


def refuse_neither_side(
    evidence: SideEvidence | None, anatomy: Anatomy, targets: Sequence[Target], *, where: Path
) -> None:
    """Raise FitError where not even the nearer side lies on the K clouds as a limb does whose proportions are fitted.

    Every patch may be off by 2.8 mm, beyond 2.2 m from the sensors by more, as their noise grows.
    """
    if evidence is None:
        return
    most_m, apart_m = _MOST_APART_M * _noisier(targets), min(evidence.asked_m, evidence.other_m)
    if apart_m <= most_m:
        return
    raise FitError(
        f"neither {anatomy.name} nor its mirror image, in the poses found, lies on what was seen: the skin is "
        f"{1e3 * apart_m:.1f} mm off, patch by patch, and a limb's at most {1e3 * most_m:.1f} mm",
        where=where,
        remedy=f"is it {other_side_asked(anatomy)}? Is somebody or something else beside the limb, or over it? Say "
        "where the limb alone is with `--near X Y Z` or `--region X0 Y0 Z0 X1 Y1 Z1`; check unit and focal length",
    )


def _noisier(targets: Sequence[Target]) -> float:
    """How many times noisier the K clouds are, by their distance from the sensors, than near ones."""
    depths = [depth_of(view, target.cloud.points[index]) for target in targets for view, index, _ in target.parts]
    return max(1.0, (float(np.median(np.concatenate(depths))) / _NEAR_M) ** 2)


def compare_sides(
    anatomy: Anatomy,
    targets: Sequence[Target],
    thetas: Floats,
    *,
    scale: float,
    gone: Bools | None = None,
    person: Person = ANYBODY,
) -> SideEvidence | None:
    """Fit an anatomy and its mirror image to K clouds, near the poses (K, n) of a body of that ``scale``.

    ``gone`` (V,) is skin that takes no part; ``person`` is what is said of whose limb it is. None where
    either side fits nowhere, and of a body that has both sides.
    """
    if anatomy.side == "both":
        return None
    asked = resized(make_body(anatomy), scale)  # neither side begins with what the other made of the clouds
    other = mirrored_body(asked)
    gone = np.zeros(len(anatomy.skin_vertices), dtype=bool) if gone is None else gone
    sample = without(sample_skin(anatomy, at_most=_SAMPLED_VERTICES), gone)
    mirrored_sample = without(sample_skin(other.anatomy, at_most=_SAMPLED_VERTICES), gone)
    laid = [_pose_of_other(asked, other, *pose, mirrored_sample) for pose in zip(targets, thetas, strict=True)]
    poses = [
        (target, theta, rival) for target, theta, rival in zip(targets, thetas, laid, strict=True) if rival is not None
    ]
    if not poses:
        return None
    clouds = [target for target, _, _ in poses]
    try:
        one = _fit(asked, clouds, np.array([theta for _, theta, _ in poses]), sample, person)
        two = _fit(other, clouds, np.array([rival for _, _, rival in poses]), mirrored_sample, person)
        asked_m, patches = _misfit(one, clouds, sample)
        other_m, _ = _misfit(two, clouds, mirrored_sample)
    except FitError:
        return None
    return SideEvidence(asked_m, other_m, patches, _improbability(two, person) - _improbability(one, person))


def _fit(body: Body, targets: list[Target], thetas: Floats, sample: SkinSample, person: Person) -> ShapeFit:
    return fit_shape(body, targets, thetas, weighted_by_tissue(sample, body.anatomy), person=person, updates=_UPDATES)


def _misfit(fitted: ShapeFit, targets: list[Target], sample: SkinSample) -> tuple[float, int]:
    """How far (m) patches of a fitted body are from K clouds, and how many were seen."""
    body, poses = fitted.body, zip(targets, fitted.thetas, strict=True)
    apart = [skin_apart(body, target, theta, sample, gate_m=_GATE_M) for target, theta in poses]
    trust = np.array([bend_trust(body, theta) for theta in fitted.thetas])
    return patch_misfit(body.anatomy, np.clip(apart, -_MOST_M, _MOST_M), trust, sample)


def _improbability(fitted: ShapeFit, person: Person) -> float:
    """Minus the logarithm of the prior (nats) of a body's proportions."""
    prior = shape_prior(fitted.body.anatomy, fitted.body.affine, person)
    away = fitted.body.shape - prior.mean
    return 0.5 * float(away @ prior.precision @ away)


def _pose_of_other(body: Body, other: Body, target: Target, theta: Floats, sample: SkinSample) -> Floats | None:
    """The best pose (n,) of the other side's limb in one cloud, from laying it upon the asked side's, pose by pose."""
    skin = pose_skin(body, theta)
    laid = [pose for form in _forms_near(other.anatomy, theta) for pose in _laid_upon(other, form, skin)]
    laid.sort(key=lambda pose: pose[0])
    tried = [try_pose(other, target, sample, start) for _, start in laid[:_TRIED]]
    best = min((pose for pose in tried if pose is not None), key=lambda pose: pose.cost_m, default=None)
    return None if best is None else best.fit.theta


def _forms_near(anatomy: Anatomy, theta: Floats) -> list[Floats]:
    """The pose (n,) and the same with each joint coordinate swept over its range."""
    forms = [theta]
    for i in joint_coordinates(anatomy):
        for value in np.linspace(anatomy.coordinates[i].low, anatomy.coordinates[i].high, _SWEEP):
            forms.append(np.r_[theta[:i], value, theta[i + 1 :]])
    return forms


def _laid_upon(other: Body, theta: Floats, skin: Floats) -> list[tuple[float, Floats]]:
    """The form of a pose (n,) laid upon a posed skin (V, 3): how far (m) it is from it, and the pose so moved.

    Vertex lies by vertex as well as a limb can lie on its mirror image: reflected in its flattest plane; and once
    more turned about its length by half a turn.
    """
    chosen = np.linspace(0, len(skin) - 1, _COARSE_VERTICES).astype(int)
    form, onto = pose_skin(other, theta)[chosen], skin[chosen]
    tree = cKDTree(skin)
    middle_form, middle = form.mean(axis=0), onto.mean(axis=0)
    turn = Rotation.align_vectors(onto - middle, form - middle_form)[0].as_matrix()
    length = np.linalg.svd(onto - middle, full_matrices=False)[2][0]
    laid = []
    for rotation in (turn, exp_so3(np.pi * length) @ turn):
        move = np.eye(4)
        move[:3, :3], move[:3, 3] = rotation, middle - rotation @ middle_form
        laid.append(
            (float(tree.query(form @ rotation.T + move[:3, 3])[0].mean()), moved_rigidly(other.anatomy, theta, move))
        )
    return laid
