"""The whole body at rest and in some poses, bones inside translucent skin.

    python docs/figures/body.py FOLDER/body.npz --out docs/images

The file is what ``python -m adapt.template_builder body --out FOLDER`` writes. Writes ``body.png``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click
import numpy as np

from adapt.anatomy import Floats, Ints
from adapt.anatomy_file import load_anatomy
from adapt.model.body import Body, make_body, pose_skin, posed_bones, rest_theta
from adapt.template_builder.body_checks import raised_arm
from capture.files import replaced_when_complete

POSES: tuple[dict[str, float], ...] = (
    {"hip_flexion_r": 80.0, "knee_angle_r": 90.0, "elbow_flexion_r": 90.0, "pro_sup_r": 80.0},
    {"lumbar_extension": -40.0, "thorax_extension": -20.0, "head_extension": -30.0},
    {"lumbar_bending": 25.0, "thorax_bending": 20.0, "head_bending": 20.0, "head_twist": 40.0},
    {"lumbar_twist": 12.0, "thorax_twist": 35.0, "hip_adduction_r": -30.0, "ankle_angle_r": 25.0},
)
_EYES = ((1.0, 0.15, 0.5), (0.3, 0.1, 1.0))
_COLOURS = ("ivory", "lightsteelblue", "sandybrown", "palegreen", "khaki", "plum")


@click.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), required=True, help="Folder for the picture.")
def main(file: Path, out: Path) -> None:
    """Render the body of FILE."""
    body = make_body(load_anatomy(file))
    poses = [rest_theta(body), *(posed(body, pose) for pose in POSES)]
    poses += [raised_arm(body, elevation, plane) for elevation, plane in ((90.0, 0.0), (100.0, 90.0))]
    draw(body, poses, out)


def posed(body: Body, degrees: dict[str, float]) -> Floats:
    """The rest pose, some coordinates turned from there by degrees."""
    theta = rest_theta(body)
    for name, angle in degrees.items():
        theta[body.anatomy.coordinate_index(name)] += np.radians(angle)
    return theta


def draw(body: Body, poses: list[Floats], out: Path) -> None:
    """Every pose from two sides."""
    import pyvista

    plotter = pyvista.Plotter(
        off_screen=True, shape=(len(_EYES), len(poses)), window_size=(340 * len(poses), 1360), border=False
    )
    plotter.set_background("white")
    for column, theta in enumerate(poses):
        skin, bones = pose_skin(body, theta), posed_bones(body, theta)
        centre = (skin.min(axis=0) + skin.max(axis=0)) / 2.0
        for row, eye in enumerate(_EYES):
            plotter.subplot(row, column)
            plotter.add_mesh(_surface(skin, body.anatomy.skin_faces), color="tan", opacity=0.35, smooth_shading=True)
            for k, bone in enumerate(body.anatomy.bones):
                mesh = _surface(bones[bone.name], bone.faces)
                plotter.add_mesh(mesh, color=_COLOURS[k % len(_COLOURS)], smooth_shading=True)
            plotter.enable_parallel_projection()
            plotter.camera_position = [centre + 4.0 * np.array(eye), centre, (0.0, 1.0, 0.0)]
            plotter.camera.parallel_scale = 0.95
    out.mkdir(parents=True, exist_ok=True)
    with replaced_when_complete(out / "body.png") as partial:
        plotter.screenshot(str(partial))
    plotter.close()


def _surface(vertices: Floats, faces: Ints) -> Any:
    import pyvista

    return pyvista.PolyData.from_regular_faces(vertices, faces)


if __name__ == "__main__":
    main()
