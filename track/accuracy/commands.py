"""Command: score a motion by the known truth of its recording."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from capture.commands.written_file import WrittenFile
from capture.console import stdout
from capture.progress import progress

if TYPE_CHECKING:
    from track.accuracy.errors import Evaluation

_PATH = click.Path(path_type=Path)


@click.command("evaluate")
@click.argument("motion", type=_PATH)
@click.option(
    "--truth", type=_PATH, help="The simulated recording that was tracked [default: the one the motion knows]."
)
@click.option("--subject", type=_PATH, help="The subject that was tracked [default: the one the motion knows].")
@click.option("--out", type=WrittenFile(".json", "JSON"), help="Write the table as JSON, too.")
def evaluate_command(motion: Path, truth: Path | None, subject: Path | None, out: Path | None) -> None:
    """Errors of MOTION against the known truth of a simulated recording."""
    from adapt.subject import load_subject
    from capture.own import refuse_foreign
    from capture.recording import open_recording
    from track.accuracy.errors import MARK, evaluate_motion, write_evaluation
    from track.belonging import refuse_other_subject
    from track.motion import MotionError, load_motion
    from track.whereabouts import recording_of, subject_of

    if out is not None:
        refuse_foreign(out, MARK)
    tracked = load_motion(motion)
    person = load_subject(subject_of(tracked, motion, subject))
    recording = recording_of(tracked, motion, truth)
    if recording is None:
        raise MotionError(
            "its recording is not where it was, or it does not know it", where=motion, remedy="give --truth"
        )
    refuse_other_subject(tracked, person)
    with progress("comparing with the truth"):
        evaluation = evaluate_motion(tracked, person, open_recording(recording))
    print_evaluation(evaluation)
    if out is not None:
        write_evaluation(evaluation, out)


def print_evaluation(evaluation: Evaluation) -> None:
    """The error table."""
    from rich.table import Table

    table = Table("error", "unit", "mean", "SD", "max", "within 2 stated SD", title="errors against the truth")
    for row in evaluation.summaries():
        covered = "" if row.covered is None else f"{100 * row.covered:.0f} %"
        table.add_row(row.name, row.unit, f"{row.mean:.2f}", f"{row.sd:.2f}", f"{row.maximum:.2f}", covered)
    stdout.print(table)
    stdout.print(f"{evaluation.lost} of {evaluation.frames} frames lost", highlight=False)
    claimed = f"{evaluation.claimed} of {evaluation.bones} bones in all frames are claimed to be known"
    stdout.print(f"{claimed}, and only those are scored", highlight=False)
