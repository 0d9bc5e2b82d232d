"""Command: subjects and motions in other tools' formats."""

from __future__ import annotations

from pathlib import Path

import click

from capture.console import stdout

_PATH = click.Path(path_type=Path)


@click.command("export")
@click.argument("source", type=_PATH)
@click.option("--subject", type=_PATH, help="The subject of a motion.")
@click.option("--frame", type=int, help="Also write skin and bones of this frame of a motion.")
@click.option("--out", required=True, type=_PATH, help="The folder to write.")
def export_command(source: Path, subject: Path | None, frame: int | None, out: Path) -> None:
    """Write a subject or a motion (SOURCE) in formats that other tools read: PLY, .osim, .mot, .sto, .trc, CSV."""
    from adapt.subject import load_subject
    from track.export.files import export_motion, export_subject
    from track.motion import load_motion

    if source.is_dir():
        if subject is None:
            raise click.UsageError("a motion is exported with the subject it belongs to: give --subject")
        motion = load_motion(source)
        written = export_motion(motion, load_subject(subject), out, frame=frame)
        if frame is not None and motion.hidden(frame):
            stdout.print(f"left out, for they do not show in frame {frame}: {', '.join(motion.hidden(frame))}")
    else:
        written = export_subject(load_subject(source), out)
    for path in written:
        stdout.print(str(path), highlight=False)
