"""Command: the curves of a motion."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from capture.console import stdout, tell

if TYPE_CHECKING:
    from collections.abc import Sequence

    from adapt.anatomy import Anatomy
    from track.curves.motion_curves import CurvesOptions, EventsAsked, MotionCurves
    from track.motion import Motion

_PATH = click.Path(path_type=Path)
cutoff_option = click.option(
    "--cutoff", type=click.FloatRange(0.0, min_open=True), metavar="HZ", help="Smooth so; else by residual analysis."
)
events_option = click.option(
    "--events",
    type=click.Choice(["auto", "gait", "repetitions", "none"]),
    default="auto",
    show_default=True,
    help="What cuts the motion into cycles; auto is gait where a leg walks, else repetitions.",
)
by_option = click.option("--by", metavar="COORDINATE", help="The angle that repeats; else the one that moves most.")


@click.command("curves")
@click.argument("motion", type=_PATH)
@click.option("--subject", type=_PATH, help="Who was tracked; only a subject of your own anatomy is needed.")
@click.option("--out", required=True, type=_PATH, help="The folder to write.")
@cutoff_option
@events_option
@by_option
def curves_command(
    motion: Path, subject: Path | None, out: Path, cutoff: float | None, events: EventsAsked, by: str | None
) -> None:
    """Smooth the angles of MOTION; write speeds, events, cycles, ranges: tables, a summary and a picture."""
    from track.about import read_about
    from track.curves.files import write_curves
    from track.curves.motion_curves import CurvesOptions

    options = CurvesOptions(cutoff_hz=cutoff, events=events, by=by)
    found = curves_of(motion, *open_motion(motion, [] if subject is None else [subject]), options)
    about = read_about(motion)
    written = write_curves(found, options, about, out, title=about.title or motion.resolve().name)
    _print(found)
    for path in written:
        stdout.print(str(path), highlight=False)


def open_motion(path: Path, subjects: Sequence[Path]) -> tuple[Motion, Anatomy]:
    """A motion and its anatomy: of one of the subjects, or the one that ships under its name.

    Raises:
        MotionError: no motion, a subject of another anatomy, or an anatomy that neither ships nor is a subject's.
    """
    from adapt.anatomy_file import anatomy_names, load_anatomy
    from adapt.subject import load_subject
    from track.motion import MotionError, load_motion

    motion = load_motion(path)
    own = {person.anatomy.name: person.anatomy for person in map(load_subject, subjects)}
    if motion.anatomy in own:
        return motion, own[motion.anatomy]
    if motion.anatomy in anatomy_names():
        return motion, load_anatomy(motion.anatomy)
    problem = f"is of the anatomy {motion.anatomy}, which does not ship with bonetrack"
    raise MotionError(problem, where=path, remedy="give --subject")


def curves_of(path: Path, motion: Motion, anatomy: Anatomy, options: CurvesOptions) -> MotionCurves:
    """The curves of a motion; what is wrong is told with its name.

    Raises:
        CurvesError: see ``motion_curves``.
    """
    from track.curves.motion_curves import CurvesError, motion_curves

    try:
        return motion_curves(motion, anatomy, options)
    except CurvesError as error:
        raise CurvesError(error.problem, where=path, remedy=error.remedy) from error


def _print(found: MotionCurves) -> None:
    """Ranges, cycles and what is to be told, in a few lines."""
    import numpy as np

    from track.curves.ranges import range_of
    from track.poses_by_hand import UNITS, as_shown

    for curve in found.curves.values():
        span, factor = range_of(curve, found.times), as_shown(curve.coordinate, 1.0)
        if span is not None:
            ends = " to ".join(f"{factor * end.value:.1f} ± {factor * end.sd:.1f}" for end in (span.low, span.high))
            unit = UNITS[curve.coordinate.unit]
            tell(f"{curve.words.label}: {ends} {unit}; smoothed at {curve.cutoff_hz:.1f} Hz ({curve.chosen})")
    if found.cycles:
        seconds = np.array([cycle.end - cycle.start for cycle in found.cycles])
        spread = f" (SD {seconds.std(ddof=1):.2f})" if len(seconds) > 1 else ""
        many = f"{len(seconds)} {found.kind}" + ("s" if len(seconds) > 1 else "")
        told = "" if found.kind == "stride" else f" of {found.curves[found.by].words.name}"
        tell(f"{many}{told}, {seconds.mean():.2f} s{spread}")
    for line in found.told:
        tell(line)
