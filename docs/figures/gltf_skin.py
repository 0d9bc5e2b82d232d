"""How far a glTF file's linearly blended skin is off the model's, with helper joints and without, for docs/exports.md.

python docs/figures/gltf_skin.py
"""

from __future__ import annotations

import click
import numpy as np
from rich.table import Table

from adapt.anatomy import Floats
from adapt.anatomy_file import load_anatomy
from adapt.model.body import Body, make_body, rest_theta
from capture.console import stdout
from track.export.linear_skin import STEPS, linear_skin, skin_gap

POSES = {
    "upper-limb-right": (("pro_sup", -90.0), ("pro_sup", 90.0)),
    "lower-limb-right": (
        ("knee_angle_r", 60.0),
        ("knee_angle_r", 120.0),
        ("hip_flexion_r", 45.0),
        ("hip_flexion_r", 120.0),
        ("ankle_angle_r", -40.0),
        ("ankle_angle_r", 30.0),
    ),
}


def anywhere(body: Body) -> Floats:
    """Poses (30, n) drawn evenly from all ranges."""
    thetas = np.tile(rest_theta(body), (30, 1))
    low, high = np.array([(c.low, c.high) for c in body.anatomy.coordinates[6:]]).T  # the free joint has six
    thetas[:, 6:] = np.random.default_rng(0).uniform(low, high, (len(thetas), len(low)))
    return thetas


@click.command()
def main() -> None:
    """Measure one coordinate at a time, the others at rest; then random poses."""
    shown = Table("coordinate", "degrees", "joints per turn", "mean (mm)", "largest (mm)")
    for name, poses in POSES.items():
        body = make_body(load_anatomy(name))
        for coordinate, degrees in poses:
            theta = rest_theta(body)
            theta[body.anatomy.coordinate_index(coordinate)] = np.deg2rad(degrees)
            rest = rest_theta(body)
            thetas = rest + np.linspace(0.0, 1.0, 9)[:, None] * (theta - rest)  # a motion from rest to there
            for steps in (1, STEPS):
                gap = skin_gap(linear_skin(body, thetas, steps=steps), [theta])
                cells = (f"{1e3 * gap.mean_m:.2f}", f"{1e3 * gap.largest_m:.1f}")
                shown.add_row(coordinate, f"{degrees:.0f}", str(steps - 1), *cells)
        for steps in (1, STEPS):
            gap = skin_gap(linear_skin(body, anywhere(body), steps=steps), anywhere(body))
            shown.add_row(f"{name}, all", "", str(steps - 1), f"{1e3 * gap.mean_m:.2f}", f"{1e3 * gap.largest_m:.1f}")
    stdout.print(shown)


if __name__ == "__main__":
    main()
