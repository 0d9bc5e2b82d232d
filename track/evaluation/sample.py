"""Make the sample recording that ships in ``recordings/``: a random body that performs made-up motions.

python -m track.evaluation.sample --out recordings/upper-limb-right-sample
"""

from __future__ import annotations

from pathlib import Path

import click

from adapt.anatomy_file import load_anatomy
from track.evaluation.made_up_motions import perform
from track.evaluation.random_bodies import random_body
from track.simulation.simulate import simulate_performance

_SEED = 2015
_FPS = 20.0


@click.command()
@click.option("--anatomy", default="upper-limb-right", show_default=True)
@click.option("--motion", "motions", multiple=True, default=("twist", "bend-and-twist"), show_default=True)
@click.option("--out", required=True, type=click.Path(path_type=Path))
def main(anatomy: str, motions: tuple[str, ...], out: Path) -> None:
    """Simulate the sample recording."""
    body = random_body(load_anatomy(anatomy), _SEED)
    performance = perform(body, motions, seconds_each=2.0, fps=_FPS, seed=_SEED)
    simulate_performance(performance, out, seed=_SEED, overwrite=True)


if __name__ == "__main__":
    main()
