"""The paper's table 1 with the truth known: OpenSim on markers and this tracker on depth, on the same performances.

    python -m track.evaluation.opensim_ik --anatomy upper-limb-right --subjects 8 --out DIR

A random body with soft tissue (as in ``track.evaluation.protocol``) performs motions. Two simulated sensors see it, and
everything that this program does with them is automatic. A simulated laboratory sees markers on the same moving skin,
and OpenSim does with them what laboratories do: a generic model (our template) is scaled to a static trial by marker
pairs, its markers are placed, and inverse kinematics is solved. Both are scored by the truth, and by each other.

A heavy evaluation, not a test. Every stage leaves its result in DIR; a run that was cut short goes on.
"""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from adapt.adapt_recording import adapt_recording
from adapt.anatomy import Anatomy, Floats
from adapt.anatomy_file import load_anatomy
from adapt.model.body import Body, make_body, rest_theta
from adapt.subject import Subject, load_subject, save_subject
from capture.console import stdout
from capture.errors import BonetrackError
from capture.files import replaced_when_complete
from capture.recording import Recording, open_recording
from track.accuracy.truth import Truth, read_truth, world_from_common
from track.evaluation.benchmark.timing import hold_to_one_thread
from track.evaluation.made_up_motions import FPS, motion_names, motion_spans, perform, perform_tables
from track.evaluation.markers import MarkerSet, marker_set, marker_trial, markers_at_rest, misplaced
from track.evaluation.opensim_ik_tables import OURS, show
from track.evaluation.opensim_tools import OpenSimError, opensim, replayed, scaled_model, solve_kinematics
from track.evaluation.protocol import NOISES, calibrated
from track.evaluation.random_bodies import random_body
from track.evaluation.reconstruction import Reconstruction, differences, reconstruction_of_poses
from track.export.osim import write_osim
from track.motion import Motion, load_motion
from track.simulation.performance import Performance
from track.simulation.simulate import simulate_performance
from track.track_recording import track_recording

Bools = NDArray[np.bool_]

ACCURACIES = (1e-5, 1e-7)  # OpenSim's default, and one at which its answer no longer depends on it
MARKER_NOISE_M = 0.0005
PLACEMENT_M = 0.005  # standard deviation along each axis with which a hand finds a marker's place
_STATIC_FRAMES = 30


@dataclass(frozen=True, eq=False)
class Answer:
    """What a tool says of a performance, and the seconds a frame (wall, processor) took it."""

    said: Reconstruction = field(repr=False)
    wall_s: float
    processor_s: float


def compare_subject(
    anatomy: Anatomy, seed: int, noise: str, seconds_each: float, folder: Path, *, tables: Sequence[Path] = ()
) -> dict[str, Any]:
    """Run both on one random subject; returns every tool's errors, and its differences from ours, as plain JSON."""
    body = random_body(anatomy, seed)
    performance = (
        perform_tables(body, tables, seconds_each=seconds_each, seed=seed)
        if tables
        else perform(body, motion_names(anatomy), seconds_each=seconds_each, seed=seed)
    )
    recording, subject, motion, per_frame = _our_motion(anatomy, performance, noise, seed, folder)
    truth = read_truth(recording)
    ours = reconstruction_of_poses(subject.body, _at(motion, truth), world_from_common(recording, truth))
    answers = {OURS: Answer(ours, **per_frame)}
    answers |= opensim_answers(truth, folder / "opensim", np.random.default_rng(seed))
    spans = {} if tables else motion_spans(motion_names(anatomy), seconds_each=seconds_each)
    return {"seed": seed, "noise": noise, "seconds_each": seconds_each} | _scores(anatomy, truth, answers, spans)


