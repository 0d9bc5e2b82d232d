"""Command: subjects and motions in other tools' formats."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from capture.console import stdout

if TYPE_CHECKING:
    from adapt.subject import Subject
    from track.motion import Motion

_PATH = click.Path(path_type=Path)


@click.command("export")
@click.argument("source", type=_PATH)
@click.option("--subject", type=_PATH, help="The subject of a motion [default: the one the motion knows].")
@click.option("--frame", type=int, help="Also write skin and bones of this frame of a motion.")
@click.option(
    "--gltf", is_flag=True, help="Also write a motion as an animated skeleton with skin and bones, motion.glb."
)
@click.option("--parquet", is_flag=True, help="Also write a motion's tables as Parquet.")
@click.option("--out", required=True, type=_PATH, help="The folder to write.")
def export_command(source: Path, subject: Path | None, frame: int | None, gltf: bool, parquet: bool, out: Path) -> None:
    """Write a subject or a motion (SOURCE) for other tools: PLY, .osim, .mot, .sto, .trc, CSV, Parquet, glTF."""
    from adapt.subject import load_subject
    from capture.own import refuse_foreign
    from track.export.files import export_motion, export_subject
    from track.export.glb import MARK
    from track.motion import MotionError, load_motion, refuse_recording
    from track.whereabouts import subject_of

    if source.is_dir():
        refuse_recording(source)
        if gltf:
            refuse_foreign(out / "motion.glb", MARK)
        motion = load_motion(source)
        whose = load_subject(subject_of(motion, source, subject))
        try:
            written = export_motion(motion, whose, out, frame=frame, parquet=parquet)
        except MotionError as error:  # it knows the motion, not the folder it came from
            raise MotionError(error.problem, where=error.where or source, remedy=error.remedy) from error
        if frame is not None and motion.hidden(frame):
            stdout.print(f"left out, for they do not show in frame {frame}: {', '.join(motion.hidden(frame))}")
        if gltf:
            written.append(_gltf(motion, whose, out / "motion.glb"))
    elif gltf or parquet:
        raise click.UsageError("--gltf and --parquet go with a motion: name its folder")
    else:
        written = export_subject(load_subject(source), out)
    for path in written:
        stdout.print(str(path), highlight=False)


def _gltf(motion: Motion, subject: Subject, path: Path) -> Path:
    """Write the motion, and say what the file does not say exactly."""
    from track.export.gltf import write_gltf

    report = write_gltf(motion, subject, path)
    off = report.skin
    stdout.print(
        f"{path.name}: its skin is off the model's by {1e3 * off.mean_m:.2f} mm in the mean, at most "
        f"{1e3 * off.largest_m:.1f} mm (frame {report.worst_frame}), because it is blended linearly",
        soft_wrap=True,
    )
    if report.lost_frames:
        stdout.print(
            f"{path.name}: {report.lost_frames} lost frame(s) have no keys; viewers pass over them evenly",
            soft_wrap=True,
        )
    if report.frames_with_hidden_bones:
        stdout.print(
            f"{path.name}: bones vanish where they do not show ({report.frames_with_hidden_bones} frame(s)); "
            "their skin stays, on guessed poses",
            soft_wrap=True,
        )
    return path
