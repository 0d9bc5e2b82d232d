"""Command: subjects and motions in other tools' formats."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from capture.console import stdout

if TYPE_CHECKING:
    from track.export.bvh import Gaps

_PATH = click.Path(path_type=Path)
_AXES = ("x", "y", "z", "-x", "-y", "-z")
_ONE_FILE = ("gltf", "usd", "bvh", "c3d")


@click.command("export")
@click.argument("source", type=_PATH)
@click.option("--subject", type=_PATH, help="The subject of a motion [default: the one the motion knows].")
@click.option("--frame", type=int, help="Also write skin and bones of this frame of a motion.")
@click.option(
    "--gltf", is_flag=True, help="Also write a motion as an animated skeleton with skin and bones, motion.glb."
)
@click.option("--usd", is_flag=True, help="The same as USD, motion.usdc.")
@click.option("--bvh", is_flag=True, help="Also write a motion as a skeleton alone, motion.bvh.")
@click.option("--c3d", is_flag=True, help="Also write joint centres and landmarks as motion.c3d.")
@click.option("--parquet", is_flag=True, help="Also write a motion's tables as Parquet.")
@click.option(
    "--gaps",
    type=click.Choice(["bridge", "hold", "split"]),
    help="What becomes of lost frames in BVH: even motion, the pose before, or a file for each span between.",
)
@click.option(
    "--up", type=click.Choice(_AXES), help="The recording's axis that points up, if the motion does not know."
)
@click.option("--out", required=True, type=_PATH, help="The folder to write.")
def export_command(
    source: Path,
    subject: Path | None,
    frame: int | None,
    parquet: bool,
    gaps: Gaps | None,
    up: str | None,
    out: Path,
    **one_file: bool,
) -> None:
    """Write a subject or a motion (SOURCE) for other tools.

    PLY, .osim, .mot, .sto, .trc and CSV, and what options name: Parquet, glTF, USD, BVH, C3D.
    """
    from adapt.subject import load_subject
    from capture.upright import AXES
    from track.export.animations import Asked, refuse_formats, write_formats
    from track.export.files import export_motion, export_subject
    from track.motion import MotionError, load_motion, refuse_recording
    from track.whereabouts import subject_of

    names = [name for name in _ONE_FILE if one_file[name]]
    if not source.is_dir():
        if names or parquet:
            options = ", ".join(f"--{name}" for name in [*names, *(["parquet"] if parquet else [])])
            raise click.UsageError(f"{options} go with a motion: name its folder")
        paths = export_subject(load_subject(source), out)
    else:
        refuse_recording(source)
        motion = load_motion(source)
        whose, asked = load_subject(subject_of(motion, source, subject)), Asked(AXES.get(up or ""), gaps)
        try:
            refuse_formats(names, motion, out, asked)
            paths = export_motion(motion, whose, out, frame=frame, parquet=parquet)
            more = write_formats(names, motion, whose, out, asked)
        except MotionError as error:  # it knows the motion, not the folder it came from
            raise MotionError(error.problem, where=error.where or source, remedy=error.remedy) from error
        if frame is not None and motion.hidden(frame):
            stdout.print(f"left out, for they do not show in frame {frame}: {', '.join(motion.hidden(frame))}")
        for line in more.said:
            stdout.print(line, soft_wrap=True)
        paths += more.paths
    for path in paths:
        stdout.print(str(path), highlight=False)
