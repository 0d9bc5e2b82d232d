"""The one judge of a fit: absolute bounds, in both directions, for adapt, track, the viewer's Fit and batch alike.

From skin to cloud: of the skin in sight enough must be found, near enough. From cloud to skin: points near the limb
that no skin explains are counted; they tell of a second limb, a held wrist, a wall that the limb lies on. A fit that
is merely as good as the other frames' is not thereby right: on the wrong thing all of them are alike.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Floats
from adapt.fit.pose import PoseFit
from adapt.match.correspondences import Target
from adapt.match.point_grid import PointGrid
from adapt.match.skin_sample import SkinSample
from adapt.model.body import Body, pose_skin
from adapt.search.pose_score import FoundPart, FoundSkin, find_skin

LEAST_IN_SIGHT = 0.1  # of a bone's skin; a limb seen from one side shows some 0.4 of it, one that points at it 0.15
EXPLAINED_M = 0.03  # a point of the cloud this near to skin is explained by it
_NEAR_M = 0.10  # points farther from all skin than this are not near the limb
_BELONGS = 0.5  # fit weight of skin below which the cut is near, where the trunk goes on
_ASKED_POINTS = 400


@dataclass(frozen=True)
class Bounds:
    """What a fit must keep to.

    Most that matched skin may be off in the median (m), most that the skin in sight may be off in the mean (m), least
    share of it that is found.
    """

    residual_m: float
    skin_m: float
    coverage: float


FOLLOWED = Bounds(residual_m=0.006, skin_m=0.011, coverage=0.75)
"""Of a frame in which a known body moves: fast motion and sleeves included."""
ADAPTED = Bounds(residual_m=0.004, skin_m=0.009, coverage=0.85)
"""Of an example pose to which the body itself was adapted."""


@dataclass(frozen=True)
class Judgement:
    """How a fit explains its cloud and is explained by it; ``reason`` says why it is not believed, or is empty.

    ``unexplained`` is the share of the cloud near the limb that no skin explains.
    """

    residual_m: float
    found: FoundSkin = field(repr=False)
    unexplained: float
    reason: str


def judge_fit(body: Body, target: Target, fit: PoseFit, sample: SkinSample, bounds: Bounds) -> Judgement:
    """Judge a fitted pose in one cloud."""
    found = find_skin(body, target, fit.theta, sample)
    return Judgement(fit.residual_m, found, unexplained_share(body, target, fit.theta), _why_not(fit, found, bounds))


def fits(part: FoundPart, bounds: Bounds = FOLLOWED) -> bool:
    """Whether the skin in sight is where the cloud is.

    >>> fits(FoundPart(in_sight=0.4, skin_m=0.005, coverage=0.8)), fits(FoundPart(0.4, 0.005, 0.8), ADAPTED)
    (True, False)
    """
    return part.coverage >= bounds.coverage and part.skin_m <= bounds.skin_m


def shows(part: FoundPart, bounds: Bounds = FOLLOWED) -> bool:
    """Whether some skin shows: enough of it is in sight, and that fits.

    >>> shows(FoundPart(in_sight=0.4, skin_m=0.005, coverage=0.8)), shows(FoundPart(0.05, 0.005, 0.8))
    (True, False)
    """
    return part.in_sight >= LEAST_IN_SIGHT and fits(part, bounds)


def unexplained_share(body: Body, target: Target, theta: Floats) -> float:
    """Of the cloud near the limb, but for where it is cut off, the share that no skin explains."""
    points = target.cloud.points
    points = points[:: max(1, len(points) // _ASKED_POINTS)]
    every = max(1, len(body.anatomy.skin_vertices) // 2000)
    distance, nearest = PointGrid(pose_skin(body, theta)[::every]).query(points, distance_upper_bound=_NEAR_M)
    near = np.isfinite(distance)
    near[near] = body.anatomy.fit_weight[::every][nearest[near]] > _BELONGS
    return float((distance[near] > EXPLAINED_M).mean()) if near.any() else 0.0


def unexplained_points(body: Body, target: Target, theta: Floats) -> NDArray[np.bool_]:
    """Which points (N,) of the cloud no skin explains, near the limb or anywhere."""
    skin = pose_skin(body, theta)
    distance, _ = PointGrid(skin[:: max(1, len(skin) // 4000)]).query(target.cloud.points, EXPLAINED_M)
    return ~np.isfinite(distance)


def _why_not(fit: PoseFit, found: FoundSkin, bounds: Bounds) -> str:
    if fit.residual_m > bounds.residual_m:
        return f"skin and cloud are {1e3 * fit.residual_m:.1f} mm apart"
    if not fits(found.whole, bounds):
        share, apart = 100 * found.whole.coverage, 1e3 * found.whole.skin_m
        return f"{share:.0f} % of the skin in sight was found, {apart:.1f} mm from the cloud"
    return ""
