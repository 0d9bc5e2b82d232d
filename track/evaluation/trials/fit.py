"""A made recording goes through calibrate, adapt and track, all automatic, and the motion is judged by the truth."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from adapt.anatomy import Floats
from adapt.mirror import mirrored_coordinate
from adapt.model.pose_space import joint_coordinates
from adapt.subject import load_subject
from capture.recording import open_recording
from capture.recording.types import HEADER_FILE
from track.accuracy.errors import evaluate_motion
from track.accuracy.truth import Truth
from track.evaluation.trials.command import Told, bonetrack
from track.evaluation.trials.recorded import Made
from track.evaluation.trials.situation import Outcome, Verdict
from track.motion import Motion, load_motion

BOUND_DEG = 5.0  # of any angle's mean error; docs/accuracy.md has 0.3 to 3 degrees over longer recordings
_SAME_S = 1e-3
GROSS_DEG = 20.0  # an error beyond this, and beyond two stated deviations, is wrong in whatever company
HONEST = 0.9  # share of errors within two stated deviations


def judged(make: Callable[[int, Path], Made]) -> Callable[[int, Path], Outcome]:
    """How a maker's recordings are run and judged."""

    def run(seed: int, folder: Path) -> Outcome:
        return track_and_judge(make(seed, folder / "recording"), folder)

    return run


def track_and_judge(made: Made, folder: Path) -> Outcome:
    """Calibrate where there is a box, adapt, track and compare with the truth."""
    start, doubts = time.perf_counter(), []
    subject, motion = folder / "subject.npz", folder / "motion"
    steps: list[tuple[str | Path, ...]] = [
        ("adapt", made.recording, "--anatomy", made.anatomy, "--out", subject),
        ("track", made.recording, "--subject", subject, "--out", motion),
    ]
    if json.loads((made.recording / HEADER_FILE).read_text(encoding="utf-8")).get("box") is not None:
        steps.insert(0, ("calibrate", made.recording))  # what is wrong with the rest is the commands' to say
    for step in steps:
        told = bonetrack(*step)
        if told.code != 0:
            return refused(told, {"step": str(step[0]), "seconds": time.perf_counter() - start})
        doubts += [] if step[0] == "calibrate" else told.doubts  # that is of the sensors, not of this result
    found = load_motion(motion)
    numbers = errors_of(found, made, subject) | {"doubts": doubts, "seconds": time.perf_counter() - start}
    verdict = _verdict(numbers, doubts, same_side=made.anatomy == made.truth.body.anatomy.name)
    return Outcome(verdict, _line(numbers, doubts), numbers)


def refused(told: Told, numbers: dict[str, Any]) -> Outcome:
    """The outcome of a command that gave no result."""
    if told.unexplained:
        return Outcome("failed", (told.refusal or told.err)[-300:], numbers)
    asks = "?" in told.refusal or "--near" in told.refusal
    return Outcome("asked" if asks else "refused", told.refusal, numbers)


def errors_of(motion: Motion, made: Made, subject: Path) -> dict[str, Any]:
    """Frames tracked, and every angle's mean and largest error (deg) and share within two deviations."""
    tracked = motion.tracked
    numbers: dict[str, Any] = {"frames": len(tracked), "tracked": int(tracked.sum())}
    timed = _on_the_truths_clock(motion, made.truth)
    if timed is None:
        return numbers | {"angles": {}, "within_2_sd": None, "times": "not those at which the limb moved"}
    if made.anatomy == made.truth.body.anatomy.name and tracked.any():
        evaluation = evaluate_motion(timed, load_subject(subject), open_recording(made.recording))
        errors = {n.removeprefix("angle "): v for n, v in evaluation.errors.items() if n.startswith("angle ")}
        stated = {n.removeprefix("angle "): v for n, v in evaluation.stated.items()}
        centres = {n: v for n, v in evaluation.errors.items() if n.startswith("centre ") and np.isfinite(v).any()}
        numbers["centres_mm"] = {n.removeprefix("centre "): float(np.nanmean(v)) for n, v in centres.items()}
    else:
        errors, stated = _mirrored_errors(timed, made.truth), {}
    known = {name: np.isfinite(values) for name, values in errors.items()}
    numbers["angles"] = {
        name: {"mean": float(values[known[name]].mean()), "max": float(values[known[name]].max())}
        for name, values in errors.items()
        if known[name].any()
    }
    within = [(errors[n] <= 2.0 * stated[n])[known[n]] for n in stated if known[n].any()]
    numbers["gross_frames"] = gross_frames(errors, stated)
    numbers["within_2_sd"] = float(np.concatenate(within).mean()) if within else None
    return numbers


