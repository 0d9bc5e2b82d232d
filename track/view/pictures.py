"""Pictures of a subject in a cloud: fitted skin and bones over the points, from the front and from the side."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from adapt.anatomy import Floats
from adapt.model.body import Body, pose_skin, posed_bones
from adapt.model.surface import submesh
from capture.cloud.fuse import Cloud
from track.observed_bones import Bools, skin_shown
from track.view.render import BONE, SKIN, Layer, framing_camera, look_at, render, save_png


def body_layers(body: Body, theta: Floats, *, shown: Bools | None = None, skin_opacity: float = 0.35) -> list[Layer]:
    """Translucent skin with opaque bones inside; given which bones (B,) show, only those, and what rides on them."""
    shown = np.ones(len(body.anatomy.bones), dtype=bool) if shown is None else shown
    bones, skin = posed_bones(body, theta), pose_skin(body, theta)
    seen = [bone for bone, shows in zip(body.anatomy.bones, shown, strict=True) if shows]
    layers = [Layer(bones[bone.name], bone.faces, BONE, 1.0) for bone in seen]
    return [*layers, Layer(*submesh(skin, body.anatomy.skin_faces, skin_shown(body, shown)), SKIN, skin_opacity)]


def picture_fit(body: Body, theta: Floats, cloud: Cloud, path: Path, *, shown: Bools | None = None) -> None:
    """Write a PNG: the posed body with the cloud, seen from the first sensor, from its side, and bones alone.

    Given which bones (B,) show, the others are left out.
    """
    skin = pose_skin(body, theta)
    sensor = cloud.views[0].world_from_sensor
    up = -sensor[:3, 1]
    front = sensor[:3, 3] - skin.mean(axis=0)
    side = np.cross(up, front)
    panels = []
    for direction, opacity, points in ((front, 0.35, cloud.points), (side, 0.35, cloud.points), (front, 0.6, None)):
        eye = look_at(skin, direction, up)
        camera = framing_camera(eye, skin)
        panels.append(render(body_layers(body, theta, shown=shown, skin_opacity=opacity), eye, camera, points=points))
    save_png(np.concatenate(panels, axis=1), path)
