"""Pictures of the walker: bones in the cloud, and over the depth images."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from walker_leg import BOTH, FLOOR_UP, Leg

from adapt.anatomy import Floats
from adapt.model.body import pose_skin, posed_bones
from capture.cloud.fuse import Cloud, View, fuse
from capture.commands.region_options import as_region
from capture.projection import project
from capture.recording import Recording, instants
from capture.rigid import apply, inverse
from track.observed_bones import skin_shown
from track.view.pictures import body_layers
from track.view.render import Layer, framing_camera, look_at, render, save_png

_SHOWN_FRAMES = (2, 11, 24, 40)
_SHOWN_POINTS = 3  # one of so many, lest they hide the limb
_PANEL = (300, 320)


def picture(legs: list[Leg], recording: Recording, path: Path) -> None:
    """Both legs over the cloud, from the sensor and from the side; bones that do not show are left out."""
    rows = []
    for k in _SHOWN_FRAMES:
        cloud = fuse(recording, instants(recording)[k], region=as_region(BOTH))
        rows.append(np.concatenate([_scene(legs, k, cloud, side=False), _scene(legs, k, cloud, side=True)], axis=1))
    save_png(_few_colours(_two_columns(rows)), path)


def _scene(legs: list[Leg], k: int, cloud: Cloud, *, side: bool) -> NDArray[np.uint8]:
    front = -cloud.points.mean(axis=0) - 0.6 * FLOOR_UP
    direction = np.cross(FLOOR_UP, front) if side else front
    layers: list[Layer] = []
    for leg in legs:
        if leg.motion.tracked[k]:
            layers += _shown_layers(leg, k)
    middle = cloud.points.mean(axis=0)
    around = middle + 1.25 * (cloud.points - middle)  # the limbs' far sides, too
    eye = look_at(around, direction, FLOOR_UP)
    camera = framing_camera(eye, around, width=_PANEL[0], height=_PANEL[1])
    image = np.ascontiguousarray(render(layers, eye, camera, points=cloud.points[::_SHOWN_POINTS]))
    cv2.putText(image, f"frame {k}", (4, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (200, 0, 0), 1, cv2.LINE_AA)
    return np.asarray(image, dtype=np.uint8)


def _shown_layers(leg: Leg, k: int) -> list[Layer]:
    """Bones that show, and the skin that rides on them."""
    theta, shown = leg.motion.thetas[k], leg.motion.shown[k]
    *bones, skin = body_layers(leg.body, theta)
    kept = skin_shown(leg.body, shown)[skin.faces].all(axis=1)
    visible = [bone for bone, shows in zip(bones, shown, strict=True) if shows]
    return [*visible, Layer(skin.vertices, skin.faces[kept], skin.colour, skin.opacity)] if kept.any() else visible


def overlay(legs: list[Leg], pixels: dict[str, Floats], recording: Recording, path: Path) -> None:
    """The depth image with bones (yellow), our joints (red) and the motion capture's points (white rings)."""
    tiles = []
    for k in _SHOWN_FRAMES:
        view = fuse(recording, instants(recording)[k], region=as_region(BOTH)).views[0]
        image = cv2.cvtColor(_grey(view.depth), cv2.COLOR_GRAY2RGB)
        for leg in legs:
            if not leg.motion.tracked[k]:
                continue
            for name, shows in zip(leg.motion.transforms, leg.motion.shown[k], strict=True):
                if shows:
                    _dots(image, _pixels(view, posed_bones(leg.body, leg.motion.thetas[k])[name][::4]), (255, 220, 0))
            _outline(image, leg, k, view)
            for u, v in _pixels(view, leg.joints[k]):
                cv2.circle(image, (int(u), int(v)), 5, (255, 0, 0), -1)
            for u, v in pixels[leg.side][k]:
                cv2.circle(image, (int(u), int(v)), 6, (255, 255, 255), 2)
        cv2.putText(image, f"frame {k}", (205, 325), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (255, 255, 255), 1, cv2.LINE_AA)
        tiles.append(np.asarray(image[:340, 200:460], dtype=np.uint8))
    save_png(_few_colours(np.concatenate(tiles, axis=1)), path)


def _outline(image: NDArray[np.uint8], leg: Leg, k: int, view: View) -> None:
    skin = _pixels(view, pose_skin(leg.body, leg.motion.thetas[k]))
    faces = leg.body.anatomy.skin_faces
    silhouette = np.zeros(image.shape[:2], np.uint8)
    for triangle in skin[faces[skin_shown(leg.body, leg.motion.shown[k])[faces].all(axis=1)]]:
        cv2.fillConvexPoly(silhouette, triangle, 255)
    contours, _ = cv2.findContours(silhouette, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(image, contours, -1, (255, 90, 90), 1)


def _dots(image: NDArray[np.uint8], pixels: NDArray[np.int32], colour: tuple[int, int, int]) -> None:
    inside = (pixels >= 0).all(axis=1) & (pixels < image.shape[1::-1]).all(axis=1)
    image[pixels[inside, 1], pixels[inside, 0]] = colour


def _pixels(view: View, points: Floats) -> NDArray[np.int32]:
    uv, _ = project(view.camera, apply(inverse(view.world_from_sensor), points))
    return np.rint(uv).astype(np.int32)


def _grey(depth: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Near is bright, nothing is black."""
    return np.where(depth > 0.0, np.clip(255.0 - 150.0 * (depth - 0.8), 40.0, 230.0), 0.0).astype(np.uint8)


def _two_columns(panels: list[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    lines = [np.concatenate(panels[i : i + 2], axis=1) for i in range(0, len(panels), 2)]
    return np.concatenate(lines, axis=0)


def _few_colours(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.asarray(np.rint(image / 15.0) * 15.0, dtype=np.uint8)  # a smaller file
