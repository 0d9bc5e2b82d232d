"""The stages of adapting, on one thread, on a recording: a body fitted to poses that are given, and all by itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from adapt.adapt_recording import adapt_recording
from adapt.fit.alternate import adapt_body
from adapt.fit.pose import match_pose
from adapt.fit.problem import Unknowns
from adapt.fit.shape import ShapeEnergy, split_tissue
from adapt.match.correspondences import Target
from adapt.match.skin_sample import sample_skin, weighted_by_tissue
from adapt.model.body import make_body, shaped_skin
from adapt.options import AS_USUAL
from adapt.subject import Subject
from adapt.tissue import tissue_field
from capture.cloud.fuse import fuse
from capture.recording import Recording, instants
from track.evaluation.benchmark.timing import Timing, timed
from track.evaluation.skin_of_blocks import skin_of_blocks_by_shape

ADAPTATION_TARGET_S = 30.0  # of six poses
FIRST_GIVEN_S, FIRST_AUTOMATIC_S = 15.7, 47.5  # see stages.FIRST


def adaptation_timings(recording: Recording, subject: Subject, *, repeat: int) -> list[Timing]:
    """One evaluation of algorithm 2, and algorithm 4 from the template, both in the subject's own example poses."""
    moments = instants(recording)
    at = np.abs(np.array([moment.time_s for moment in moments])[:, None] - subject.times).argmin(axis=0)
    targets = [Target(fuse(recording, moments[k])) for k in at]
    given = timed(
        f"adaptation, {len(targets)} poses, first poses given",
        lambda: adapt_body(make_body(subject.anatomy), targets, subject.thetas),
        repeat=repeat,
        target_s=ADAPTATION_TARGET_S,
        first_s=FIRST_GIVEN_S,
    )
    return [*evaluation_timings(subject, targets, repeat=repeat), given]


def evaluation_timings(subject: Subject, targets: Sequence[Target], *, repeat: int) -> list[Timing]:
    """What a step of algorithm 2 costs: the skin by theta, shape and tissue, and the normal equations made of it."""
    body, sample = subject.body, weighted_by_tissue(sample_skin(subject.anatomy), subject.anatomy)
    matches = [match_pose(body, *posed, sample, gate_m=0.02) for posed in zip(targets, subject.thetas, strict=True)]
    field = tissue_field(subject.anatomy)
    fine, c = split_tissue(body, field)
    of = Unknowns(len(body.shape), len(c), len(subject.anatomy.coordinates))
    energy, x = ShapeEnergy(body, fine, matches, sample, of), np.concatenate([body.shape, c, subject.thetas.ravel()])

    def skin() -> None:
        shaped = shaped_skin(make_body(body.anatomy, shape=body.shape, v_hat=body.v_hat), energy.seen, along=along)
        for theta, rows in zip(subject.thetas, energy.rows, strict=True):
            shaped.posed(theta, rows)

    def skin_in_numpy() -> None:
        for theta, match in zip(subject.thetas, matches, strict=True):
            skin_of_blocks_by_shape(body, theta, match.vertex, along=field.normals[match.vertex])

    def equations() -> None:
        energy.quadratic(x)

    along, count = field.normals[energy.seen], sum(len(match) for match in matches)
    works: tuple[Callable[[], None], ...] = (skin, skin_in_numpy, equations)
    for work in works:
        work()  # fills caches
    what = f"skin by {of.n} coordinates, {of.m} of shape and the tissue, {count} matches in {len(targets)} poses"
    step = f"normal equations of {len(x)} unknowns in {len(targets)} poses"
    numpy = timed(what, skin_in_numpy, repeat=repeat).processor
    return [replace(timed(what, skin, repeat=repeat), twin=numpy), timed(step, equations, repeat=repeat)]


def automatic_timing(recording: Recording, subject: Subject) -> Timing:
    """From the recording to a subject without a hand on it, once."""
    return timed(
        f"adaptation, {AS_USUAL.poses} poses, fully automatic",
        lambda: adapt_recording(recording, subject.anatomy),
        target_s=ADAPTATION_TARGET_S,
        first_s=FIRST_AUTOMATIC_S,
    )
