"""From a recording to a subject, without a hand on it: first poses, example poses, algorithm 4.

Every automatic choice can be overridden (``adapt.options``).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from adapt.anatomy import Anatomy
from adapt.fit.alternate import Adaptation, adapt_body
from adapt.fit.examples import landmarks_shown
from adapt.fit.judge import ADAPTED, judge_fit
from adapt.fit.never_seen import NeverSeen, never_seen, without
from adapt.fit.plausible_sizes import refuse_what_nobody_is
from adapt.fit.pose import PoseFit
from adapt.fit.posterior import OF_PEOPLE, deviations
from adapt.fit.stated_person import person_report
from adapt.match.skin_sample import SkinSample, sample_skin
from adapt.model.body import Body
from adapt.model.shape.population import Person
from adapt.model.shape.prior import overall_size
from adapt.model.size import expected_body
from adapt.options import AS_USUAL, AdaptOptions
from adapt.search.candidates import (
    FEWEST_POSES,
    Candidate,
    choose,
    frames_to_look_at,
    plausible,
    pose_candidates,
    told_of,
)
from adapt.search.one_leg import on_one_leg
from adapt.search.other_limb import refuse_two_limbs
from adapt.search.own_side import keeps_to_its_side
from adapt.search.rival_side import SideEvidence, compare_sides, refuse_neither_side, refuse_the_other_side
from adapt.search.search_journal import FoundPoses
from adapt.stages import CHOICE, SIDE, Progress
from adapt.subject import WIDENED, Subject
from capture.errors import FitError
from capture.journal import Journal
from capture.recording import Recording, instants, refuse_useless_depth


def adapt_recording(
    recording: Recording,
    anatomy: Anatomy,
    options: AdaptOptions = AS_USUAL,
    *,
    journal: Journal | None = None,
    progress: Progress = lambda words, share: None,
) -> Subject:
    """Adapt an anatomy to the person in a recording.

    Args:
        recording: calibrated, or of a single sensor.
        anatomy: the template limb.
        options: what is not left to the automatic choice.
        journal: what an earlier run with the same arguments found, and where what is found is written.
        progress: told in words what is being done, and how far that is.

    Raises:
        FitError: fewer usable poses than asked for, or there is no such frame.
        CloudError, RecordingError, CalibrationError: see ``fuse``.
    """
    refuse_useless_depth(recording)
    moments = instants(recording)
    known, body = options.first_poses, expected_body(anatomy, options.person)
    wanted = frames_to_look_at(recording, moments, options)
    body, candidates = pose_candidates(recording, body, moments, wanted, options, FoundPoses(journal), progress)
    refuse_what_nobody_is(body, recording.path)
    sample = sample_skin(anatomy, at_most=2000)
    automatic = options.frames is None
    usable, doubted = _usable(candidates, options.poses if automatic else FEWEST_POSES, len(wanted), recording)
    others: list[Candidate] = []
    lost = never_seen(body, [(c.target, c.pose.fit.theta) for c in usable], sample)
    sample = without(sample, lost.skin)
    if automatic:
        progress("choosing example poses", CHOICE.begin)
        body, usable, others, again = choose(body, usable, sample, options.poses, options.person)
        doubted |= again
    if not known and keeps_to_its_side(anatomy):
        usable, others, crossed = _of_the_asked_leg(body, usable, others, sample, recording)
        doubted |= crossed
    side = _asked_side(body, usable, lost, recording, sample, progress, options.person, chosen=bool(known))
    adaptation, usable, left_out = _adapted(body, usable, others, lost, side, recording, progress, options.person)
    refuse_what_nobody_is(adaptation.body, recording.path)
    settings = options.used(recording, example_poses=len(usable))
    return _subject(adaptation, usable, settings, side, lost, doubted | left_out, options.person)


def _usable(
    candidates: list[Candidate], asked: int, looked_at: int, recording: Recording
) -> tuple[list[Candidate], dict[float, str]]:
    """The plausible candidates, and by their times why others are not; FitError if too few."""
    needed = max(asked, FEWEST_POSES)
    usable, doubted = plausible(candidates)
    if len(usable) < needed:
        raise FitError(
            f"{len(usable)} usable poses of {looked_at} looked at, {needed} needed{told_of(doubted)}",
            where=recording.path,
            remedy="record more poses, narrow the region, or give first poses",
        )
    return usable, doubted


def _of_the_asked_leg(
    body: Body, used: list[Candidate], others: list[Candidate], sample: SkinSample, recording: Recording
) -> tuple[list[Candidate], list[Candidate], dict[float, str]]:
    """The candidates on the asked one of two legs, as ``on_one_leg`` has them; FitError if they are too few."""
    used, others, crossed = on_one_leg(body, used, others, sample)
    if len(used) < FEWEST_POSES:
        side = body.anatomy.side
        raise FitError(
            f"{len(used)} example poses are of the {side} leg, {FEWEST_POSES} needed{told_of(crossed)}",
            where=recording.path,
            remedy="say where the leg alone is with `--near X Y Z` or `--region X0 Y0 Z0 X1 Y1 Z1`, "
            "or give first poses",
        )
    return used, others, crossed


def _asked_side(
    body: Body,
    used: list[Candidate],
    lost: NeverSeen,
    recording: Recording,
    sample: SkinSample,
    progress: Progress,
    person: Person,
    *,
    chosen: bool,
) -> SideEvidence | None:
    """How well the example poses tell the asked side's limb from the other's, and from a second limb in sight.

    Which of two limbs is meant is only asked where nobody has ``chosen`` it by a first pose.
    """
    progress("which side, and which limb", SIDE.begin)
    targets, thetas = [c.target for c in used], np.array([c.pose.fit.theta for c in used])
    scale = overall_size(body)
    side = compare_sides(body.anatomy, targets, thetas, scale=scale, gone=lost.skin, person=person)
    side = None if side is None else replace(side, beside=sum(c.beside is not None for c in used))
    try:
        if not chosen:
            refuse_two_limbs(body, targets, thetas, side, sample, scale=scale)
    except FitError as error:
        raise FitError(error.problem, where=recording.path, remedy=error.remedy) from error
    refuse_neither_side(side, body.anatomy, targets, where=recording.path)
    refuse_the_other_side(side, body.anatomy, where=recording.path)
    return side


def _adapted(
    body: Body,
    used: list[Candidate],
    others: list[Candidate],
    lost: NeverSeen,
    side: SideEvidence | None,
    recording: Recording,
    progress: Progress,
    person: Person,
) -> tuple[Adaptation, list[Candidate], dict[float, str]]:
    """Algorithm 4, the poses it rests on, and by their times those that failed the judge; without these it is redone.

    Raises:
        FitError: fewer than FEWEST_POSES poses pass.
    """
    targets, thetas = [c.target for c in used], np.array([c.pose.fit.theta for c in used])
    unseen = [(c.target, c.pose.fit.theta) for c in others]
    apart_m = 0.0 if side is None else side.asked_m
    adaptation = adapt_body(
        body,
        targets,
        thetas,
        unseen=unseen,
        gone=lost.skin,
        by_proportions_m=apart_m,
        person=person,
        progress=progress,
    )
    whole = without(sample_skin(body.anatomy), lost.skin)
    judged = [judge_fit(adaptation.body, *pose, whole, ADAPTED) for pose in zip(targets, adaptation.fits, strict=True)]
    failed = {c.instant.time_s: judgement.reason for c, judgement in zip(used, judged, strict=True) if judgement.reason}
    if not failed:
        return adaptation, used, {}
    kept = [c for c in used if c.instant.time_s not in failed]
    if len(kept) < FEWEST_POSES:
        raise FitError(
            f"the adapted body fits {len(kept)} of {len(used)} example poses, {FEWEST_POSES} needed{told_of(failed)}",
            where=recording.path,
            remedy="is it the person, with the region, the unit and the focal length right? Choose other frames, "
            "or give first poses",
        )
    adaptation, kept, further = _adapted(body, kept, others, lost, side, recording, progress, person)
    return adaptation, kept, failed | further


def _scales(adaptation: Adaptation) -> dict[str, dict[str, float]]:
    """How large the body is at each joint against the template, with one standard deviation."""
    body = adaptation.body
    sure = deviations(adaptation.covariance)[body.affine.scale_columns]
    return {
        joint: {"scale": float(scale), "sd": float(deviation)}
        for joint, scale, deviation in zip(body.affine.groups, body.affine.scales(body.shape), sure, strict=True)
    }


def _subject(
    adaptation: Adaptation,
    used: list[Candidate],
    settings: dict[str, Any],
    side: SideEvidence | None,
    lost: NeverSeen,
    left_out: Mapping[float, str],
    person: Person,
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
        WIDENED: OF_PEOPLE,
        "scales": _scales(adaptation),
        "landmarks_shown": shown,
        "landmarks_never_shown": [name for name, count in shown.items() if count == 0],
        "settings": settings,
        **person_report(adaptation, person),
        **lost.report(body.anatomy),
    }
    times = np.array([candidate.instant.time_s for candidate in used])
    return Subject(body, adaptation.thetas, times, adaptation.covariance, report)


def _pose_report(body: Body, candidate: Candidate, fit: PoseFit, sample: SkinSample) -> dict[str, float]:
    judged = judge_fit(body, candidate.target, fit, sample, ADAPTED)
    return {
        "time_s": candidate.instant.time_s,
        "matches": len(fit.matches),
        "median_distance_mm": 1e3 * fit.residual_m,
        "skin_to_cloud_mm": 1e3 * judged.found.whole.skin_m,
        "coverage": judged.found.whole.coverage,
        "unexplained": judged.unexplained,
    }
