"""What the sign of each coordinate means: every joint angle at zero, and where it is positive.

    python docs/figures/signs.py --out docs/images

Writes ``signs-upper-limb-right.png`` and ``signs-lower-limb-right.png``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import numpy as np

from adapt.anatomy import Anatomy, Joint, load_anatomy
from adapt.model.body import Body, joint_centres, make_body
from capture.files import replaced_when_complete
from track.evaluation.bones import pose
from track.view.pictures import body_layers
from track.view.render import framing_camera, look_at, render

ANATOMIES = ("upper-limb-right", "lower-limb-right")
RIGHT, FRONT = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])  # where the eye is
FROM_THE_FRONT = ("pro_sup", "flexion", "hip_adduction_r", "hip_rotation_r")
# By joint: the joint in the middle of the picture, how far one sees (m), how far below that the middle lies (m).
SIGHT = {"elbow": ("elbow", 0.3, 0.0), "radioulnar": ("wrist", 0.24, 0.0), "wrist": ("wrist", 0.2, 0.06)}
SIGHT |= {"hip": ("hip", 0.6, 0.38), "knee": ("knee", 0.45, 0.05), "ankle": ("ankle", 0.2, 0.0)}
SHARE = 0.7  # of the range above zero


def turning(anatomy: Anatomy) -> list[tuple[str, Joint]]:
    """The joint angles, each with its (first) joint."""
    found: dict[str, Joint] = {}
    for joint in anatomy.joints:
        if joint.type != "free":
            for name in joint.coordinates:
                found.setdefault(name, joint)
    return list(found.items())


def panel(axes: Any, body: Body, name: str, joint: Joint, degrees: float) -> None:
    """One pose: every angle at zero but one."""
    zero = {other: 0.0 for other, _ in turning(body.anatomy)}
    theta = pose(body, **(zero | {name: degrees}))
    centre, reach, below = SIGHT[joint.name]
    middle = joint_centres(body, pose(body, **zero))[centre] - [0.0, below, 0.0]
    eye_from = FRONT if name in FROM_THE_FRONT else RIGHT
    across = np.cross([0.0, 1.0, 0.0], eye_from)
    cube = middle + reach * np.array([x * across + [0.0, y, 0.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)])
    eye = look_at(cube, eye_from, np.array([0.0, 1.0, 0.0]))
    axes.imshow(
        render(body_layers(body, theta, skin_opacity=0.45), eye, framing_camera(eye, cube, width=300, height=300))
    )
    seen = "front" if name in FROM_THE_FRONT else "right"
    axes.set_title(f"{name} {degrees:+.0f}°\nfrom the {seen}" if degrees else f"{name} 0°", fontsize="small")
    axes.axis("off")


def picture(anatomy: Anatomy, path: Path) -> None:
    """Zero above, positive below."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    body, angles = make_body(anatomy), turning(anatomy)
    figure = Figure(figsize=(2.4 * len(angles), 5.4), layout="constrained")
    FigureCanvasAgg(figure)
    for column, (name, joint) in zip(figure.subplots(2, len(angles)).T, angles, strict=True):
        high = anatomy.coordinates[anatomy.coordinate_index(name)].high
        panel(column[0], body, name, joint, 0.0)
        panel(column[1], body, name, joint, round(SHARE * float(np.rad2deg(high))))
    with replaced_when_complete(path) as partial:
        figure.savefig(partial, dpi=80)


@click.command()
@click.option("--out", type=click.Path(path_type=Path), default=Path("docs/images"), show_default=True)
def main(out: Path) -> None:
    """Draw the signs of all limbs."""
    out.mkdir(parents=True, exist_ok=True)
    for name in ANATOMIES:
        picture(load_anatomy(name), out / f"signs-{name}.png")


if __name__ == "__main__":
    main()
