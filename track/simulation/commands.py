"""Command: simulate a performance with its truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from capture.console import stdout
from capture.progress import progress

if TYPE_CHECKING:
    from capture.simulation.mesh_axes import MeshAxes
    from track.simulation.performance import Performance

_PATH = click.Path(path_type=Path)


@click.command("simulate")
@click.option("--mesh", type=_PATH, help="A moving mesh (.npz: vertices (T, V, 3) m, faces (F, 3), fps).")
@click.option("--up", metavar="AXIS", help="The mesh's axis that points up, such as +z or -y; +y if not given.")
@click.option("--forward", metavar="AXIS", help="The one that points forward, to the sensors; +x if not given.")
@click.option("--anatomy", help="The limb, as for `bonetrack adapt`: a name or a file; goes with --motion.")
@click.option("--motion", type=_PATH, help="CSV: time (s) and coordinates (rad, m) by name; NAME_deg is in degrees.")
@click.option("--subject", type=_PATH, help="Who moves; the template itself if not given.")
@click.option("--noise", type=click.Choice(["carmine", "none"]), default="carmine", show_default=True)
@click.option("--seed", default=0, show_default=True)
@click.option("--out", required=True, type=_PATH, help="The recording to make.")
@click.option("--overwrite", is_flag=True, help="Replace a recording that stands there.")
def simulate_command(
    mesh: Path | None,
    up: str | None,
    forward: str | None,
    anatomy: str | None,
    motion: Path | None,
    subject: Path | None,
    noise: str,
    seed: int,
    out: Path,
    overwrite: bool,
) -> None:
    """Make the recording that two depth sensors would have made of a moving mesh or subject."""
    from capture.simulation.mesh_file import simulate_mesh_file
    from capture.simulation.sensor import NoiseModel, carmine

    if (mesh is None) == (anatomy is None) or (anatomy is None) != (motion is None):
        raise click.UsageError("give either --mesh, or --anatomy with --motion")
    axes = _mesh_axes(up, forward, mesh)
    model = carmine() if noise == "carmine" else NoiseModel()
    with progress("simulating") as work:
        if mesh is not None:
            recording = simulate_mesh_file(
                mesh,
                out,
                axes=axes,
                noise=model,
                seed=seed,
                overwrite=overwrite,
                progress=lambda done: work.at(done, note=f"{done} frames"),
            )
        else:
            from track.simulation.simulate import simulate_performance

            performance = _performance(str(anatomy), motion or Path(), subject)
            total = len(performance.times)
            recording = simulate_performance(
                performance,
                out,
                noise=model,
                seed=seed,
                overwrite=overwrite,
                progress=lambda done: work.at(done, total, f"{done} of {total} frames"),
            )
    frames = len(recording.sensors[0].frames)
    stdout.print(f"{frames} frames by {len(recording.sensors)} sensors written to {out}")


def _mesh_axes(up: str | None, forward: str | None, mesh: Path | None) -> MeshAxes | None:
    from capture.simulation.mesh_axes import MeshAxes

    if up is None and forward is None:
        return None
    if mesh is None or up is None or forward is None:
        raise click.UsageError("give --up and --forward together, and with --mesh")
    return MeshAxes(up, forward)


def _performance(anatomy: str, motion: Path, subject: Path | None) -> Performance:
    from adapt.anatomy_file import load_anatomy
    from adapt.model.body import make_body
    from adapt.subject import load_subject
    from track.simulation.motion_table import read_motion_table

    body = load_subject(subject, anatomy=anatomy).body if subject else make_body(load_anatomy(anatomy))
    return read_motion_table(motion, body)
