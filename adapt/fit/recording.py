"""From a recording to a subject, without a hand on it: first poses, example poses, algorithm 4.

Every automatic choice can be overridden: the frames to adapt to, and their first poses.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.fit.alternate import Adaptation, Progress, adapt_body
from adapt.fit.correspondences import Target
from adapt.fit.examples import choose_examples, landmarks_shown
from adapt.fit.found import FoundPoses
from adapt.fit.judge import ADAPTED, judge_fit
from adapt.fit.never_seen import NeverSeen, never_seen, without
from adapt.fit.other_limb import on_its_side, refuse_two_limbs
from adapt.fit.overall_size import SizedPose, settle_size
from adapt.fit.plausible_sizes import refuse_what_nobody_is
from adapt.fit.pose import PoseFit, fit_pose
from adapt.fit.priors import overall_size
from adapt.fit.rival_side import SideEvidence, compare_sides, refuse_neither_side, refuse_the_other_side
from adapt.fit.sample import SkinSample, sample_skin, weighted_by_tissue
from adapt.fit.score import ScoredPose, score_pose
from adapt.fit.shape import fit_shape
from adapt.fit.start import locate, try_pose, variations
from adapt.model.body import Body, make_body
from adapt.subject import Subject
from capture.cloud.fuse import Region, fuse
from capture.errors import BonetrackError, CloudError, FitError
from capture.journal import Journal
from capture.recording import Instant, Recording, instants, refuse_useless_depth
from capture.settings import recording_used, region_used, sensors_used, versions

FEWEST_POSES = 4
MOST_POSES = 8
DEFAULT_POSES = 6
_CANDIDATES = 12  # frames looked at when choosing example poses
_SEARCHED = 2  # frames in which the limb is searched for; the others start from their neighbours
_CLEARLY = 1.3  # a candidate that explains the skin worse than the others by this factor is in a wrong pose
_TOLERABLE_M = 0.02  # a candidate that explains the skin worse than this is not adapted to


@dataclass(frozen=True)
class _Candidate:
    instant: Instant
    target: Target = field(repr=False)
    pose: ScoredPose = field(repr=False)
    beside: bool = False  # whether it lies on its side of another limb in sight


def adapt_recording(
    recording: Recording,
    anatomy: Anatomy,
    *,
    poses: int = DEFAULT_POSES,
    frames: Sequence[int] | None = None,
    first_poses: Mapping[int, Floats] | None = None,
    region: Region | None = None,
    journal: Journal | None = None,
    progress: Progress = lambda _: None,
) -> Subject:
    """Adapt an anatomy to the person in a recording.

    Args:
        recording: calibrated, or of a single sensor.
        anatomy: the template limb.
        poses: how many example poses to choose (4 to 8).
        frames: indices of instants to adapt to, instead of the automatic choice.
        first_poses: theta (n,) by index of instant, instead of the automatic search; these instants are looked at.
        region: where the limb is, instead of the automatic region of interest.
        journal: what an earlier run with the same arguments found, and where what is found is written.
        progress: told in words what is being done.

    Raises:
        FitError: fewer usable poses than asked for, or there is no such frame.
        CloudError, RecordingError, CalibrationError: see ``fuse``.
    """
    refuse_useless_depth(recording)
    moments = instants(recording)
    known = dict(first_poses or {})
    wanted = _wanted(recording, moments, poses, frames, known)
    body = make_body(anatomy)
    body, candidates = _pose_candidates(recording, body, moments, wanted, known, region, FoundPoses(journal), progress)
    refuse_what_nobody_is(body, recording.path)
    sample = sample_skin(anatomy, at_most=2000)
    usable, doubted = _plausible(candidates)
    needed = max(poses if frames is None else FEWEST_POSES, FEWEST_POSES)
    if len(usable) < needed:
        raise FitError(
            f"{len(usable)} usable poses of {len(wanted)} looked at, {needed} needed{_told(doubted)}",
            where=recording.path,
            remedy="record more poses, narrow the region, or give first poses",
        )
    others: list[_Candidate] = []
    lost = never_seen(body, [(c.target, c.pose.fit.theta) for c in usable], sample)
    sample = without(sample, lost.skin)
    if frames is None:
        progress("choosing example poses")
        body, usable, others, again = _choose(body, usable, sample, poses)
        doubted |= again
    if not known:
        usable, others = ([_on_its_side(body, one, sample) for one in some] for some in (usable, others))
    side = _asked_side(body, usable, lost, recording, sample, progress, chosen=bool(known))
    adaptation, usable, left_out = _adapted(body, usable, others, lost, side, recording, progress)
    refuse_what_nobody_is(adaptation.body, recording.path)
    settings = {
        "versions": versions(),
        **recording_used(recording),
        **region_used(recording, region),
        "example_poses": poses if frames is None else len(usable),
        **sensors_used(recording),
        "frames_given": None if frames is None else sorted(set(frames)),
        "first_poses_given": sorted(known),
    }
    subject = _subject(adaptation, usable, settings, side, lost, doubted | left_out)
    return replace(subject, report=subject.report | lost.report(anatomy))


def _asked_side(
    body: Body,
    used: list[_Candidate],
    lost: NeverSeen,
    recording: Recording,
    sample: SkinSample,
    progress: Progress,
    *,
    chosen: bool,
) -> SideEvidence | None:
    """How well the example poses tell the asked side's limb from the other's, and from a second limb in sight.

    Which of two limbs is meant is only asked where nobody has ``chosen`` it by a first pose.
    """
    progress("which side, and which limb")
    targets, thetas = [c.target for c in used], np.array([c.pose.fit.theta for c in used])
    scale = overall_size(body)
    side = compare_sides(body.anatomy, targets, thetas, scale=scale, gone=lost.skin)
    side = None if side is None else replace(side, beside=sum(c.beside for c in used))
    try:
        if not chosen:
            refuse_two_limbs(body, targets, thetas, side, sample, scale=scale)
    except FitError as error:
        raise FitError(error.problem, where=recording.path, remedy=error.remedy) from error
    refuse_neither_side(side, body.anatomy, targets, where=recording.path)
    refuse_the_other_side(side, body.anatomy, where=recording.path)
    return side


def _on_its_side(body: Body, candidate: _Candidate, sample: SkinSample) -> _Candidate:
    """The candidate, posed in the leg on the asked side where both of a person's are in sight."""
    pose, beside = on_its_side(body, candidate.target, candidate.pose, sample)
    return replace(candidate, pose=pose, beside=beside)


