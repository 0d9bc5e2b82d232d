"""The accuracy protocol: random subjects, simulated by two sensors, everything automatic, scored by the truth.

    python -m track.evaluation.protocol --anatomy upper-limb-right --subjects 5 --out DIR

A heavy evaluation, not a test. Each subject's result is a file in DIR; a run that was cut short goes on.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.table import Table

from adapt.adapt_recording import adapt_recording
from adapt.anatomy import Anatomy
from adapt.anatomy_file import load_anatomy
from adapt.subject import save_subject
from capture.calibration.calibrate import calibrate_recording, write_calibration
from capture.console import stdout
from capture.files import replaced_when_complete
from capture.own import page_of, replaced_if_own
from capture.recording import Recording, open_recording
from capture.simulation.sensor import NoiseModel, carmine
from track.accuracy.errors import evaluate_motion
from track.evaluation.made_up_motions import motion_names, perform, perform_tables
from track.evaluation.random_bodies import random_body
from track.simulation.simulate import simulate_performance
from track.track_recording import track_recording

NOISES = {"carmine": carmine(), "none": NoiseModel()}


def run_subject(
    anatomy: Anatomy,
    seed: int,
    noise: str,
    seconds_each: float,
    folder: Path,
    *,
    tables: Sequence[Path] = (),
    motions: Sequence[str] = (),
) -> dict[str, Any]:
    """Simulate, calibrate, adapt, track and evaluate one random subject; returns the evaluation as plain JSON.

    The subject moves as the ``tables`` say, or as the anatomy's made-up ``motions`` where there are none: all of them
    if none is named.
    """
    body = random_body(anatomy, seed)
    performance = (
        perform_tables(body, tables, seconds_each=seconds_each, seed=seed)
        if tables
        else perform(body, tuple(motions) or motion_names(anatomy), seconds_each=seconds_each, seed=seed)
    )
    recording = simulate_performance(performance, folder / "recording", noise=NOISES[noise], seed=seed, overwrite=True)
    recording = calibrated(recording)
    subject = adapt_recording(recording, anatomy)
    save_subject(subject, folder / "subject.npz")
    motion = track_recording(recording, subject, folder / "motion")
    evaluation = evaluate_motion(motion, subject, recording)
    return {"seed": seed, "noise": noise, "seconds_each": seconds_each} | evaluation.as_json()


def calibrated(recording: Recording) -> Recording:
    """The recording with its box calibration stored."""
    write_calibration(recording, calibrate_recording(recording))
    return open_recording(recording.path)


def error_rows(results: list[dict[str, Any]]) -> list[list[str]]:
    """A header, then mean ± SD (maximum) of every kind of error: a column per subject and one over all.

    For coordinates also the share of frames whose error is within two of the standard deviations that tracking states.
    """
    rows = [["error", "unit", *[f"subject {r['seed']}" for r in results], "all"]]
    for name, first in results[0]["errors"].items():
        errors = [r["errors"][name] for r in results]
        cells = [f"{e['mean']:.2f} ± {e['sd']:.2f} ({e['max']:.1f})" for e in errors]
        cells = [cell + _covered(e) for cell, e in zip(cells, errors, strict=True)]
        mean, worst = np.mean([e["mean"] for e in errors]), max(e["max"] for e in errors)
        rows.append([name, first["unit"], *cells, f"{mean:.2f} ({worst:.1f})"])
    lost, frames = sum(r["lost"] for r in results), sum(r["frames"] for r in results)
    rows.append(["frames lost", "", *[f"{r['lost']} of {r['frames']}" for r in results], f"{lost} of {frames}"])
    return rows


def _covered(error: dict[str, Any]) -> str:
    """The share of frames within two stated standard deviations, where any are stated."""
    return f", {100 * error['within_2_sd']:.0f} % in 2 SD" if "within_2_sd" in error else ""


def show(results: list[dict[str, Any]], title: str, markdown: Path) -> None:
    """Print the table, and write it as Markdown."""
    header, *rows = error_rows(results)
    table = Table(*header, title=title)
    for row in rows:
        table.add_row(*row)
    stdout.print(table)
    lines = [header, ["---"] * len(header), *rows]
    text = "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"
    with replaced_if_own(markdown, page_of(text)) as partial:
        partial.write_text(text, encoding="utf-8")


@click.command()
@click.option("--anatomy", default="upper-limb-right", show_default=True)
@click.option("--subjects", default=5, show_default=True, help="How many random subjects.")
@click.option("--first-seed", default=1, show_default=True)
@click.option("--noise", type=click.Choice([*NOISES, "both"]), default="both", show_default=True)
@click.option("--seconds", default=2.0, show_default=True, help="Length of each of the motions.")
@click.option(
    "--motion",
    "tables",
    multiple=True,
    type=click.Path(path_type=Path),
    help="A table of recorded joint angles to perform instead of the made-up motions; may be given several times.",
)
@click.option("--only", multiple=True, help="One of the made-up motions instead of all; may be given several times.")
@click.option("--out", required=True, type=click.Path(path_type=Path))
def main(
    anatomy: str,
    subjects: int,
    first_seed: int,
    noise: str,
    seconds: float,
    tables: tuple[Path, ...],
    only: tuple[str, ...],
    out: Path,
) -> None:
    """Run the accuracy protocol and print its tables."""
    template = load_anatomy(anatomy)
    if not set(only) <= set(motion_names(template)):
        raise click.BadParameter(f"{anatomy} has the motions {', '.join(motion_names(template))}", param_hint="--only")
    for kind in NOISES if noise == "both" else [noise]:
        results = []
        for seed in range(first_seed, first_seed + subjects):
            folder = out / f"{kind}-{seed}"
            done = folder / "errors.json"
            if not done.is_file():
                folder.mkdir(parents=True, exist_ok=True)
                with stdout.status(f"subject {seed}, noise {kind}"):
                    result = run_subject(template, seed, kind, seconds, folder, tables=tables, motions=only)
                with replaced_when_complete(done) as partial:
                    partial.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
            results.append(json.loads(done.read_text(encoding="utf-8")))
        show(results, f"{anatomy}, noise: {kind}, {seconds:g} s a motion", out / f"{kind}.md")


if __name__ == "__main__":
    main()
