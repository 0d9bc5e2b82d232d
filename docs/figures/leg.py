"""Hip, knee and ankle over their ranges: what the bend deformer keeps, beside linear blending with the same shares.

    python docs/figures/leg.py --out docs/images

Prints how the skin about the knee changes as it bends, and writes ``leg.png``.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np
from rich.table import Table

from adapt.anatomy import Deformer, Floats, Ints
from adapt.anatomy_file import load_anatomy
from adapt.model.body import Body, bone_transforms, joint_centres, make_body, pose_skin
from adapt.model.frames import frame_from_landmarks
from capture.console import stdout
from capture.files import replaced_when_complete
from capture.rigid import apply
from track.evaluation.bones import pose
from track.view.pictures import body_layers
from track.view.render import framing_camera, look_at, render

KNEE = (0.0, 60.0, 90.0, 120.0)
STANDING = {"hip_flexion_r": 0.0, "knee_angle_r": 0.0, "ankle_angle_r": 0.0}
# Rows of the figure: the joint in the middle of the picture, how far one sees (m), and the poses (degrees).
ROWS: tuple[tuple[str, float, tuple[dict[str, float], ...]], ...] = (
    (
        "knee",
        0.62,
        ({}, STANDING, {"hip_flexion_r": 60.0, "knee_angle_r": 60.0}, {"hip_flexion_r": 90.0, "knee_angle_r": 90.0}),
    ),
    ("knee", 0.17, tuple({"knee_angle_r": angle} for angle in KNEE)),
    ("hip", 0.26, tuple({"hip_flexion_r": angle} for angle in (-30.0, 45.0, 90.0, 120.0))),
    ("ankle", 0.15, tuple({"ankle_angle_r": angle} for angle in (-40.0, -20.0, 0.0, 30.0))),
)


def shares(body: Body, deformer: Deformer) -> Floats:
    """The share t (V,) of the second bone in every skin vertex of a bend."""
    start, end, _ = (frame_from_landmarks(body.anatomy, frame, body.p) for frame in deformer.frames)
    past = np.maximum((body.v_tilde.value - start.translation) @ start.rotation[:, 1], 0.0)
    before = np.maximum((end.translation - body.v_tilde.value) @ end.rotation[:, 1], 0.0)
    return np.asarray(past / np.maximum(past + before, 1e-12))


def linearly_blended(body: Body, deformer: Deformer, theta: Floats) -> Floats:
    """The skin (V, 3) with its two bones' motions blended linearly by the bend's own shares; for what it carries."""
    moved = bone_transforms(body, theta)
    first, second = (apply(moved[bone], body.v_tilde.value) for bone in deformer.bones)
    share = shares(body, deformer)[:, None]
    return np.asarray((1.0 - share) * first + share * second)


def about(body: Body, deformer: Deformer, joint: str) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (indices) in the middle of a bend on its outer (front) and its inner (back) side, for a knee."""
    share = shares(body, deformer)
    column = body.anatomy.deformers.index(deformer)
    bending = (np.abs(share - 0.5) < 0.3) & (body.anatomy.deformer_weights[:, column] > 0.999)
    offset = body.v_tilde.value - joint_centres(body, pose(body))[joint]
    return np.flatnonzero(bending & (offset[:, 0] > 0.02)), np.flatnonzero(bending & (offset[:, 0] < -0.02))


def distances(body: Body, skin: Floats, joint: str, theta: Floats) -> Floats:
    """Distance (V,) m of the posed skin from a joint's centre."""
    return np.asarray(np.linalg.norm(skin - joint_centres(body, theta)[joint], axis=1))


def volume(vertices: Floats, faces: Ints) -> float:
    """Enclosed volume (m^3); where the surface passes through itself, the overlap counts twice."""
    a, b, c = vertices[faces].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def print_knee(body: Body) -> None:
    """How near the skin comes to the knee's centre, relative to rest, in front and behind; change of the volume."""
    deformer = next(d for d in body.anatomy.deformers if d.name == "knee")
    front, back = about(body, deformer, "knee")
    rest = distances(body, body.v_tilde.value, "knee", pose(body))
    shown = Table(
        "flexion", "method", "front, least", "front, mean", "back, least", "back, mean", title="distance / rest"
    )
    before = volume(body.v_tilde.value, body.anatomy.skin_faces)
    for angle in KNEE[1:]:
        theta = pose(body, knee_angle_r=angle)
        methods = {"bend": pose_skin(body, theta), "linear": linearly_blended(body, deformer, theta)}
        for name, skin in methods.items():
            ratio = distances(body, skin, "knee", theta) / rest
            cells = (ratio[front].min(), ratio[front].mean(), ratio[back].min(), ratio[back].mean())
            change = 1e6 * (volume(skin, body.anatomy.skin_faces) - before)
            shown.add_row(f"{angle:.0f}", name, *(f"{100 * cell:.0f} %" for cell in cells), f"{change:+.0f} cm3")
    stdout.print(shown)


def picture(body: Body, path: Path) -> None:
    """Rows of poses seen from the right, skin translucent."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 3.0 * len(ROWS)), layout="constrained")
    FigureCanvasAgg(figure)
    for axes, (joint, reach, poses) in zip(figure.subplots(len(ROWS), 4), ROWS, strict=True):
        draw_row(axes, body, joint, reach, poses)
    with replaced_when_complete(path) as partial:
        figure.savefig(partial, dpi=80)


def draw_row(panels: Any, body: Body, joint: str, reach: float, poses: Sequence[dict[str, float]]) -> None:
    """Poses (degrees) in a row of axes, ``joint`` in the middle, ``reach`` m to every side."""
    for axes, degrees in zip(panels, poses, strict=True):
        theta = pose(body, **degrees)
        middle = joint_centres(body, theta)[joint]
        cube = middle + reach * np.array([[x, y, 0.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)])
        eye = look_at(cube, np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]))
        camera = framing_camera(eye, cube, width=360, height=360)
        axes.imshow(render(body_layers(body, theta, skin_opacity=0.45), eye, camera))
        axes.set_title(
            ", ".join(f"{name} {angle:.0f}" for name, angle in degrees.items()) or "at rest", fontsize="x-small"
        )
        axes.axis("off")


@click.command()
@click.option("--anatomy", default="lower-limb-right", show_default=True)
@click.option("--out", type=click.Path(path_type=Path), default=Path("docs/images"), show_default=True)
def main(anatomy: str, out: Path) -> None:
    """Measure and draw the leg's bends."""
    body = make_body(load_anatomy(anatomy))
    out.mkdir(parents=True, exist_ok=True)
    picture(body, out / "leg.png")
    print_knee(body)


if __name__ == "__main__":
    main()