def _our_motion(
    anatomy: Anatomy, performance: Performance, noise: str, seed: int, folder: Path
) -> tuple[Recording, Subject, Motion, dict[str, float]]:
    """Simulate, calibrate, adapt and track; each stage is left out where an earlier run has done it."""
    paths = {name: folder / name for name in ("recording", "subject.npz", "motion", "per_frame.json")}
    if not paths["subject.npz"].is_file():
        made = simulate_performance(performance, paths["recording"], noise=NOISES[noise], seed=seed, overwrite=True)
        save_subject(adapt_recording(calibrated(made), anatomy), paths["subject.npz"])
    recording, subject = open_recording(paths["recording"]), load_subject(paths["subject.npz"])
    if not paths["per_frame.json"].is_file():
        done: list[int] = []
        start, used = time.perf_counter(), time.process_time()
        track_recording(recording, subject, paths["motion"], progress=lambda number, _: done.append(number))
        frames = max(1, len(done))  # of this run: others may have been tracked before a kill
        seconds = {"wall_s": time.perf_counter() - start, "processor_s": time.process_time() - used}
        _write(paths["per_frame.json"], {name: value / frames for name, value in seconds.items()})
    per_frame = json.loads(paths["per_frame.json"].read_text(encoding="utf-8"))
    return recording, subject, load_motion(paths["motion"]), per_frame


def _at(motion: Motion, truth: Truth) -> Floats:
    """The motion's poses (T, n) at the truth's times, NaN where there is none."""
    thetas = np.full_like(truth.thetas, np.nan)
    nearest = np.abs(truth.times[:, None] - motion.times).argmin(axis=0)
    thetas[nearest] = motion.thetas
    return thetas


def opensim_answers(truth: Truth, folder: Path, rng: np.random.Generator) -> dict[str, Answer]:
    """OpenSim on markers of the true skin, in three laboratories.

    "scaled": the template, scaled to a static trial and with its markers placed there. "misplaced": the same, but the
    markers are stuck on by a hand that errs. "true": the true body's own model, its markers known exactly. The static
    trial is a second at rest, which OpenSim is not told the angles of.
    """
    body, template, right = truth.body, make_body(truth.body.anatomy), marker_set(truth.body.anatomy)
    wrong = misplaced(right, body.anatomy, deviation_m=PLACEMENT_M, rng=rng)
    generic = _model(template, right, folder / "generic")
    laboratories = {
        "scaled": (_scaled(body, generic, right, folder / "scaled", rng), template, right, ACCURACIES),
        "misplaced": (_scaled(body, generic, wrong, folder / "misplaced", rng), template, wrong, ACCURACIES[:1]),
        "true": (_model(body, right, folder / "true"), body, right, ACCURACIES),
    }
    answers = {}
    for name, (model, of, markers, accuracies) in laboratories.items():
        trial = marker_trial(body, truth.thetas, markers, noise_m=MARKER_NOISE_M, rng=rng)
        for accuracy in accuracies:
            solved = solve_kinematics(model, trial, truth.times, markers, accuracy, folder / f"ik_{name}")
            said, frames = replayed(model, solved.motion, of), len(truth.times)
            answers[f"OpenSim {name} {accuracy:g}"] = Answer(said, solved.wall_s / frames, solved.processor_s / frames)
    return answers


def _scaled(body: Body, generic: Path, markers: MarkerSet, folder: Path, rng: np.random.Generator) -> Path:
    """The generic model, scaled to a static trial of the body's markers."""
    resting = np.tile(rest_theta(body), (_STATIC_FRAMES, 1))
    static = marker_trial(body, resting, markers, noise_m=MARKER_NOISE_M, rng=rng)
    return scaled_model(generic, static, np.arange(_STATIC_FRAMES) / FPS, markers, folder)


def _model(body: Body, markers: MarkerSet, folder: Path) -> Path:
    return write_osim(body, folder, markers=markers_at_rest(body, markers))[0]