def gross_frames(errors: Mapping[str, Floats], stated: Mapping[str, Floats]) -> int:
    """How many frames have an angle that is far off while its deviation says that it is not; all (T,) deg."""
    far = [(errors[name] > np.maximum(GROSS_DEG, 2.0 * stated[name])) for name in stated]
    return int(np.any(far, axis=0).sum()) if far else 0


def _on_the_truths_clock(motion: Motion, truth: Truth) -> Motion | None:
    """The motion with its times, or those counted from the first frame, if they are times of the truth."""
    for times in (motion.times, motion.times - motion.times[0] + truth.times[0]):
        if np.abs(truth.times[:, None] - times).min(axis=0).max() < _SAME_S:
            return replace(motion, times=times)
    return None


def _mirrored_errors(motion: Motion, truth: Truth) -> dict[str, np.ndarray]:
    """Errors (T,) deg of a motion with the other side's anatomy: the same values mean the same movement."""
    anatomy = truth.body.anatomy
    coordinates = [anatomy.coordinates[i].name for i in joint_coordinates(anatomy)]
    names = {name: mirrored_coordinate(name) for name in coordinates}
    at = np.abs(truth.times[:, None] - motion.times).argmin(axis=0)
    errors = {}
    for mine, other in names.items():
        if other not in motion.coordinates:
            continue
        true = truth.thetas[at, anatomy.coordinate_index(mine)]
        values = np.rad2deg(np.abs(motion.thetas[:, motion.coordinates.index(other)] - true))
        errors[other] = np.where(motion.tracked, values, np.nan)
    return errors


def _verdict(numbers: dict[str, Any], doubts: list[str], *, same_side: bool) -> Verdict:
    if not same_side:
        return "said" if any("side" in line or "mirror" in line for line in doubts) else "WRONG WITHOUT A WORD"
    if "times" in numbers:
        return "said" if doubts else "WRONG WITHOUT A WORD"
    if not numbers["angles"]:
        return "said"  # nothing is claimed: every frame is lost, with its reason
    if numbers.get("gross_frames"):
        return "said" if doubts else "WRONG WITHOUT A WORD"
    honest = numbers["within_2_sd"] is None or numbers["within_2_sd"] >= HONEST
    accurate = max(angle["mean"] for angle in numbers["angles"].values()) <= BOUND_DEG
    if accurate:
        return "right" if honest else "overconfident"
    return "said" if honest or doubts else "WRONG WITHOUT A WORD"


def _line(numbers: dict[str, Any], doubts: list[str]) -> str:
    """The key numbers in one line."""
    angles = sorted(numbers["angles"].items(), key=lambda item: -item[1]["mean"])
    parts = [f"{numbers['tracked']} of {numbers['frames']} tracked"]
    parts += [f"times are {numbers['times']}"] if "times" in numbers else []
    parts += [f"{name} off by {angle['mean']:.1f} (at most {angle['max']:.1f}) deg" for name, angle in angles[:2]]
    if numbers["within_2_sd"] is not None:
        parts.append(f"{100 * numbers['within_2_sd']:.0f} % within two stated deviations")
    if gross := numbers.get("gross_frames"):
        parts.append(f"{gross} frames far off and beyond their deviations")
    return "; ".join([*parts, *(f"said: {line}" for line in doubts[:2])])
