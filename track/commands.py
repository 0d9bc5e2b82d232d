"""The command line of the track package."""

from __future__ import annotations

from pathlib import Path

import click

from capture.commands import as_region, region_option
from capture.console import stdout

_PATH = click.Path(path_type=Path)


@click.command("simulate")
@click.option("--mesh", type=_PATH, help="A moving mesh (.npz: vertices (T, V, 3) m, faces (F, 3), fps).")
@click.option("--anatomy", help="The limb, as upper-limb-right or lower-limb-left; goes with --motion.")
@click.option("--motion", type=_PATH, help="CSV: time (s) and coordinates (rad, m) by name.")
@click.option("--subject", type=_PATH, help="Who moves; the template itself if not given.")
@click.option("--noise", type=click.Choice(["carmine", "none"]), default="carmine", show_default=True)
@click.option("--seed", default=0, show_default=True)
@click.option("--out", required=True, type=_PATH, help="The recording to make.")
@click.option("--overwrite", is_flag=True, help="Replace a recording that stands there.")
def simulate_command(
    mesh: Path | None,
    anatomy: str | None,
    motion: Path | None,
    subject: Path | None,
    noise: str,
    seed: int,
    out: Path,
    overwrite: bool,
) -> None:
    """Make the recording that two depth sensors would have made of a moving mesh or subject."""
    from capture.sensor import NoiseModel, carmine
    from capture.simulate import simulate_mesh_file

    if (mesh is None) == (anatomy is None) or (anatomy is None) != (motion is None):
        raise click.UsageError("give either --mesh, or --anatomy with --motion")
    model = carmine() if noise == "carmine" else NoiseModel()
    with stdout.status("simulating") as status:

        def progress(done: int) -> None:
            status.update(f"simulating: {done} frames done")

        if mesh is not None:
            recording = simulate_mesh_file(mesh, out, noise=model, seed=seed, overwrite=overwrite, progress=progress)
        else:
            from track.simulate import simulate_performance

            performance = _performance(str(anatomy), motion or Path(), subject)
            recording = simulate_performance(
                performance, out, noise=model, seed=seed, overwrite=overwrite, progress=progress
            )
    frames = len(recording.sensors[0].frames)
    stdout.print(f"{frames} frames by {len(recording.sensors)} sensors written to {out}")


@click.command("track")
@click.argument("recording", type=_PATH)
@click.option("--subject", required=True, type=_PATH, help="The subject, from `bonetrack adapt`.")
@click.option("--out", required=True, type=_PATH, help="The motion folder to write.")
@click.option("--anatomy", default=None, help="Refuse subjects of another anatomy.")
@click.option("--thorax", type=_PATH, help="JSON with the thorax frame (4 x 4) in the recording: adds ISB angles.")
@region_option
def track_command(
    recording: Path,
    subject: Path,
    out: Path,
    anatomy: str | None,
    thorax: Path | None,
    region: tuple[float, ...] | None,
) -> None:
    """Track SUBJECT through RECORDING; a run that was cut short goes on where it stopped."""
    from rich.progress import Progress

    from adapt.subject import load_subject
    from capture.recording import open_recording
    from track.angles import read_thorax
    from track.run import track_recording

    opened = open_recording(recording)
    person = load_subject(subject, anatomy=anatomy)
    frame = read_thorax(thorax) if thorax else None
    with Progress(console=stdout, transient=True) as bar:
        task = bar.add_task("tracking", total=None)
        motion = track_recording(
            opened,
            person,
            out,
            region=as_region(region),
            world_from_thorax=frame,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )
    print_motion(motion)
    stdout.print(f"motion written to {out}")


