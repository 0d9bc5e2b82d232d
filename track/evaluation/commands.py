"""Commands: simulate a performance with its truth, and score a motion by it."""

from __future__ import annotations

from pathlib import Path

import click

from capture.console import stdout

_PATH = click.Path(path_type=Path)


@click.command("simulate")
@click.option("--mesh", type=_PATH, help="A moving mesh (.npz: vertices (T, V, 3) m, faces (F, 3), fps).")
@click.option("--anatomy", help="The limb, as for `bonetrack adapt`: a name or a file; goes with --motion.")
@click.option("--motion", type=_PATH, help="CSV: time (s) and coordinates (rad, m) by name; NAME_deg is in degrees.")
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
    from capture.simulation.sensor import NoiseModel, carmine
    from capture.simulation.simulate import simulate_mesh_file

    if (mesh is None) == (anatomy is None) or (anatomy is None) != (motion is None):
        raise click.UsageError("give either --mesh, or --anatomy with --motion")
    model = carmine() if noise == "carmine" else NoiseModel()
    with stdout.status("simulating") as status:

        def progress(done: int) -> None:
            status.update(f"simulating: {done} frames done")

        if mesh is not None:
            recording = simulate_mesh_file(mesh, out, noise=model, seed=seed, overwrite=overwrite, progress=progress)
        else:
            from track.evaluation.simulate import simulate_performance

            performance = _performance(str(anatomy), motion or Path(), subject)
            recording = simulate_performance(
                performance, out, noise=model, seed=seed, overwrite=overwrite, progress=progress
            )
    frames = len(recording.sensors[0].frames)
    stdout.print(f"{frames} frames by {len(recording.sensors)} sensors written to {out}")


@click.command("evaluate")
@click.argument("motion", type=_PATH)
@click.option("--truth", required=True, type=_PATH, help="The simulated recording that the motion was tracked in.")
@click.option("--subject", required=True, type=_PATH, help="The subject that was tracked.")
@click.option("--out", type=_PATH, help="Write the table as JSON, too.")
def evaluate_command(motion: Path, truth: Path, subject: Path, out: Path | None) -> None:
    """Errors of MOTION against the known truth of a simulated recording."""
    from adapt.subject import load_subject
    from capture.own import refuse_foreign
    from capture.recording import open_recording
    from track.belonging import refuse_other_subject
    from track.evaluation.errors import MARK, evaluate_motion, write_evaluation
    from track.motion import load_motion

    if out is not None:
        refuse_foreign(out, MARK)
    tracked, person = load_motion(motion), load_subject(subject)
    refuse_other_subject(tracked, person)
    evaluation = evaluate_motion(tracked, person, open_recording(truth))
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
    claimed = f"{evaluation.claimed} of {evaluation.bones} bones in all frames are claimed to be known"
    stdout.print(f"{claimed}, and only those are scored", highlight=False)


def _performance(anatomy: str, motion: Path, subject: Path | None):  # type: ignore[no-untyped-def]
    from adapt.anatomy_file import load_anatomy
    from adapt.model.body import make_body
    from adapt.subject import load_subject
    from track.evaluation.performance import read_motion_table

    body = load_subject(subject, anatomy=anatomy).body if subject else make_body(load_anatomy(anatomy))
    return read_motion_table(motion, body)
