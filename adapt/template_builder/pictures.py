"""Pictures of a template: ``python -m adapt.template_builder.pictures NAME --out DIR`` (needs a display or Xvfb)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from adapt.anatomy_file import load_anatomy
from adapt.model.body import Body, make_body, pose_skin, posed_bones, rest_theta

Floats = NDArray[np.float64]
Vector = tuple[float, float, float]

_COLOURS = ("ivory", "sandybrown", "lightsteelblue", "palegreen", "khaki", "plum")


@dataclass(frozen=True)
class View:
    """From where one looks (direction to the eye), what is up, and half the picture's height (m)."""

    eye: Vector
    up: Vector
    half_height: float


FRONT, SIDE, TOP = (
    View((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.28),
    View((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), 0.28),
    View((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), 0.28),
)


@click.command()
@click.argument("name")
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Folder for the PNG files.")
def main(name: str, out: Path) -> None:
    """Render the template NAME at rest and at the ends of every coordinate's range."""
    body = make_body(load_anatomy(name))
    out.mkdir(parents=True, exist_ok=True)
    draw([(body, rest_theta(body))] * 3, [FRONT, SIDE, TOP], out / f"{name}-rest.png")
    for coordinate in body.anatomy.coordinates:
        if coordinate.unit == "rad" and coordinate.high - coordinate.low < 2.0 * np.pi:
            poses = [(body, _posed(body, coordinate.name, share)) for share in (0.0, 0.5, 1.0)]
            for label, view in (("front", FRONT), ("top", TOP)):
                draw(poses, [view] * 3, out / f"{name}-{coordinate.name}-{label}.png")
    for joint in body.anatomy.joints:
        centre = body.anatomy.landmarks[[body.anatomy.landmark_index(n) for n in joint.centre]].mean(axis=0)
        views = [View(view.eye, view.up, 0.07) for view in (FRONT, SIDE, TOP)]
        draw([(body, rest_theta(body))] * 3, views, out / f"{name}-{joint.name}-closeup.png", focus=centre)


def _posed(body: Body, coordinate: str, share: float) -> Floats:
    """The rest pose with one coordinate at a share of its range."""
    theta = rest_theta(body)
    index = body.anatomy.coordinate_index(coordinate)
    low, high = body.anatomy.coordinates[index].low, body.anatomy.coordinates[index].high
    theta[index] = low + share * (high - low)
    return theta


def draw(poses: list[tuple[Body, Floats]], views: list[View], path: Path, *, focus: Floats | None = None) -> None:
    """One picture, poses side by side: bones inside translucent skin; inner sides of faces show red."""
    import pyvista

    plotter = pyvista.Plotter(off_screen=True, shape=(1, len(poses)), window_size=(700 * len(poses), 700), border=False)
    plotter.set_background("white")
    for column, ((body, theta), view) in enumerate(zip(poses, views, strict=True)):
        plotter.subplot(0, column)
        skin = pose_skin(body, theta)
        inside_out = {"color": "red"}
        plotter.add_mesh(_surface(skin, body.anatomy.skin_faces), color="tan", opacity=0.35, smooth_shading=True)
        bones = posed_bones(body, theta)
        for bone, colour in zip(body.anatomy.bones, _COLOURS, strict=False):
            mesh = _surface(bones[bone.name], bone.faces)
            plotter.add_mesh(mesh, color=colour, backface_params=inside_out, smooth_shading=True)
        centre = (skin.min(axis=0) + skin.max(axis=0)) / 2.0 if focus is None else focus
        plotter.enable_parallel_projection()
        plotter.camera_position = [centre + 2.0 * np.array(view.eye), centre, view.up]
        plotter.camera.parallel_scale = view.half_height
    plotter.screenshot(str(path))
    plotter.close()


def _surface(vertices: Floats, faces: NDArray[np.int64]) -> Any:
    import pyvista

    return pyvista.PolyData(vertices, np.c_[np.full(len(faces), 3), faces].ravel())


if __name__ == "__main__":
    main()
