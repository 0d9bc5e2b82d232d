"""``python -m adapt.template_builder.first_pose make | train | export``: the network of the first pose."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import click

from adapt.template_builder.first_pose.make import make_shards
from adapt.template_builder.first_pose.options import TrainOptions
from capture.errors import BonetrackError

TEMPLATES = Path(__file__).resolve().parents[2] / "templates"
_FOLDER = click.Path(path_type=Path)


@click.group()
def main() -> None:
    """Simulate depth windows of people, train the network on them, write the file that ships."""


@main.command()
@click.argument("folder", type=_FOLDER)
@click.option("--seed", default=1, show_default=True, help="Another seed, other people, poses and rooms.")
@click.option("--shards", default=60, show_default=True, help="How many files of 1024 windows.")
def make(folder: Path, seed: int, shards: int) -> None:
    """Write shards of simulated windows into FOLDER; those that are there are kept."""
    _run(lambda: make_shards(folder, seed=seed, shards=shards, say=click.echo))


@main.command()
@click.argument("data", type=_FOLDER)
@click.argument("held", type=_FOLDER)
@click.argument("out", type=_FOLDER)
@click.option("--steps", default=12000, show_default=True, help="Steps in all; the learning rate falls over the last.")
@click.option("--batch", default=16, show_default=True, help="Windows a process takes each step.")
@click.option("--processes", default=1, show_default=True, help="Processes of one thread each.")
@click.option("--seed", default=0, show_default=True)
def train(data: Path, held: Path, out: Path, steps: int, batch: int, processes: int, seed: int) -> None:
    """Train on the shards of DATA, judge by those of HELD, keep everything in OUT; goes on from a checkpoint there."""
    _run(lambda: _train(data, held, out, steps, batch, processes, seed))


@main.command()
@click.argument("checkpoint", type=_FOLDER)
@click.option("--out", type=_FOLDER, default=TEMPLATES, help="Folder to write to.")
@click.option("--measured", type=_FOLDER, help="What track.evaluation.first_pose printed of it; asked for to ship.")
def export(checkpoint: Path, out: Path, measured: Path | None) -> None:
    """Write the network of CHECKPOINT as OpenCV runs it, and, with --measured, the record beside it."""
    _run(lambda: _export(checkpoint, out, measured))


def _train(data: Path, held: Path, out: Path, steps: int, batch: int, processes: int, seed: int) -> None:
    _require_torch()
    from adapt.template_builder.first_pose.train import train

    options = TrainOptions(steps=steps, batch=batch, processes=processes, seed=seed)
    train(data, held, out, options, click.echo)


def _export(checkpoint: Path, out: Path, measured: Path | None) -> None:
    if measured is None and out.resolve() == TEMPLATES:
        raise BonetrackError("what ships has a record of what was measured", remedy="give --measured, or another --out")
    _require_torch()
    from adapt.template_builder.first_pose.export import export

    export(checkpoint, out, None if measured is None else measured.read_text(encoding="utf-8"))


def _require_torch() -> None:
    if find_spec("torch") is None:
        raise BonetrackError("training needs torch", remedy="pip install '.[train]'")


def _run(work: Callable[[], None]) -> None:
    try:
        work()
    except BonetrackError as error:
        click.echo(f"error: {error}", err=True)
        sys.exit(1)


if __name__ == "__main__":
    main()
