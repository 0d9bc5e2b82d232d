"""Command: what differs between motions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from capture.console import stdout, tell
from track.curves.commands import by_option, curves_of, cutoff_option, events_option, open_motion

if TYPE_CHECKING:
    from track.curves.comparison import Comparison
    from track.curves.comparison_files import Mapped
    from track.curves.motion_curves import EventsAsked
    from track.motion import Motion

_PATH = click.Path(path_type=Path)


@click.command("compare")
@click.argument("motions", nargs=-1, type=_PATH, required=True)
@click.option("--label", "labels", multiple=True, help="Of each motion, in their order; equal ones make a group.")
@click.option("--subject", "subjects", multiple=True, type=_PATH, help="A subject of your own anatomy.")
@click.option("--out", required=True, type=_PATH, help="The folder to write.")
@cutoff_option
@events_option
@by_option
@click.option("--spm", is_flag=True, help="Also test whole curves by statistical parametric mapping.")
def compare_command(
    motions: tuple[Path, ...],
    labels: tuple[str, ...],
    subjects: tuple[Path, ...],
    out: Path,
    cutoff: float | None,
    events: EventsAsked,
    by: str | None,
    spm: bool,
) -> None:
    """Lay the cycles of MOTIONS over each other and say how they differ from the first.

    Before and after, left and right, several people: motions with one label are a group.
    """
    from track.curves.comparison import Labelled, compare
    from track.curves.comparison_files import write_comparison
    from track.curves.motion_curves import CurvesOptions
    from track.curves.parametric_mapping import parametric_mapping, refuse_without_spm1d

    if labels and len(labels) != len(motions):
        raise click.UsageError(f"{len(labels)} labels for {len(motions)} motions: give one for each")
    if spm:
        refuse_without_spm1d()
    options = CurvesOptions(cutoff_hz=cutoff, events=events, by=by)
    labelled = []
    for path, label in zip(motions, labels or labels_of(motions), strict=True):
        motion, anatomy = open_motion(path, subjects)
        labelled.append(Labelled(label, curves_of(path, motion, anatomy, options), subject_of(motion)))
    found = compare(labelled)
    mapped = {}
    for angle in found.angles if spm else ():
        for sample in angle.samples[1:]:
            if (tested := parametric_mapping(angle.samples[0].values, sample.values)) is not None:
                mapped[angle.key, sample.label] = tested
    written = write_comparison(found, mapped, out)
    _print(found, mapped, spm=spm)
    for path in written:
        stdout.print(str(path), highlight=False)


def labels_of(motions: Sequence[Path]) -> tuple[str, ...]:
    """What motions are called where nobody says: person and session as noted of them, or their folders' names.

    No two are called alike, for one name would make them a group.

    >>> labels_of([Path("/lab/before/motion"), Path("/lab/after/motion")])
    ('before/motion', 'after/motion')
    """
    from track.about import read_about

    notes = [read_about(path) for path in motions]
    places = [path.resolve() for path in motions]
    ways = (
        [
            " ".join(filter(None, (about.person, about.session))) or at.name
            for about, at in zip(notes, places, strict=True)
        ],
        [f"{at.parent.name}/{at.name}" for at in places],
        [f"{at} ({number})" for number, at in enumerate(places, start=1)],
    )
    return tuple(next(names for names in ways if len(set(names)) == len(names)))


def subject_of(motion: Motion) -> str | None:
    """What tells which subject file a motion was tracked with; None of motions that do not say so."""
    return None if motion.settings is None else motion.settings.options.get("subject_fingerprint")


def _print(found: Comparison, mapped: Mapped, *, spm: bool) -> None:
    """The differences of ranges, and where curves differ, in a few lines."""
    first, *others = found.labels
    for angle in found.angles:
        for label, numbers in zip(others, angle.numbers, strict=True):
            number = next(one for one in numbers if one.name == "range")
            sure = "" if number.low != number.low else f" ({number.low:+.1f} to {number.high:+.1f})"
            line = f"{angle.words.label}, range: {number.first:.1f} {number.unit} {first}, {number.other:.1f} {label}"
            sides = "" if number.symmetry is None else f", symmetry index {number.symmetry:+.0f} %"
            tell(f"{line}: {number.difference:+.1f}{sure}{sides}")
            if not spm:
                continue
            if (tested := mapped.get((angle.key, label))) is None:
                tell("  not tested as curves: that needs three cycles in both groups")
            else:
                where = ", ".join(f"{a:.0f} to {b:.0f} % (p = {p:.3f})" for a, b, p in tested.clusters)
                tell(f"  curves differ from {where}" if where else "  curves are not shown to differ")
    for line in found.told:
        tell(line)