def print_motion(motion) -> None:  # type: ignore[no-untyped-def]
    """A short summary: frames tracked, how well, and why others were lost."""
    import numpy as np

    tracked = motion.tracked
    stdout.print(f"{int(tracked.sum())} of {len(tracked)} frames tracked", highlight=False)
    if tracked.any():
        residual = 1e3 * float(np.median(motion.residuals[tracked]))
        coverage = 100.0 * float(np.median(motion.coverage[tracked]))
        stdout.print(f"skin to cloud {residual:.2f} mm (median), {coverage:.0f} % of the visible skin found")
    for number in np.flatnonzero(~tracked)[:5]:
        stdout.print(f"lost at {motion.times[number]:.3f} s: {motion.lost[number]}")
    if (~tracked).sum() > 5:
        stdout.print(f"... and {int((~tracked).sum()) - 5} more, see quality.csv")


@click.command("evaluate")
@click.argument("motion", type=_PATH)
@click.option("--truth", required=True, type=_PATH, help="The simulated recording that the motion was tracked in.")
@click.option("--subject", required=True, type=_PATH, help="The subject that was tracked.")
@click.option("--out", type=_PATH, help="Write the table as JSON, too.")
def evaluate_command(motion: Path, truth: Path, subject: Path, out: Path | None) -> None:
    """Errors of MOTION against the known truth of a simulated recording."""
    from adapt.subject import load_subject
    from capture.recording import open_recording
    from track.evaluate import evaluate_motion, write_evaluation
    from track.motion import load_motion

    evaluation = evaluate_motion(load_motion(motion), load_subject(subject), open_recording(truth))
    print_evaluation(evaluation)
    if out is not None:
        write_evaluation(evaluation, out)


def print_evaluation(evaluation) -> None:  # type: ignore[no-untyped-def]
    """The error table."""
    from rich.table import Table

    table = Table("error", "unit", "mean", "SD", "max", "within 2 stated SD", title="errors against the truth")
    for row in evaluation.summaries():
        covered = "" if row.covered is None else f"{100 * row.covered:.0f} %"
        table.add_row(row.name, row.unit, f"{row.mean:.2f}", f"{row.sd:.2f}", f"{row.maximum:.2f}", covered)
    stdout.print(table)
    stdout.print(f"{evaluation.lost} of {evaluation.frames} frames lost", highlight=False)


@click.command("export")
@click.argument("source", type=_PATH)
@click.option("--subject", type=_PATH, help="The subject of a motion.")
@click.option("--frame", type=int, help="Also write skin and bones of this frame of a motion.")
@click.option("--out", required=True, type=_PATH, help="The folder to write.")
def export_command(source: Path, subject: Path | None, frame: int | None, out: Path) -> None:
    """Write a subject or a motion (SOURCE) in formats that other tools read: PLY, .mot, .trc, CSV."""
    from adapt.subject import load_subject
    from track.export import export_motion, export_subject
    from track.motion import load_motion

    if source.is_dir():
        if subject is None:
            raise click.UsageError("a motion is exported with the subject it belongs to: give --subject")
        written = export_motion(load_motion(source), load_subject(subject), out, frame=frame)
    else:
        written = export_subject(load_subject(source), out)
    for path in written:
        stdout.print(str(path), highlight=False)


@click.command("demo")
@click.option("--anatomy", default="upper-limb-right", show_default=True, help="Whose sample recording.")
@click.option("--out", type=_PATH, default=Path("demo"), show_default=True, help="The folder to write.")
def demo_command(anatomy: str, out: Path) -> None:
    """The whole main job on a sample recording: calibrate, adapt, track, compare with the truth."""
    from track.demo import run_demo

    run_demo(out, anatomy=anatomy)


def _performance(anatomy: str, motion: Path, subject: Path | None):  # type: ignore[no-untyped-def]
    from adapt.anatomy import load_anatomy
    from adapt.model.body import make_body
    from adapt.subject import load_subject
    from track.performance import read_motion_table

    template = load_anatomy(anatomy)
    body = load_subject(subject, anatomy=template.name).body if subject else make_body(template)
    return read_motion_table(motion, body)
