"""Candidates for example poses: which frames are looked at, where the limb is in each, and which of them are used.

A few frames are searched; from the one that fits best, poses are carried to its neighbours in time, and on.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from adapt.anatomy import Floats
from adapt.fit.examples import choose_examples
from adapt.fit.pose import fit_pose
from adapt.fit.shape import fit_shape
from adapt.match.correspondences import Target
from adapt.match.skin_sample import SkinSample, sample_skin, weighted_by_tissue
from adapt.model.body import Body
from adapt.model.shape.population import ANYBODY, Person
from adapt.options import AdaptOptions
from adapt.search.first_pose import locate, try_pose, variations
from adapt.search.overall_size import SizedPose, settle_size
from adapt.search.pose_score import ScoredPose, score_pose
from adapt.search.search_journal import FoundPoses
from adapt.stages import FIRST_POSES, SEARCH, Progress
from capture.cloud.fuse import fuse
from capture.errors import BonetrackError, CloudError, FitError
from capture.recording import Instant, Recording

FEWEST_POSES = 4
MOST_POSES = 8
_CANDIDATES = 12  # frames looked at when choosing example poses
_SEARCHED = 2  # frames in which the limb is searched for; the others start from their neighbours
_CLEARLY = 1.3  # a candidate that explains the skin worse than the others by this factor is in a wrong pose
_TOLERABLE_M = 0.02  # a candidate that explains the skin worse than this is not adapted to


@dataclass(frozen=True)
class Candidate:
    """A frame that may become an example pose: its cloud, the limb's pose in it, and another limb's on its other side.

    ``beside`` (n,) is that other limb's pose, None where none was found (``one_leg``).
    """

    instant: Instant
    target: Target = field(repr=False)
    pose: ScoredPose = field(repr=False)
    beside: Floats | None = field(default=None, repr=False)


def frames_to_look_at(recording: Recording, moments: list[Instant], options: AdaptOptions) -> list[int]:
    """Indices of the instants to look at: the frames asked for, or some of all, and those whose first pose is given.

    Raises:
        FitError: too few or too many poses are asked for, too few frames, or one that is not there.
    """
    poses, frames, given = options.poses, options.frames, options.first_poses
    if not FEWEST_POSES <= poses <= MOST_POSES:
        raise FitError(f"{poses} example poses asked for", remedy=f"choose {FEWEST_POSES} to {MOST_POSES}")
    _refuse_strange_frames(recording, [*(frames or ()), *given], len(moments))
    if frames is not None:
        if len(set(frames)) < FEWEST_POSES:
            problem = f"{len(set(frames))} frames given, at least {FEWEST_POSES} needed"
            raise FitError(problem, where=recording.path, remedy="name more of them, or none to have them chosen")
        unused = sorted(set(given) - set(frames))
        if unused:
            raise FitError(
                f"frame {unused[0]} has a first pose, and is not among the frames to adapt to",
                where=recording.path,
                remedy="add it to them, or leave its first pose out",
            )
        return sorted(set(frames))
    if len(moments) < poses:
        raise FitError(
            f"{len(moments)} frames, fewer than the {poses} poses to adapt to",
            where=recording.path,
            remedy="record more poses or ask for fewer",
        )
    count = min(_CANDIDATES, len(moments))
    spread = np.linspace(0, len(moments) - 1, count).round()
    return sorted({int(k) for k in spread} | set(given))


def _refuse_strange_frames(recording: Recording, frames: Iterable[int], count: int) -> None:
    missing = [k for k in frames if not 0 <= k < count]
    if missing:
        raise FitError(f"no frame {missing[0]}", where=recording.path, remedy=f"frames run from 0 to {count - 1}")


def pose_candidates(
    recording: Recording,
    body: Body,
    moments: list[Instant],
    wanted: list[int],
    options: AdaptOptions,
    found: FoundPoses,
    progress: Progress,
) -> tuple[Body, list[Candidate]]:
    """The body as large as the person, and a first pose for every wanted instant that shows the limb.

    A few frames are searched; from the one that fits best, poses are carried to its neighbours in time, and on.
    """
    first_poses = options.first_poses
    sample = sample_skin(body.anatomy, at_most=2000)
    targets: dict[int, Target] = {}
    problem: BonetrackError | None = None
    for k in wanted:
        try:
            targets[k] = Target(fuse(recording, moments[k], region=options.region))
        except CloudError as error:
            problem = error
    posed: dict[int, ScoredPose] = {}
    body, others = _outwards(list(targets), body, targets, sample, first_poses, posed, found, progress, options.person)
    for number, k in enumerate(others):
        progress(f"first pose {number + 1} of {len(targets)}", FIRST_POSES.at(number, len(targets)))
        near = sorted(posed, key=lambda other: abs(other - k))[:1]
        starts = [start for other in near for start in variations(body.anatomy, posed[other].fit.theta)]
        if k in first_poses:
            search = partial(_given, body, targets[k], sample, first_poses[k])
        else:
            search = partial(locate, body, targets[k], sample, starts, good_m=_worst_of(posed))
        try:
            posed[k] = found.find(f"first pose of frame {k}", search)
        except FitError as error:
            problem = error
    if not posed and problem is not None:
        raise problem
    return body, [Candidate(moments[k], targets[k], posed[k]) for k in sorted(posed)]


def _outwards(
    frames: list[int],
    body: Body,
    targets: Mapping[int, Target],
    sample: SkinSample,
    first_poses: Mapping[int, Floats],
    posed: dict[int, ScoredPose],
    found: FoundPoses,
    progress: Progress,
    person: Person,
) -> tuple[Body, list[int]]:
    """The body at the size of the person; the frames still to be posed, in order.

    A few frames are searched, and the best one's pose put into ``posed``; the other frames follow, nearest first.
    """
    given = [k for k in frames if k in first_poses]
    sized: dict[int, SizedPose] = {}
    for number, k in enumerate(given[:1] or frames[:: max(1, len(frames) // _SEARCHED)][:_SEARCHED]):
        progress(f"searching the limb in frame {number + 1} of {_SEARCHED}", SEARCH.at(number, _SEARCHED))

        def search(body: Body, size: float, k: int = k) -> ScoredPose:
            if k in first_poses:
                return _given(body, targets[k], sample, first_poses[k])
            name = f"limb in frame {k}" if size == 1.0 else f"limb in frame {k} at size {size}"
            return found.find(name, partial(locate, body, targets[k], sample, []))

        try:
            sized[k] = settle_size(body, targets[k], search, person)
        except FitError:
            continue
    seed = min(sized, key=lambda k: sized[k].pose.cost_m, default=None)
    if seed is not None:
        body = sized[seed].body
    if given:
        return body, sorted(frames, key=lambda k: k not in first_poses)
    if seed is None:
        return body, frames
    posed[seed] = sized[seed].pose
    return body, sorted((k for k in frames if k != seed), key=lambda k: abs(k - seed))


def _worst_of(posed: Mapping[int, ScoredPose]) -> float:
    """What a carried pose may score (m) without a search: a little worse than those found so far."""
    return _CLEARLY * float(np.median([pose.skin_m for pose in posed.values()])) if posed else 0.0


def _given(body: Body, target: Target, sample: SkinSample, theta: Floats) -> ScoredPose:
    return score_pose(body, target, fit_pose(body, target, theta, sample), sample)


def plausible(candidates: list[Candidate]) -> tuple[list[Candidate], dict[float, str]]:
    """Candidates that explain their cloud, and about as well as the others do; and by their times why others do not."""
    typical = float(np.median([c.pose.skin_m for c in candidates]))
    kept, doubted = [], {}
    for candidate in candidates:
        apart = candidate.pose.skin_m
        if apart < min(_TOLERABLE_M, _CLEARLY * typical):
            kept.append(candidate)
        else:
            doubted[candidate.instant.time_s] = f"the skin is {1e3 * apart:.0f} mm from the cloud"
    return kept, doubted


def choose(
    body: Body, candidates: list[Candidate], sample: SkinSample, poses: int, person: Person = ANYBODY
) -> tuple[Body, list[Candidate], list[Candidate], dict[float, str]]:
    """A first shape, the example poses chosen with it, the usable candidates not chosen, and why others are not usable.

    The first shape is fitted to poses chosen with the template; every candidate is then posed again with it, the
    doubtful ones also from their neighbours' poses, and those that still fit worse than the rest are left out.
    """
    chosen = choose_examples(body, [c.pose.fit for c in candidates], sample, poses, person)
    thetas = np.array([candidates[k].pose.fit.theta for k in chosen])
    bony = weighted_by_tissue(sample, body.anatomy)
    first = fit_shape(body, [candidates[k].target for k in chosen], thetas, bony, person=person)
    again: list[Candidate] = []
    for k, candidate in enumerate(candidates):  # a thin forearm may lie turned over: ask its neighbours, too
        starts = [candidate, *again[-1:], *candidates[k + 1 : k + 2]]
        again.append(_posed_again(first.body, candidate, starts, sample))
    doubtful = {id(c) for c in again} - {id(c) for c in plausible(again)[0]}
    for k, candidate in enumerate(again):
        if id(candidate) in doubtful:
            again[k] = _posed_again(first.body, candidate, again[max(0, k - 1) : k + 2], sample)
    kept, doubted = plausible(again)
    kept, doubted = (kept, doubted) if len(kept) >= poses else (again, {})
    chosen = choose_examples(first.body, [c.pose.fit for c in kept], sample, poses, person)
    left = [c for k, c in enumerate(kept) if k not in set(chosen)]
    return first.body, [kept[k] for k in sorted(chosen)], left, doubted


def _posed_again(body: Body, candidate: Candidate, starts: list[Candidate], sample: SkinSample) -> Candidate:
    """The candidate in the best pose reached from the given candidates' poses; as it was, if none is reached."""
    tried = [try_pose(body, candidate.target, sample, start.pose.fit.theta) for start in starts]
    found = [pose for pose in tried if pose is not None]
    if not found:
        return candidate
    return replace(candidate, pose=min(found, key=lambda pose: pose.cost_m))


def told_of(doubted: Mapping[float, str]) -> str:
    """The first few frames that are not believed, and why.

    >>> told_of({2.5: "fewer than 30 points", 0.5: "the skin is 31 mm from the cloud"})
    ': at 0.50 s the skin is 31 mm from the cloud; at 2.50 s fewer than 30 points'
    >>> told_of({})
    ''
    """
    told = [f"at {time_s:.2f} s {reason}" for time_s, reason in sorted(doubted.items())[:3]]
    return f": {'; '.join(told)}" if told else ""
