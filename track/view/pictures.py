"""Pictures of a subject in a cloud: fitted skin and bones over the points, from the front and from the side."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Floats
from adapt.model.body import Body, pose_skin, posed_bones
from adapt.model.surface import submesh
from capture.cloud.fuse import Cloud
from capture.own import PNG, replaced_if_own
from track.observed_bones import Bools, skin_shown
from track.view.render import BONE, CLOUD, SKIN, Layer, framing_camera, look_at, render


def body_layers(body: Body, theta: Floats, *, shown: Bools | None = None, skin_opacity: float = 0.35) -> list[Layer]:
    """Translucent skin with opaque bones inside; given which bones (B,) show, only those, and what rides on them."""
    shown = np.ones(len(body.anatomy.bones), dtype=bool) if shown is None else shown
    bones, skin = posed_bones(body, theta), pose_skin(body, theta)
    seen = [bone for bone, shows in zip(body.anatomy.bones, shown, strict=True) if shows]
    layers = [Layer(bones[bone.name], bone.faces, BONE, 1.0) for bone in seen]
    return [*layers, Layer(*submesh(skin, body.anatomy.skin_faces, skin_shown(body, shown)), SKIN, skin_opacity)]


def picture_fit(
    body: Body, theta: Floats, cloud: Cloud, path: Path, *, shown: Bools | None = None, title: str = ""
) -> None:
    """Write a PNG: the posed body with the cloud, seen from the first sensor, from its side, and bones alone.

    Given which bones (B,) show, the others are left out. The ``title`` says what it is a picture of.
    """
    skin = pose_skin(body, theta)
    sensor = cloud.views[0].world_from_sensor
    up = -sensor[:3, 1]
    front = sensor[:3, 3] - skin.mean(axis=0)
    side = np.cross(up, front)
    seen = ("from the first sensor", front, 0.35, cloud.points), ("from its side", side, 0.35, cloud.points)
    panels = {}
    for name, direction, opacity, points in (*seen, ("without the points", front, 0.6, None)):
        eye = look_at(skin, direction, up)
        camera = framing_camera(eye, skin)
        panels[name] = render(body_layers(body, theta, shown=shown, skin_opacity=opacity), eye, camera, points=points)
    _save_captioned(panels, path, title)


def _save_captioned(panels: Mapping[str, NDArray[np.uint8]], path: Path, title: str) -> None:
    """Write pictures (H, W, 3) side by side, each under its name, with a title and a key of the colours."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    figure = Figure(figsize=(4.8 * len(panels), 5.4), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    for axes, (name, image) in zip(figure.subplots(1, len(panels)), panels.items(), strict=True):
        axes.imshow(image)
        axes.set_axis_off()
        axes.set_title(name, fontsize=11)
    key = {"skin of the model": SKIN, "bones": BONE, "points of the sensors": CLOUD}
    patches = [Patch(facecolor=colour, edgecolor="0.6", label=name) for name, colour in key.items()]
    figure.legend(handles=patches, loc="outside lower center", ncols=len(key), frameon=False)
    if title:
        figure.suptitle(title, fontsize=13)
    with replaced_if_own(path, PNG) as partial:
        figure.savefig(partial, metadata={"Software": "bonetrack"})