def _adapted(
    body: Body,
    used: list[_Candidate],
    others: list[_Candidate],
    lost: NeverSeen,
    side: SideEvidence | None,
    recording: Recording,
    progress: Progress,
) -> tuple[Adaptation, list[_Candidate], dict[float, str]]:
    """Algorithm 4, the poses it rests on, and by their times those that failed the judge; without these it is redone.

    Raises:
        FitError: fewer than FEWEST_POSES poses pass.
    """
    targets, thetas = [c.target for c in used], np.array([c.pose.fit.theta for c in used])
    unseen = [(c.target, c.pose.fit.theta) for c in others]
    apart_m = 0.0 if side is None else side.asked_m
    adaptation = adapt_body(
        body, targets, thetas, unseen=unseen, gone=lost.skin, by_proportions_m=apart_m, progress=progress
    )
    whole = without(sample_skin(body.anatomy), lost.skin)
    judged = [judge_fit(adaptation.body, *pose, whole, ADAPTED) for pose in zip(targets, adaptation.fits, strict=True)]
    failed = {c.instant.time_s: judgement.reason for c, judgement in zip(used, judged, strict=True) if judgement.reason}
    if not failed:
        return adaptation, used, {}
    kept = [c for c in used if c.instant.time_s not in failed]
    if len(kept) < FEWEST_POSES:
        raise FitError(
            f"the adapted body fits {len(kept)} of {len(used)} example poses, {FEWEST_POSES} needed{_told(failed)}",
            where=recording.path,
            remedy="is it the person, with the region, the unit and the focal length right? Choose other frames, "
            "or give first poses",
        )
    adaptation, kept, further = _adapted(body, kept, others, lost, side, recording, progress)
    return adaptation, kept, failed | further


