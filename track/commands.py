"""Commands: track a recording, and the whole main job on a sample."""

from __future__ import annotations

from pathlib import Path

import click

from capture.commands.region_options import near_option, region_near, region_option
from capture.console import stdout, tell
from capture.progress import progress
from track.motion_summary import print_motion

_PATH = click.Path(path_type=Path)


@click.command("track")
@click.argument("recording", type=_PATH)
@click.option("--subject", required=True, type=_PATH, help="The subject, from `bonetrack adapt`.")
@click.option("--out", required=True, type=_PATH, help="The motion folder to write.")
@click.option("--anatomy", default=None, help="Refuse subjects of another anatomy, or anatomy file.")
@click.option("--thorax", type=_PATH, help="JSON with the thorax frame (4 x 4) in the recording: adds ISB angles.")
@click.option(
    "--poses",
    type=_PATH,
    help="Poses set by hand (JSON, from `bonetrack view`): tracking starts from each, onward and back into the gap.",
)
@region_option
@near_option
@click.option("--keep-searching", is_flag=True, help="Go on where none of a few frames looked at shows the subject.")
@click.option(
    "--threshold",
    nargs=2,
    type=(str, float),
    multiple=True,
    metavar="NAME VALUE",
    help="Another value of what decides, under the name that the report has for it.",
)
def track_command(
    recording: Path,
    subject: Path,
    out: Path,
    anatomy: str | None,
    thorax: Path | None,
    poses: Path | None,
    region: tuple[float, ...] | None,
    near: tuple[float, ...] | None,
    keep_searching: bool,
    threshold: tuple[tuple[str, float], ...],
) -> None:
    """Track SUBJECT through RECORDING; a run that was cut short goes on where it stopped."""
    from adapt.subject import load_subject
    from capture.recording import instants, open_recording
    from track.angles import read_thorax
    from track.belonging import adapted_elsewhere
    from track.options import TrackOptions
    from track.poses_by_hand import read_poses
    from track.thresholds import thresholds_of
    from track.track_recording import track_recording

    opened = open_recording(recording)
    person = load_subject(subject, anatomy=anatomy)
    if elsewhere := adapted_elsewhere(person, opened):
        stdout.print(elsewhere, highlight=False)
    options = TrackOptions(
        region=region_near(opened, region, near),
        poses=read_poses(poses, person.anatomy, frames=len(instants(opened))) if poses else (),
        world_from_thorax=read_thorax(thorax) if thorax else None,
        keep_searching=keep_searching,
        thresholds=thresholds_of(threshold),
    )
    with progress("tracking") as work:
        motion = track_recording(
            opened,
            person,
            out,
            options,
            progress=lambda done, total: work.at(done, total, f"{done} of {total} frames"),
            told=tell,
        )
    print_motion(motion, person)
    stdout.print(f"motion written to {out}")


@click.command("demo")
@click.option("--anatomy", default="upper-limb-right", show_default=True, help="Whose sample recording.")
@click.option("--out", type=_PATH, default=Path("demo"), show_default=True, help="The folder to write.")
def demo_command(anatomy: str, out: Path) -> None:
    """The whole main job on a sample recording: calibrate, adapt, track, compare with the truth."""
    from track.demo import run_demo

    run_demo(out, anatomy=anatomy)
