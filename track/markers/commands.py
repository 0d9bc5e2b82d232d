"""Command: a laboratory's markers beside a motion."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from capture.console import stdout

if TYPE_CHECKING:
    from adapt.anatomy import Floats
    from track.markers.align import Alignment

_PATH = click.Path(path_type=Path)


@click.command("import-markers")
@click.argument("trial", type=_PATH)
@click.option("--beside", "motion", required=True, type=_PATH, help="The motion that was recorded at the same time.")
@click.option("--subject", required=True, type=_PATH, help="The subject of the motion.")
@click.option("--out", required=True, type=_PATH, help="The folder to write.")
@click.option(
    "--pair",
    "pairs",
    type=(str, str),
    multiple=True,
    metavar="MARKER POINT",
    help="A marker and the landmark or joint centre that it goes with; those of the same name go together anyhow.",
)
@click.option(
    "--offset", type=float, help="Time of the trial's zero in the recording (s) [default: found from what moves]."
)
@click.option(
    "--points",
    type=_PATH,
    help="Points known in both frames, as a table: x,y,z there, x,y,z here (m) [default: the pairs tell].",
)
def import_markers_command(
    trial: Path,
    motion: Path,
    subject: Path,
    out: Path,
    pairs: tuple[tuple[str, str], ...],
    offset: float | None,
    points: Path | None,
) -> None:
    """Bring a marker TRIAL (.trc or .c3d) into a motion's frame and clock, and say how far apart the two are."""
    from adapt.subject import load_subject
    from track.belonging import refuse_other_subject
    from track.export.c3d import c3d_points
    from track.markers.align import align, pairs_of
    from track.markers.files import write_beside
    from track.markers.read import MarkerError, read_markers
    from track.motion import load_motion

    read, moved, whose = read_markers(trial), load_motion(motion), load_subject(subject)
    refuse_other_subject(moved, whose)
    ours = c3d_points(moved, whose)
    placed = None if points is None else _stated(points)
    try:
        alignment = align(read, moved, ours, pairs_of(read, ours, dict(pairs)), offset_s=offset, motion_from_lab=placed)
    except MarkerError as error:  # it knows the markers, not the file they came from
        raise MarkerError(error.problem, where=error.where or trial, remedy=error.remedy) from error
    paths = write_beside(read, alignment, moved, whose, ours, out)
    _say(alignment)
    for path in paths:
        stdout.print(str(path), highlight=False)


def _stated(path: Path) -> Floats:
    """The transform (4, 4) of the points in a table, and how far they remain apart."""
    from track.markers.align import LARGEST_POINTS_M, transform_of_points
    from track.markers.read import MarkerError, read_point_pairs

    lab, here = read_point_pairs(path)
    try:
        placed, apart = transform_of_points(lab, here)
    except MarkerError as error:
        raise MarkerError(error.problem, where=path, remedy=error.remedy) from error
    words = ", ".join(f"{1e3 * far:.1f}" for far in apart)
    stdout.print(f"{path.name}: {len(apart)} points are {words} mm apart", highlight=False)
    if apart.max() > LARGEST_POINTS_M:
        problem = f"its points do not lie alike: {1e3 * apart.max():.0f} mm apart at best"
        raise MarkerError(problem, where=path, remedy="check their order, and that all are in metres")
    return placed


def _say(alignment: Alignment) -> None:
    """The time, and a line for each pair."""
    import numpy as np

    sure = (
        "as stated" if alignment.deviation_s is None else f"by what moves, one SD {1e3 * alignment.deviation_s:.0f} ms"
    )
    stdout.print(f"the trial's time 0 is {alignment.offset_s:.3f} s in the recording ({sure})", highlight=False)
    known = {pair: 1e3 * far[np.isfinite(far)] for pair, far in alignment.apart.items() if np.isfinite(far).any()}
    wide = max(len(f"{marker} to {point}") for marker, point in known)
    stdout.print(f"{'mm apart':{wide}}  frames  median     RMS     most", highlight=False)
    for (marker, point), far in known.items():
        rms = float(np.sqrt((far**2).mean()))
        name = f"{marker} to {point}"
        stdout.print(
            f"{name:{wide}}  {len(far):6d}  {np.median(far):6.1f}  {rms:6.1f}  {far.max():7.1f}",
            highlight=False,
            markup=False,
        )
