"""A second limb that could be meant: another arm in the same cloud, of the same person or of somebody else.

What the fitted limb does not explain is searched as if it were alone. Where a limb of the same anatomy fits that, too,
which of the two is meant is not for the program to choose: they are told apart by their side, or asked about.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from adapt.anatomy import Floats
from adapt.fit.judge import ADAPTED, judge_fit, shows, unexplained_points
from adapt.match.correspondences import Target
from adapt.match.skin_sample import SkinSample
from adapt.model.body import Body, pose_skin
from adapt.own_anatomy import other_side_asked
from adapt.search.first_pose import find_pose, try_pose
from adapt.search.own_side import keeps_to_its_side, lies_on_its_side
from adapt.search.pose_score import ScoredPose, find_skin
from adapt.search.rival_side import TOLD, SideEvidence, compare_sides
from capture.cloud.fuse import Cloud
from capture.errors import FitError

_WORTH_A_SEARCH = 0.4  # of the points that the limb explains, as many must be left for a second one
_LEAST_IN_SIGHT = 0.25  # of a second limb's skin: less of one is a shape like others
_MOST_MERGED, _MOST_FREE = 0.4, 0.15  # as of any pose found anew: laid on other surface, or in empty space
_LEAST_BONES = 2
_MOST_WORSE = 2.0  # times farther from the cloud than the fitted limb's skin: what fits worse is something else
_MOST_UNEXPLAINED = 0.5  # of the cloud near a second limb: more goes on than it explains
_ALIKE = 1.5  # a second limb of the other side fits that side about as well as the fitted one fits its own


def other_limb(
    body: Body, target: Target, theta: Floats, sample: SkinSample, *, most_worse: float = _MOST_WORSE
) -> tuple[Target, ScoredPose] | None:
    """What a limb at ``theta`` (n,) leaves of a cloud, and a second one found there; None where there is none.

    The second one's skin is at most ``most_worse`` times as far from the cloud as the first one's.
    """
    left = unexplained_points(body, target, theta)
    if left.sum() < _WORTH_A_SEARCH * (~left).sum():
        return None
    rest = Target(_only(target.cloud, left))
    try:
        found = find_pose(body, rest)
    except FitError:
        return None
    pose = try_pose(body, rest, sample, found.fit.theta) or found
    skin = judge_fit(body, rest, pose.fit, sample, ADAPTED)
    first = find_skin(body, target, theta, sample).whole
    bones = sum(shows(part) for part in skin.found.bones.values())
    sound = pose.merged_outline < _MOST_MERGED and pose.free_space < _MOST_FREE and bones >= _LEAST_BONES
    whole = skin.found.whole
    sound &= whole.skin_m < most_worse * first.skin_m and skin.unexplained < _MOST_UNEXPLAINED
    return (rest, pose) if sound and not skin.reason and whole.in_sight > _LEAST_IN_SIGHT else None


def on_its_side(body: Body, target: Target, pose: ScoredPose, sample: SkinSample) -> tuple[ScoredPose, Floats | None]:
    """The pose of a leg, or of the other one in the same cloud where that lies on the asked side; and the other's (n,).

    The other's is None where nothing is told: of limbs that do not keep to their side, and of one alone.
    """
    if not keeps_to_its_side(body.anatomy):
        return pose, None
    second = other_limb(body, target, pose.fit.theta, sample)
    on_side = None if second is None else lies_on_its_side(body, pose.fit.theta, second[1].fit.theta)
    if second is None or on_side is None:
        return pose, None
    if on_side:
        return pose, second[1].fit.theta
    swapped = try_pose(body, target, sample, second[1].fit.theta)
    return (pose, None) if swapped is None else (swapped, pose.fit.theta)


def limbs_that_could_be_meant(
    body: Body, target: Target, theta: Floats, sample: SkinSample, *, most_worse: float
) -> tuple[str, str] | None:
    """Where the limb at ``theta`` (n,) is and where a second one like it, in words; None where there is none."""
    second = other_limb(body, target, theta, sample, most_worse=most_worse)
    if second is None or _told_by_place(body, theta, second[1].fit.theta):
        return None
    return (_said(_middle(body, theta)), _said(_middle(body, second[1].fit.theta)))


def refuse_two_limbs(
    body: Body,
    targets: Sequence[Target],
    thetas: Floats,
    side: SideEvidence | None,
    sample: SkinSample,
    *,
    scale: float,
) -> None:
    """Look for a second limb in that of K clouds of which the fitted limb leaves the most.

    Raises:
        FitError: there is one, and its side does not tell which of the two is meant.
    """
    left = [int(unexplained_points(body, target, theta).sum()) for target, theta in zip(targets, thetas, strict=True)]
    k = int(np.argmax(left))
    second = other_limb(body, targets[k], thetas[k], sample)
    if second is None:
        return
    rest, pose = second
    if _told_by_place(body, thetas[k], pose.fit.theta):
        return
    if side is not None and side.told:
        theirs = compare_sides(body.anatomy, [rest], pose.fit.theta[None], scale=scale)
        if theirs is not None and theirs.support < -TOLD and theirs.other_m < _ALIKE * side.asked_m:
            return  # the other limb is of the other side
    places = [_middle(body, theta) for theta in (thetas[k], pose.fit.theta)]
    by_side = "" if body.anatomy.side == "both" else f"with {other_side_asked(body.anatomy)}, "
    raise FitError(
        f"two limbs could be meant, at {_said(places[0])} and at {_said(places[1])} m",
        remedy=f"say which with `--near X Y Z` or a region, {by_side}"
        "or, where both go through the same places, with first poses of the one that is meant",
    )


def _told_by_place(body: Body, theta: Floats, other: Floats) -> bool:
    """Whether the limb at ``theta`` (n,) is told from the ``other`` by lying on its side of it."""
    return keeps_to_its_side(body.anatomy) and lies_on_its_side(body, theta, other) is True


def _only(cloud: Cloud, chosen: np.ndarray) -> Cloud:
    """Some points of a cloud; the views stay, so that what else was there still hides and is still seen past."""
    parts = {name: getattr(cloud, name)[chosen] for name in ("points", "normals", "boundary", "sensor")}
    return replace(cloud, **parts)


def _middle(body: Body, theta: Floats) -> Floats:
    """The middle (3,) m of the posed skin that counts in fitting."""
    return np.average(pose_skin(body, theta), axis=0, weights=body.anatomy.fit_weight)


def _said(point: Floats) -> str:
    return " ".join(f"{value:.2f}" for value in point)
