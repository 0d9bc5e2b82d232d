"""Bones over the whole range of motion: how deep beneath the skin, and how deep in each other.

    python docs/figures/range_of_motion.py --out docs/images

Prints both as tables, the second beside the source skeleton's own overlaps where the ``build`` extra is installed,
and writes ``range-of-motion.png`` with the extreme poses.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.table import Table

from adapt.anatomy_file import load_anatomy
from adapt.model.body import Body, make_body, pose_skin, posed_bones
from capture.console import stdout
from capture.files import replaced_when_complete
from track.evaluation.bones import depth_inside, grid, overlap, pose
from track.view.pictures import body_layers
from track.view.render import framing_camera, look_at, render

Where = tuple[float, dict[str, float]]  # a length (m) and the pose (degrees) in which it was found

ELBOW = (0.0, 30.0, 60.0, 90.0, 110.0, 130.0)
TWIST = (-90.0, -45.0, 0.0, 45.0, 90.0)
DEVIATION = (-10.0, 7.0, 25.0)
FLEXION = (-70.0, -35.0, 0.0, 35.0, 70.0)

# Only these coordinates move one of the two bones against the other.
NEIGHBOURS: dict[tuple[str, str], dict[str, tuple[float, ...]]] = {
    ("humerus", "ulna"): {"elbow_flexion": tuple(np.arange(0.0, 131.0, 10.0))},
    ("humerus", "radius"): {"elbow_flexion": ELBOW, "pro_sup": TWIST},
    ("ulna", "radius"): {"pro_sup": tuple(np.arange(-90.0, 91.0, 15.0))},
    ("radius", "hand"): {"deviation": DEVIATION, "flexion": FLEXION},
    ("ulna", "hand"): {"pro_sup": TWIST, "deviation": DEVIATION, "flexion": FLEXION},
}

# The wrist's skin does not move with the elbow, nor the elbow's with the wrist: two small grids instead of a large one.
BENEATH_SKIN = (
    *grid(elbow_flexion=tuple(np.arange(0.0, 131.0, 10.0)), pro_sup=TWIST),
    *grid(pro_sup=TWIST, deviation=DEVIATION, flexion=FLEXION),
)

WHOLE_ARM: tuple[dict[str, float], ...] = (
    {"elbow_flexion": 0.0},
    {"elbow_flexion": 60.0},
    {"elbow_flexion": 130.0},
    {"elbow_flexion": 60.0, "pro_sup": -90.0},
    {"elbow_flexion": 60.0, "pro_sup": 90.0},
)
FOREARM: tuple[dict[str, float], ...] = (
    {"elbow_flexion": 60.0, "pro_sup": 0.0},
    {"elbow_flexion": 60.0, "pro_sup": -90.0, "flexion": -70.0},
    {"elbow_flexion": 60.0, "pro_sup": -90.0, "flexion": 70.0},
    {"elbow_flexion": 60.0, "pro_sup": 0.0, "deviation": -10.0},
    {"elbow_flexion": 60.0, "pro_sup": 0.0, "deviation": 25.0},
)


def least_depths(body: Body, poses: Sequence[dict[str, float]]) -> dict[str, Where]:
    """For every bone, the least depth of its vertices beneath the skin over some poses (degrees); negative: outside."""
    least: dict[str, Where] = defaultdict(lambda: (np.inf, {}))
    for degrees in poses:
        theta = pose(body, **degrees)
        skin = pose_skin(body, theta)
        for name, vertices in posed_bones(body, theta).items():
            depth = float(depth_inside(vertices, skin, body.anatomy.skin_faces).min())
            least[name] = min(least[name], (depth, degrees), key=lambda found: found[0])
    return dict(least)


def deepest_overlap(body: Body, first: str, second: str, poses: list[dict[str, float]]) -> Where:
    """How deep two bones stand in each other, at most, over some poses (degrees)."""
    found: Where = (0.0, {})
    faces = {bone.name: bone.faces for bone in body.anatomy.bones}
    for degrees in poses:
        posed = posed_bones(body, pose(body, **degrees))
        depth = overlap((posed[first], faces[first]), (posed[second], faces[second]))
        found = max(found, (depth, degrees), key=lambda where: where[0])
    return found


def deepest_source_overlaps() -> dict[tuple[str, str], float] | None:
    """The same (m) for the source skeleton over the same poses, or None when it is not installed."""
    try:
        from adapt.template_builder.assemble import source_of
        from adapt.template_builder.checks import source_bone
        from adapt.template_builder.upper_limb import UPPER_LIMB_RIGHT as PLAN

        source = source_of(PLAN)
    except Exception as error:  # not installed, or a release with other names: the table goes without
        stdout.print(f"[dim]without the source skeleton: {error}[/dim]")
        return None

    def depth(pair: tuple[str, str], degrees: dict[str, float]) -> float:
        pose = {name: float(np.deg2rad(angle)) for name, angle in degrees.items()}
        first, second = (source_bone(PLAN, source, name, pose) for name in pair)
        return overlap((first.vertices, first.faces), (second.vertices, second.faces))

    return {pair: max(depth(pair, degrees) for degrees in grid(**angles)) for pair, angles in NEIGHBOURS.items()}


def print_depths(body: Body) -> None:
    """The bones beneath the skin, as a table."""
    title = f"{len(BENEATH_SKIN)} poses"
    shown = Table("bone", "least depth beneath the skin", "in the pose (degrees)", title=title)
    for name, (depth, degrees) in least_depths(body, BENEATH_SKIN).items():
        shown.add_row(name, f"{1000 * depth:+.1f} mm", _words(degrees))
    stdout.print(shown)


def print_overlaps(body: Body) -> None:
    """Bones in bones, as a table."""
    source = deepest_source_overlaps()
    shown = Table("bones", "deepest overlap", "in the pose (degrees)", "source skeleton")
    for (first, second), angles in NEIGHBOURS.items():
        depth, degrees = deepest_overlap(body, first, second, grid(**angles))
        own = "-" if source is None else f"{1000 * source[first, second]:.1f} mm"
        shown.add_row(f"{first} - {second}", f"{1000 * depth:.1f} mm", _words(degrees), own)
    stdout.print(shown)


def _words(degrees: dict[str, float]) -> str:
    return ", ".join(f"{name} {angle:.0f}" for name, angle in degrees.items())


def picture(body: Body, path: Path) -> None:
    """The extreme poses, skin translucent: the whole arm above, forearm and hand below."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.5, 5.6), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(2, 5, height_ratios=(4, 3))
    draw_row(panels[0], body, WHOLE_ARM, tuple(bone.name for bone in body.anatomy.bones), (400, 400))
    draw_row(panels[1], body, FOREARM, ("radius", "ulna", "hand"), (400, 300))
    with replaced_when_complete(path) as partial:
        figure.savefig(partial, dpi=85)


