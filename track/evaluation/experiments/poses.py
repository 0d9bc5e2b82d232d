"""Figure 8: one straight-arm pose does not tell where the elbow is; several poses do."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from adapt.adapt_recording import adapt_recording
from adapt.anatomy import Floats
from adapt.anatomy_file import load_anatomy
from adapt.fit.alternate import adapt_body
from adapt.model.body import make_body, rest_theta
from adapt.model.pose_space import is_free
from adapt.options import AdaptOptions
from adapt.subject import Subject
from track.accuracy.errors import evaluate_motion
from track.evaluation.experiments.experiment import Experiment, Result, markdown_table, summary
from track.evaluation.known import CARMINE, KnownRecording, centre_errors, record_known
from track.evaluation.made_up_motions import joined, perform
from track.evaluation.random_bodies import random_body
from track.options import TrackOptions
from track.simulation.performance import Performance
from track.track_recording import track_recording

ANATOMY = "upper-limb-right"
MOTIONS = ("bend", "bend-and-twist")
_SECONDS = 1.5
_LEAD = 5  # frames of the straight arm before the motion
_START_DEG, _START_M = 6.0, 0.015  # how far off the first pose is; the straight arm's is given, not searched
_KINDS = ("one straight arm", "six poses")


def performance(seed: int) -> Performance:
    """A random subject who holds the arm straight, then bends and twists it."""
    body = random_body(load_anatomy(ANATOMY), seed)
    moving = perform(body, MOTIONS, seconds_each=_SECONDS, seed=seed)
    thetas = joined([np.tile(_straight(moving), (_LEAD, 1)), moving.thetas], 10)
    return Performance(body, np.arange(len(thetas)) / 30.0, thetas)


def _straight(moving: Performance) -> Floats:
    """The first pose (n,) with every joint but the free one at zero."""
    theta = rest_theta(moving.body)
    for joint in moving.body.anatomy.joints:
        index = [moving.body.anatomy.coordinate_index(name) for name in joint.coordinates]
        theta[index] = moving.thetas[0, index] if is_free(joint) else 0.0
    return theta


def run(case: str, folder: Path) -> Result:
    """Adapt to the straight arm alone and to six poses; track the whole motion with both."""
    seed = int(case.split()[-1])
    known = record_known(performance(seed), folder / "recording", seed=seed, noise=CARMINE)
    subjects = dict(zip(_KINDS, (_from_one_pose(known, seed), _from_poses(known)), strict=True))
    return {kind: _scored(known, subject, folder / kind.replace(" ", "-")) for kind, subject in subjects.items()}


def _from_one_pose(known: KnownRecording, seed: int) -> Subject:
    anatomy, frame = known.body.anatomy, _LEAD // 2
    rng = np.random.default_rng(seed)
    scale = [_START_M if c.unit == "m" else np.deg2rad(_START_DEG) for c in anatomy.coordinates]
    start = known.thetas[frame] + rng.uniform(-1.0, 1.0, len(scale)) * scale
    adaptation = adapt_body(make_body(anatomy), known.targets([frame]), start[None])
    return Subject(adaptation.body, adaptation.thetas, np.array([0.0]), adaptation.covariance, {})


def _from_poses(known: KnownRecording) -> Subject:
    return adapt_recording(known.recording, known.body.anatomy, AdaptOptions(region=known.region))


def _scored(known: KnownRecording, subject: Subject, folder: Path) -> Result:
    motion = track_recording(known.recording, subject, folder, TrackOptions(region=known.region))
    evaluation = evaluate_motion(motion, subject, known.recording)
    frames = np.flatnonzero(motion.tracked)
    centres = centre_errors(subject.body, motion.thetas[frames], known.body, known.thetas[frames])
    return {
        "centres_mm": {name: (1e3 * errors).tolist() for name, errors in centres.items()},
        "angles_deg": {
            name.removeprefix("angle "): values[np.isfinite(values)].tolist()
            for name, values in evaluation.errors.items()
            if name.startswith("angle ")
        },
        "lost": evaluation.lost,
        "frames": evaluation.frames,
    }


def describe(results: Mapping[str, Result], images: Path) -> str:
    """The table over all subjects."""
    rows = [["error, mean ± SD (maximum)", *_KINDS]]
    first = next(iter(results.values()))[_KINDS[0]]
    for part, unit in (("centres_mm", "mm"), ("angles_deg", "deg")):
        for name in first[part]:
            cells = [summary(np.concatenate([r[kind][part][name] for r in results.values()])) for kind in _KINDS]
            rows.append([f"{name} ({unit})", *cells])

    def total(kind: str, what: str) -> int:
        return sum(result[kind][what] for result in results.values())

    lost = [f"{total(kind, 'lost')} of {total(kind, 'frames')}" for kind in _KINDS]
    rows.append(["frames lost", *lost])
    return f"""{len(results)} random subjects with soft tissue ({", ".join(results)}), two Carmine sensors.
Each holds the arm straight for {_LEAD} frames, then bends and twists it for {2 * _SECONDS:g} s. Adapted once to a
single frame of the straight arm (its first pose given, off by up to {_START_DEG:g} degrees and {100 * _START_M:g} cm),
once automatically to six poses; then the whole is tracked with either.

{markdown_table(rows)}
"""


def losses(results: Mapping[str, Result]) -> list[str]:
    """What six poses know worse than one."""
    lines = []
    for part, unit in (("centres_mm", "mm"), ("angles_deg", "deg")):
        for name in next(iter(results.values()))[_KINDS[0]][part]:
            one, six = (np.mean(np.concatenate([r[kind][part][name] for r in results.values()])) for kind in _KINDS)
            lines += [f"{name}: six poses {six:.2f} {unit}, one pose {one:.2f} {unit}"] if six > one else []
    return lines


EXPERIMENT = Experiment(
    "figure-8-poses",
    "Figure 8: one straight arm, or several poses",
    ("seed 1", "seed 2", "seed 3"),
    run,
    describe,
    losses,
)
