"""Bodies longer, shorter, thicker and thinner by 15 per cent: do the bones' heads keep their shape, do joints hold?

    python docs/figures/proportions.py --out docs/images

Prints what the best similarity leaves of every head's change of shape, how far each joint's surfaces drift against
each other over its range of motion, and how deep bones overlap; writes ``proportions.png``.
"""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np
from rich.table import Column, Table

from adapt.anatomy import Anatomy
from adapt.anatomy_file import load_anatomy
from adapt.model.body import Body, make_body, pose_skin, posed_bones
from capture.console import stdout
from capture.files import replaced_when_complete
from track.evaluation.bones import FIGURE_7, Proportions, drift, heads, joint_poses, overlap, pose, similarity_residual
from track.view.pictures import body_layers
from track.view.render import framing_camera, look_at, render

SHOWN = {"elbow_flexion": 75.0, "pro_sup": 30.0, "flexion": -20.0}
BODIES = (Proportions("template"), *FIGURE_7)


def print_heads(anatomy: Anatomy) -> None:
    """Every head's residual after the best similarity, and that similarity's scale."""
    template = make_body(anatomy)
    kinds = (kind.name for kind in FIGURE_7)
    shown = Table(Column("head", no_wrap=True), *kinds, title="heads: mm off the best similarity (its scale)")
    bodies = [kind.body(anatomy) for kind in FIGURE_7]
    for name, (bone, index) in heads(anatomy).items():
        rest = template.rest_bones[bone][index]
        cells = [similarity_residual(rest, body.rest_bones[bone][index]) for body in bodies]
        shown.add_row(name, *(f"{1000 * left:.2f} x{scale:.3f}" for left, scale in cells))
    stdout.print(shown)


def print_joints(anatomy: Anatomy) -> None:
    """Every joint's drift, and the deepest overlap of its bones, over its range of motion."""
    template = make_body(anatomy)
    shown = Table("joint", *(kind.name for kind in BODIES), title="joint surfaces: drift / deepest overlap, mm")
    for joint in anatomy.joints:
        if joint.parent is None:
            continue
        cells = []
        for kind in BODIES:
            body = kind.body(anatomy)
            moved = drift(template, body, joint, joint_poses(body, joint), scale=kind.scale)
            cells.append(f"{1000 * moved:.2f} / {1000 * _deepest(body, joint.parent, joint.child):.1f}")
        shown.add_row(joint.name, *cells)
    stdout.print(shown)


def _deepest(body: Body, parent: str, child: str) -> float:
    joint = next(j for j in body.anatomy.joints if j.child == child)
    faces = {bone.name: bone.faces for bone in body.anatomy.bones}
    posed = [posed_bones(body, theta) for theta in joint_poses(body, joint)]
    return max(overlap((bones[parent], faces[parent]), (bones[child], faces[child])) for bones in posed)


def picture(anatomy: Anatomy, path: Path) -> None:
    """All bodies at one scale, bent, with translucent skin."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.5, 3.0), layout="constrained")
    FigureCanvasAgg(figure)
    bodies = [kind.body(anatomy) for kind in BODIES]
    everywhere = np.concatenate([pose_skin(body, pose(body, **SHOWN)) for body in bodies])
    eye = look_at(everywhere, np.array([0.15, 0.1, 1.0]), np.array([0.0, 1.0, 0.0]))
    camera = framing_camera(eye, everywhere, width=520, height=460)
    for axes, kind, body in zip(figure.subplots(1, len(bodies)), BODIES, bodies, strict=True):
        axes.imshow(render(body_layers(body, pose(body, **SHOWN), skin_opacity=0.45), eye, camera))
        axes.set_title(f"{kind.name}\nlengths x{kind.length:.2f}, heads x{kind.scale:.2f}", fontsize="medium")
        axes.axis("off")
    with replaced_when_complete(path) as partial:
        figure.savefig(partial, dpi=85)


@click.command()
@click.option("--anatomy", default="upper-limb-right", show_default=True)
@click.option("--out", type=click.Path(path_type=Path), default=Path("docs/images"), show_default=True)
def main(anatomy: str, out: Path) -> None:
    """Measure and draw the bodies."""
    template = load_anatomy(anatomy)
    out.mkdir(parents=True, exist_ok=True)
    picture(template, out / "proportions.png")
    print_heads(template)
    print_joints(template)


if __name__ == "__main__":
    main()