def draw_row(
    panels: Any, body: Body, poses: Sequence[dict[str, float]], shown: tuple[str, ...], size: tuple[int, int]
) -> None:
    """Poses (degrees) in a row of axes, seen from the outer side at one scale.

    All ``shown`` bones are in sight; ``size`` is one picture's in pixels.
    """
    bones = [posed_bones(body, pose(body, **degrees)) for degrees in poses]
    everywhere = np.concatenate([posed[name] for posed in bones for name in shown])
    eye = look_at(everywhere, np.array([0.15, 0.1, 1.0]), np.array([0.0, 1.0, 0.0]))
    corners = np.concatenate([everywhere - 0.025, everywhere + 0.025])  # room for the skin
    camera = framing_camera(eye, corners, width=size[0], height=size[1])
    for axes, degrees in zip(panels, poses, strict=True):
        axes.imshow(render(body_layers(body, pose(body, **degrees), skin_opacity=0.45), eye, camera))
        axes.set_title("\n".join(f"{name} {angle:.0f}" for name, angle in degrees.items()), fontsize="small")
        axes.axis("off")


@click.command()
@click.option("--anatomy", default="upper-limb-right", show_default=True)
@click.option("--out", type=click.Path(path_type=Path), default=Path("docs/images"), show_default=True)
def main(anatomy: str, out: Path) -> None:
    """Measure and draw the range of motion."""
    body = make_body(load_anatomy(anatomy))
    out.mkdir(parents=True, exist_ok=True)
    picture(body, out / "range-of-motion.png")
    print_overlaps(body)
    print_depths(body)


if __name__ == "__main__":
    main()
