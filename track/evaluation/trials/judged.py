"""What comes out of a trial: right, refused, said, or wrong without a word."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np

from adapt.anatomy import load_anatomy
from adapt.fit.recording import adapt_recording
from adapt.subject import Subject, doubts, save_subject
from capture.errors import BonetrackError
from track.evaluation.errors import Evaluation, evaluate_motion
from track.evaluation.trials.situation import Situation, Trial
from track.motion import Motion
from track.run import track_recording

RIGHT, REFUSED, SAID, WRONG = "right", "refused", "said", "WRONG WITHOUT A WORD"
ANGLE_DEG, TWIST_DEG, CENTRE_MM = 3.0, 5.0, 12.0
"""A result is right if hinges and turns err by less in the mean, and joint centres that are claimed."""
_TWIST = ("pro_sup", "hip_rotation_r", "hip_rotation_l")
COVERED = 0.9


def run_trial(situation: Situation, seed: int, folder: Path) -> dict[str, Any]:
    """Make one variant, adapt and track it, and judge what comes out; plain JSON."""
    start = time.perf_counter()
    try:
        trial = situation.make(seed, folder)
        subject = adapt_recording(trial.recording, load_anatomy(trial.ask))
        save_subject(subject, folder / "subject.npz")
        motion = track_recording(trial.recording, subject, folder / "motion")
        found = _judged(trial, subject, motion)
    except BonetrackError as error:
        said = str(error).replace(str(folder), "").replace(str(folder.resolve()), "").lstrip("/")
        found = {"verdict": REFUSED, "said": said}
    return found | {"situation": situation.name, "seed": seed, "seconds": time.perf_counter() - start}


def _judged(trial: Trial, subject: Subject, motion: Motion) -> dict[str, Any]:
    told = "; ".join(doubts(subject))
    numbers: dict[str, Any] = {
        "tracked": f"{int(motion.tracked.sum())} of {len(motion.tracked)}",
        "said": told,
        "sizes": {name: size["scale"] for name, size in subject.report["scales"].items()},
        "side": None if subject.report["side"] is None else subject.report["side"]["support_nats"],
        "poses": subject.report["poses"],
    }
    if trial.truth is None:
        return numbers | {"verdict": SAID if told else WRONG}
    if not motion.tracked.any():
        return numbers | {"verdict": REFUSED, "said": motion.lost[0]}
    evaluation = evaluate_motion(motion, subject, trial.truth)
    errors = {row.name: row.mean for row in evaluation.summaries()}
    numbers |= {"errors": errors, "covered": _covered(evaluation)}
    return numbers | {"verdict": RIGHT if _is_right(errors) else SAID if told else WRONG}


def _is_right(errors: dict[str, float]) -> bool:
    for name, mean in errors.items():
        kind, _, of = name.partition(" ")
        bound = {"angle": TWIST_DEG if of in _TWIST else ANGLE_DEG, "centre": CENTRE_MM}.get(kind, np.inf)
        if mean > bound:
            return False
    return True


def _covered(evaluation: Evaluation) -> float:
    """The share of all stated angles whose true error is within two stated deviations."""
    within = [row.covered for row in evaluation.summaries() if row.covered is not None]
    return float(np.mean(within)) if within else float("nan")
