"""How large a person is against the template: settled once, in the frames that are searched, before all else.

A template of the wrong size finds a pose in almost any limb: a grown-up's elbow is laid in a child's wrist. So the
limb is looked for at the template's own size first. Where that does not explain the cloud well, even with the
proportions fitted to this one frame, it is looked for at other sizes, too, and the size that explains the cloud best
goes on. Nothing else of the proportions does, since one frame tells little of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from adapt.fit.shape import fit_shape
from adapt.match.correspondences import Target
from adapt.match.skin_sample import sample_skin
from adapt.model.body import Body
from adapt.model.shape.population import ANYBODY, Person
from adapt.model.shape.prior import overall_size
from adapt.model.size import resized
from adapt.search.first_pose import is_sound, try_pose
from adapt.search.pose_score import ScoredPose
from capture.errors import FitError

OTHER_SIZES = (0.62, 0.8, 1.2)  # with the template's own: each step is within what the fit to one frame bridges
_VERTICES, _UPDATES = 600, 5
_WELL_M = 0.006  # skin this near to the cloud needs no other size
_CLEARLY = 0.7  # another size must explain the cloud better by this factor
_LEFT_TO_THE_FIT = 0.12  # a body that differs by less is found by the fit from the template as it is


@dataclass(frozen=True)
class SizedPose:
    """The template as large as the person, and its pose in one cloud."""

    body: Body = field(repr=False)
    pose: ScoredPose


def settle_size(
    body: Body, target: Target, search: Callable[[Body, float], ScoredPose], person: Person = ANYBODY
) -> SizedPose:
    """The overall size of the limb in one cloud, and the limb's pose at that size.

    ``search`` finds a pose of the body it is given, which is ``body``, the template as large as the ``person`` is said
    to be, at the size (1 first) named with it.

    Raises:
        FitError: the search finds nothing at any size.
    """
    found: list[SizedPose] = []
    searched: dict[float, ScoredPose] = {}
    problem: FitError | None = None
    for size in (1.0, *OTHER_SIZES):
        try:
            searched[size] = search(resized(body, size), size)
            found.append(_grown(target, resized(body, size), searched[size], person))
        except FitError as error:
            problem = problem or error
            continue
        if size == 1.0 and _needs_no_other(found[0], body):
            break
    if not found:
        raise problem or FitError("no size of the anatomy fits the cloud", remedy="narrow the region of interest")
    best = min(found, key=lambda one: one.pose.cost_m * (1.0 if one is found[0] else 1.0 / _CLEARLY))
    if 1.0 in searched and abs(_against(body, best.body) - 1.0) < _LEFT_TO_THE_FIT:
        return SizedPose(body, searched[1.0])  # proportions fitted to one frame may have turned a forearm over
    return _whole(body, target, best)


def _against(body: Body, other: Body) -> float:
    """How many times as large the other body is."""
    return overall_size(other) / overall_size(body)


def _needs_no_other(found: SizedPose, body: Body) -> bool:
    """Whether the cloud is well explained at about the body's size: a size that the fit had to find is in doubt."""
    near = abs(_against(body, found.body) - 1.0) < _LEFT_TO_THE_FIT
    return near and found.pose.skin_m < _WELL_M and is_sound(found.pose)


def _grown(target: Target, start: Body, pose: ScoredPose, person: Person) -> SizedPose:
    """The body with shape and pose fitted to one cloud; as it was where the fit leads nowhere."""
    sample = sample_skin(start.anatomy, at_most=_VERTICES)
    try:
        fitted = fit_shape(start, [target], pose.fit.theta[None], sample, person=person, updates=_UPDATES)
    except FitError:
        return SizedPose(start, pose)
    better = try_pose(fitted.body, target, sample, fitted.thetas[0])
    if better is None or better.cost_m > pose.cost_m:
        return SizedPose(start, pose)
    return SizedPose(fitted.body, better)


def _whole(body: Body, target: Target, best: SizedPose) -> SizedPose:
    """The same with the template's proportions."""
    size = _against(body, best.body)
    whole = body if abs(size - 1.0) < _LEFT_TO_THE_FIT else resized(body, size)
    pose = try_pose(whole, target, sample_skin(body.anatomy, at_most=2000), best.pose.fit.theta)
    return SizedPose(whole, pose or best.pose)
