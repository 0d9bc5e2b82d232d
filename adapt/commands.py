"""The command line of the adapt package."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from capture.commands.region_options import near_option, region_option
from capture.commands.written_file import WrittenFile
from capture.console import stdout, tell
from capture.progress import progress

if TYPE_CHECKING:
    from adapt.subject import Subject


@click.command("adapt")
@click.argument("recording", type=click.Path(path_type=Path))
@click.option(
    "--anatomy", required=True, help="The limb, as upper-limb-right or lower-limb-left, or an anatomy file (.npz)."
)
@click.option("--out", required=True, type=WrittenFile(".npz", "a subject"), help="The subject file to write (.npz).")
@click.option("--poses", default=6, show_default=True, help="Number of example poses, 4 to 8.")
@click.option("--frames", default=None, help="Frames to adapt to, such as 0,12,40,77, instead of the automatic choice.")
@click.option(
    "--first-poses",
    default=None,
    type=click.Path(path_type=Path),
    help="CSV with a column `frame` and coordinates (rad, m; NAME_deg: degrees): first poses, instead of a search.",
)
@region_option
@near_option
@click.option("--height", type=float, default=None, help="How tall the person is, in metres, such as 1.78.")
@click.option("--mass", type=float, default=None, help="The person's mass in kilograms.")
@click.option("--sex", type=click.Choice(["male", "female"]), default=None, help="The person's sex.")
def adapt_command(
    recording: Path,
    anatomy: str,
    out: Path,
    poses: int,
    frames: str | None,
    first_poses: Path | None,
    region: tuple[float, ...] | None,
    near: tuple[float, ...] | None,
    height: float | None,
    mass: float | None,
    sex: str | None,
) -> None:
    """Adapt an anatomy to the person in RECORDING; a run that was cut short goes on where it stopped."""
    from adapt.adapt_to_file import adapt_into
    from adapt.anatomy_file import load_anatomy
    from adapt.fit.first_poses import read_first_poses
    from adapt.model.shape.population import Person
    from adapt.options import AdaptOptions
    from capture.commands.region_options import region_near
    from capture.recording import open_recording

    person = Person(height, mass, sex)
    template = load_anatomy(anatomy)
    opened = open_recording(recording)
    options = AdaptOptions(
        poses=poses,
        frames=_frame_numbers(frames),
        first_poses=read_first_poses(first_poses, template) if first_poses else {},
        region=region_near(opened, region, near),
        person=person,
    )
    with progress("adapting") as work:
        subject = adapt_into(
            out, opened, template, options, progress=lambda words, share: work.at(share, 1.0, words), told=tell
        )
    print_subject(subject, out)


def print_subject(subject: Subject, out: Path) -> None:
    """A short summary of how the adaptation went."""
    from rich.table import Table

    from adapt.subject import doubts

    report = subject.report

    table = Table("time (s)", "skin to cloud (mm)", "skin found", "cloud unexplained", "matched skin (mm)")
    table.title = "example poses"
    for pose in report["poses"]:
        table.add_row(
            f"{pose['time_s']:.2f}",
            f"{pose['skin_to_cloud_mm']:.1f}",
            f"{100 * pose['coverage']:.0f} %",
            f"{100 * pose['unexplained']:.0f} %",
            f"{pose['median_distance_mm']:.2f}",
        )
    stdout.print(table)
    print_sensors(report["settings"])
    for frame in report["left_out"]:
        stdout.print(f"not adapted to, at {frame['time_s']:.2f} s: {frame['reason']}", highlight=False)
    for doubt in doubts(subject):
        stdout.print(doubt, highlight=False)
    sizes = [f"{joint} {size['scale']:.2f} ± {size['sd']:.2f}" for joint, size in report["scales"].items()]
    stdout.print(f"size against the template: {', '.join(sizes)}", highlight=False)
    _print_lengths(report)
    stdout.print(f"skin and cloud disagree by {report['noise_mm']:.1f} mm a patch of 3 cm", highlight=False)
    if report.get("bones_never_seen"):
        guesses = ", ".join(report["lengths_guessed"])
        stdout.print(f"never seen: {', '.join(report['bones_never_seen'])}; how long these are is a guess: {guesses}")
    if report["landmarks_never_shown"]:
        stdout.print(f"never seen in any pose: {', '.join(report['landmarks_never_shown'])}")
    stdout.print(f"subject written to {out}")


def _print_lengths(report: Mapping[str, Any]) -> None:
    """Where something is stated of the person, what that says of the bones' lengths, and what it buys."""
    if "person" not in report:
        return
    from rich.table import Table

    from adapt.model.shape.population import Person

    person = Person(**report["person"])
    if not person.is_surveyed:
        stdout.print(
            "nobody of that height or mass was surveyed: a body of usual proportions is expected", highlight=False
        )
    table = Table("bone", "expected (mm)", "fitted (mm)", "without that (mm)")
    table.title = f"joint to joint, {person.in_words()}"
    for told in report["lengths"]:
        table.add_row(
            told["bone"],
            f"{told['expected_mm']:.0f} ± {told['expected_sd_mm']:.0f}",
            f"{told['length_mm']:.0f} ± {told['sd_mm']:.1f}",
            f"± {told['sd_of_anybody_mm']:.1f}",
        )
    stdout.print(table)


def print_sensors(settings: Mapping[str, Any]) -> None:
    """What was mended or left out, and how many frames of each sensor were used, with a warning where few were."""
    from capture.provenance import sensors_in_words

    for line in sensors_in_words(settings):
        stdout.print(line, highlight=False)


def _frame_numbers(text: str | None) -> list[int] | None:
    if text is None:
        return None
    try:
        return [int(part) for part in text.split(",")]
    except ValueError:
        raise click.BadParameter("give whole numbers separated by commas", param_hint="--frames") from None
