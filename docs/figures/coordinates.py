"""The coordinates of an anatomy as a Markdown table, for docs/coordinates.md.

python docs/figures/coordinates.py
"""

from __future__ import annotations

import click
import numpy as np

from adapt.anatomy import Anatomy, Coordinate
from adapt.anatomy_file import load_anatomy
from adapt.model.pose_space import is_free
from adapt.plain_words import plain_words


def coordinate_table(anatomy: Anatomy) -> str:
    """Name, joint, unit, range and rest value of every coordinate, in the order of theta."""
    # Where joints share a coordinate, it is the first one's: the others follow.
    joint_of = {name: joint for joint in reversed(anatomy.joints) for name in joint.coordinates}
    lines = [
        "| coordinate | in words | joint (type) | unit | range | at rest | positive means | 0 is |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for coordinate in anatomy.coordinates:
        joint = joint_of[coordinate.name]
        limits = ("any", "-", "m" if coordinate.unit == "m" else "rad")
        low, rest, unit = limits if is_free(joint) else _degrees(coordinate)
        words = plain_words(coordinate.name)
        cells = [words.name, f"{joint.name} ({joint.type})", unit, low, rest, words.positive, words.zero]
        lines.append(f"| `{coordinate.name}` | {' | '.join(cells)} |")
    return "\n".join(lines)


def _degrees(coordinate: Coordinate) -> tuple[str, str, str]:
    low, high, rest = np.rad2deg([coordinate.low, coordinate.high, coordinate.rest])
    return f"{low:.0f} to {high:.0f}°", f"{rest:.1f}°", "rad"


@click.command()
@click.option("--anatomy", default="upper-limb-right", show_default=True)
def main(anatomy: str) -> None:
    """Print the table."""
    click.echo(coordinate_table(load_anatomy(anatomy)))


if __name__ == "__main__":
    main()
