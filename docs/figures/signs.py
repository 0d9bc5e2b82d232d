"""What the sign of each coordinate means: every joint angle at zero, and where it is positive; where the limb is.

    python docs/figures/signs.py --out docs/images

Writes ``signs-NAME.png`` (joint angles) and ``signs-NAME-free.png`` (the free joint's turns and shifts) of both limbs;
with ``--anatomy NAME`` those of one.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import numpy as np

from adapt.anatomy import Anatomy, Floats, Joint
from adapt.anatomy_file import load_anatomy
from adapt.model.body import Body, joint_centres, make_body, pose_skin
from adapt.model.pose_space import is_free, root_joint
from capture.camera import Camera
from capture.files import replaced_when_complete
from capture.projection import project
from capture.rigid import apply, inverse
from track.evaluation.bones import pose
from track.view.pictures import body_layers
from track.view.render import Layer, framing_camera, look_at, render

ANATOMIES = ("upper-limb-right", "lower-limb-right")
RIGHT, FRONT = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])  # where the eye is
FROM_THE_FRONT = ("pro_sup", "flexion", "hip_adduction_r", "hip_rotation_r")
# By joint: the joint in the middle of the picture, how far one sees (m), how far below that the middle lies (m).
SIGHT = {"elbow": ("elbow", 0.3, 0.0), "radioulnar": ("wrist", 0.24, 0.0), "wrist": ("wrist", 0.2, 0.06)}
SIGHT |= {"hip": ("hip", 0.6, 0.38), "knee": ("knee", 0.45, 0.05), "ankle": ("ankle", 0.2, 0.0)}
SHARE = 0.7  # of the range above zero
OBLIQUE = np.array([1.0, 0.45, 0.8])  # from before, above and the right
TURN_DEG, SHIFT_M, AXIS_M = 40.0, 0.15, 0.2
GREY = (0.6, 0.6, 0.6)


def turning(anatomy: Anatomy) -> list[tuple[str, Joint]]:
    """The joint angles, each with its (first) joint."""
    found: dict[str, Joint] = {}
    for joint in anatomy.joints:
        if not is_free(joint):
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


def free_picture(anatomy: Anatomy, path: Path) -> None:
    """The free joint: all at zero, then each of its coordinates alone positive, with the limb at zero in grey."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    body, root = make_body(anatomy), root_joint(anatomy)
    zero = np.zeros(len(anatomy.coordinates))
    poses = {"all at zero": zero}
    for name in root.coordinates:
        i = anatomy.coordinate_index(name)
        turns = anatomy.coordinates[i].unit == "rad"
        step, title = (np.deg2rad(TURN_DEG), f"+{TURN_DEG:.0f}°") if turns else (SHIFT_M, f"+{SHIFT_M:.2f} m")
        poses[f"{name} {title}"] = np.r_[zero[:i], step, zero[i + 1 :]]
    centre = joint_centres(body, zero)[root.name]
    reach = np.concatenate([*(pose_skin(body, theta) for theta in poses.values()), centre + 1.3 * AXIS_M * np.eye(3)])
    eye = look_at(reach, OBLIQUE, np.array([0.0, 1.0, 0.0]))
    camera = framing_camera(eye, reach, width=270, height=340)
    before = Layer(pose_skin(body, zero), anatomy.skin_faces, GREY, 0.2)
    figure = Figure(figsize=(9.8, 6.8), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(2, 4)
    for axes, (title, theta) in zip(np.delete(grid.ravel(), 4), poses.items(), strict=True):
        axes.imshow(render([*body_layers(body, theta, skin_opacity=0.45), before], eye, camera))
        _draw_axes(axes, centre, eye, camera)
        axes.set_title(title, fontsize="small")
    for axes in grid.ravel():
        axes.axis("off")
    with replaced_when_complete(path) as partial:
        figure.savefig(partial, dpi=80)


def _draw_axes(axes: Any, origin: Floats, eye: Floats, camera: Camera) -> None:
    """X, Y and Z of the frame that the limb stands in, from an origin (3,)."""
    ends = origin + AXIS_M * np.vstack([np.zeros(3), np.eye(3)])
    (start, *tips), _ = project(camera, apply(inverse(eye), ends))
    for tip, name, colour in zip(tips, "XYZ", ("tab:red", "tab:green", "tab:blue"), strict=True):
        axes.annotate("", tip, start, arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.5})
        axes.annotate(name, start + 1.15 * (tip - start), color=colour, ha="center", va="center", fontsize="small")


@click.command()
@click.option("--anatomy", "names", multiple=True, default=ANATOMIES, type=click.Choice(ANATOMIES), help="Whose signs.")
@click.option("--out", type=click.Path(path_type=Path), default=Path("docs/images"), show_default=True)
def main(names: tuple[str, ...], out: Path) -> None:
    """Draw the signs of the limbs."""
    out.mkdir(parents=True, exist_ok=True)
    for name in names:
        picture(load_anatomy(name), out / f"signs-{name}.png")
        free_picture(load_anatomy(name), out / f"signs-{name}-free.png")


if __name__ == "__main__":
    main()