def _scores(
    anatomy: Anatomy, truth: Truth, answers: dict[str, Answer], spans: dict[str, slice] | None = None
) -> dict[str, Any]:
    """Errors of every answer and its differences from ours, over the frames that we tracked; also by motion."""
    faces = {bone.name: bone.faces for bone in anatomy.bones}
    right = reconstruction_of_poses(truth.body, truth.thetas, np.eye(4))
    tracked = np.isfinite(next(iter(answers[OURS].said.angles.values())))
    errors = {name: differences(answer.said, right, faces) for name, answer in answers.items()}
    apart = {n: differences(a.said, answers[OURS].said, faces) for n, a in answers.items() if n != OURS}
    parts = {name: _only(span, tracked) for name, span in (spans or {}).items()}

    def summed(chosen: Bools) -> dict[str, Any]:
        kinds = {"errors": errors, "apart": apart}
        return {kind: {name: _summaries(d, chosen) for name, d in of.items()} for kind, of in kinds.items()}

    return summed(tracked) | {
        "frames": len(tracked),
        "lost": int((~tracked).sum()),
        "by_motion": {name: summed(part) | {"scored": int(part.sum())} for name, part in parts.items() if part.any()},
        "seconds_per_frame": {n: {"wall": a.wall_s, "processor": a.processor_s} for n, a in answers.items()},
    }


def _only(span: slice, tracked: Bools) -> Bools:
    """The tracked frames (T,) of a span."""
    part = np.zeros_like(tracked)
    part[span] = tracked[span]
    return part


def _summaries(apart: dict[tuple[str, str], Floats], chosen: Bools) -> dict[str, dict[str, Any]]:
    summaries = {}
    for (name, unit), series in apart.items():
        values = series[chosen]
        numbers = {"mean": values.mean(), "sd": values.std(), "max": values.max()}
        summaries[name] = {"unit": unit} | {key: float(value) for key, value in numbers.items()}
    return summaries


def _claim(folder: Path, made_from: dict[str, Any]) -> None:
    """Make the folder, or go on in one that was made for the same.

    Raises:
        OpenSimError: what stands there is from other options.
    """
    path = folder / "made_from.json"
    if path.is_file() and json.loads(path.read_text(encoding="utf-8")) != made_from:
        raise OpenSimError("holds the results of other options", where=folder, remedy="give another --out")
    folder.mkdir(parents=True, exist_ok=True)
    _write(path, made_from)


def _write(path: Path, content: dict[str, Any]) -> None:
    with replaced_when_complete(path) as partial:
        partial.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


@click.command()
@click.option("--anatomy", default="upper-limb-right", show_default=True)
@click.option("--subjects", default=1, show_default=True, type=click.IntRange(min=1), help="How many random subjects.")
@click.option("--first-seed", default=1, show_default=True)
@click.option("--noise", type=click.Choice([*NOISES]), default="carmine", show_default=True, help="Of the sensors.")
@click.option("--seconds", default=2.0, show_default=True, help="Length of each of the motions.")
@click.option(
    "--motion",
    "tables",
    multiple=True,
    type=click.Path(path_type=Path),
    help="A table of recorded joint angles to perform instead of the made-up motions; may be given several times.",
)
@click.option("--out", required=True, type=click.Path(path_type=Path))
def main(
    anatomy: str, subjects: int, first_seed: int, noise: str, seconds: float, tables: tuple[Path, ...], out: Path
) -> None:
    """Compare with OpenSim's inverse kinematics on simulated subjects and print the table."""
    hold_to_one_thread()
    try:
        opensim()  # told before the work, not after it
        template = load_anatomy(anatomy)
        results = []
        for seed in range(first_seed, first_seed + subjects):
            folder = out / f"{anatomy}-{seed}"
            done = folder / "comparison.json"
            made_from = {"noise": noise, "seconds_each": seconds, "tables": [str(table) for table in tables]}
            _claim(folder, made_from)
            if not done.is_file():
                with stdout.status(f"subject {seed}"):
                    _write(done, compare_subject(template, seed, noise, seconds, folder, tables=tables))
            results.append(json.loads(done.read_text(encoding="utf-8")))
    except BonetrackError as error:
        raise click.ClickException(str(error)) from error
    show(results, out / f"{anatomy}.md")


if __name__ == "__main__":
    main()