def _told(doubted: Mapping[float, str]) -> str:
    """The first few frames that are not believed, and why."""
    told = [f"at {time_s:.2f} s {reason}" for time_s, reason in sorted(doubted.items())[:3]]
    return f": {'; '.join(told)}" if told else ""


def _plausible(candidates: list[_Candidate]) -> tuple[list[_Candidate], dict[float, str]]:
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


def _choose(
    body: Body, candidates: list[_Candidate], sample: SkinSample, poses: int
) -> tuple[Body, list[_Candidate], list[_Candidate], dict[float, str]]:
    """A first shape, the example poses chosen with it, the usable candidates not chosen, and why others are not usable.

    The first shape is fitted to poses chosen with the template; every candidate is then posed again with it, the
    doubtful ones also from their neighbours' poses, and those that still fit worse than the rest are left out.
    """
    chosen = choose_examples(body, [c.pose.fit for c in candidates], sample, poses)
    thetas = np.array([candidates[k].pose.fit.theta for k in chosen])
    bony = weighted_by_tissue(sample, body.anatomy)
    first = fit_shape(body, [candidates[k].target for k in chosen], thetas, bony)
    again: list[_Candidate] = []
    for k, candidate in enumerate(candidates):  # a thin forearm may lie turned over: ask its neighbours, too
        starts = [candidate, *again[-1:], *candidates[k + 1 : k + 2]]
        again.append(_posed_again(first.body, candidate, starts, sample))
    doubtful = {id(c) for c in again} - {id(c) for c in _plausible(again)[0]}
    for k, candidate in enumerate(again):
        if id(candidate) in doubtful:
            again[k] = _posed_again(first.body, candidate, again[max(0, k - 1) : k + 2], sample)
    kept, doubted = _plausible(again)
    kept, doubted = (kept, doubted) if len(kept) >= poses else (again, {})
    chosen = choose_examples(first.body, [c.pose.fit for c in kept], sample, poses)
    left = [c for k, c in enumerate(kept) if k not in set(chosen)]
    return first.body, [kept[k] for k in sorted(chosen)], left, doubted


def _posed_again(body: Body, candidate: _Candidate, starts: list[_Candidate], sample: SkinSample) -> _Candidate:
    """The candidate in the best pose reached from the given candidates' poses; as it was, if none is reached."""
    tried = [try_pose(body, candidate.target, sample, start.pose.fit.theta) for start in starts]
    found = [pose for pose in tried if pose is not None]
    if not found:
        return candidate
    return replace(candidate, pose=min(found, key=lambda pose: pose.badness_m))


def _wanted(
    recording: Recording, moments: list[Instant], poses: int, frames: Sequence[int] | None, given: Iterable[int]
) -> list[int]:
    """Indices of the instants to look at: the ``frames``, or some of all, and those whose first pose is ``given``."""
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


def _pose_candidates(
    recording: Recording,
    body: Body,
    moments: list[Instant],
    wanted: list[int],
    first_poses: Mapping[int, Floats],
    region: Region | None,
    found: FoundPoses,
    progress: Progress,
) -> tuple[Body, list[_Candidate]]:
    """The body as large as the person, and a first pose for every wanted instant that shows the limb.

    A few frames are searched; from the one that fits best, poses are carried to its neighbours in time, and on.
    """
    sample = sample_skin(body.anatomy, at_most=2000)
    targets: dict[int, Target] = {}
    problem: BonetrackError | None = None
    for k in wanted:
        try:
            targets[k] = Target(fuse(recording, moments[k], region=region))
        except CloudError as error:
            problem = error
    posed: dict[int, ScoredPose] = {}
    body, others = _outwards(list(targets), body, targets, sample, first_poses, posed, found, progress)
    for number, k in enumerate(others):
        progress(f"first pose {number + 1} of {len(targets)}")
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
    return body, [_Candidate(moments[k], targets[k], posed[k]) for k in sorted(posed)]


def _outwards(
    frames: list[int],
    body: Body,
    targets: Mapping[int, Target],
    sample: SkinSample,
    first_poses: Mapping[int, Floats],
    posed: dict[int, ScoredPose],
    found: FoundPoses,
    progress: Progress,
) -> tuple[Body, list[int]]:
    """The body at the size of the person; the frames still to be posed, in order.

    A few frames are searched, and the best one's pose put into ``posed``; the other frames follow, nearest first.
    """
    given = [k for k in frames if k in first_poses]
    sized: dict[int, SizedPose] = {}
    for number, k in enumerate(given[:1] or frames[:: max(1, len(frames) // _SEARCHED)][:_SEARCHED]):
        progress(f"searching the limb in frame {number + 1} of {_SEARCHED}")

        def search(body: Body, size: float, k: int = k) -> ScoredPose:
            if k in first_poses:
                return _given(body, targets[k], sample, first_poses[k])
            name = f"limb in frame {k}" if size == 1.0 else f"limb in frame {k} at size {size}"
            return found.find(name, partial(locate, body, targets[k], sample, []))

        try:
            sized[k] = settle_size(body, targets[k], search)
        except FitError:
            continue
    seed = min(sized, key=lambda k: sized[k].pose.badness_m, default=None)
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


def _scales(adaptation: Adaptation) -> dict[str, dict[str, float]]:
    """How large the body is at each joint against the template, with one standard deviation."""
    deviations = np.sqrt(np.diag(adaptation.covariance))[: len(adaptation.body.shape) : 4]
    return {
        joint: {"scale": float(scale), "sd": float(deviation)}
        for joint, scale, deviation in zip(
            adaptation.body.affine.groups, adaptation.body.shape[::4], deviations, strict=True
        )
    }


def _subject(
    adaptation: Adaptation,
    used: list[_Candidate],
    settings: dict[str, Any],
    side: SideEvidence | None,
    lost: NeverSeen,
    left_out: Mapping[float, str],
) -> Subject:
    body = adaptation.body
    sample = without(sample_skin(body.anatomy), lost.skin)
    shown = landmarks_shown(body, adaptation.fits, sample)
    report = {
        "poses": [_pose_report(body, *pose, sample) for pose in zip(used, adaptation.fits, strict=True)],
        "left_out": [{"time_s": time_s, "reason": reason} for time_s, reason in sorted(left_out.items())],
        "side": None if side is None else {**asdict(side), "support_nats": side.support, "told": side.told},
        "noise_mm": 1e3 * adaptation.noise_m,
        "unseen_noise_mm": None if adaptation.unseen_noise_m is None else 1e3 * adaptation.unseen_noise_m,
        "scales": _scales(adaptation),
        "landmarks_shown": shown,
        "landmarks_never_shown": [name for name, count in shown.items() if count == 0],
        "settings": settings,
    }
    times = np.array([candidate.instant.time_s for candidate in used])
    return Subject(body, adaptation.thetas, times, adaptation.covariance, report)


def _pose_report(body: Body, candidate: _Candidate, fit: PoseFit, sample: SkinSample) -> dict[str, float]:
    judged = judge_fit(body, candidate.target, fit, sample, ADAPTED)
    return {
        "time_s": candidate.instant.time_s,
        "matches": len(fit.matches),
        "median_distance_mm": 1e3 * fit.residual_m,
        "skin_to_cloud_mm": 1e3 * judged.found.whole.skin_m,
        "coverage": judged.found.whole.coverage,
        "unexplained": judged.unexplained,
    }
