"""What a film shows of each frame: the scene in space, or skin and bones over what a sensor saw."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Floats
from adapt.model.body import pose_skin
from capture.camera import Camera, ray_slopes
from capture.cloud.fuse import Region
from capture.projection import project
from capture.recording import FrameFile, Recording, Sensor, read_depth, world_from_sensor
from capture.rigid import inverse
from track.motion import MotionError
from track.view.frames import FrameStore, SeenPoints
from track.view.layers import FAR, FAR_M, LARGEST_ERROR_M, PLAIN, error_colours, fewer, first_eye
from track.view.pictures import body_layers
from track.view.render import BONE, SKIN, Layer, framing_camera, look_at, render
from track.view.scene import Scene
from track.view.stills import Image, Key, captioned, key_of

Singles = NDArray[np.float32]
_FRAMED = 20  # frames that the view in space is chosen by
_COLOUR_S = 0.1  # a colour image that was taken longer before or after is none of this frame


class SceneFilm:
    """The scene in space, seen from one place: skin, bones, and points by their distance to the skin."""

    def __init__(self, scene: Scene, *, width: int = 960, height: int = 720, region: Region | None = None) -> None:
        self.scene, self._frames = scene, FrameStore(scene, capacity=1, region=region)
        around = self._around()
        eye = first_eye(scene, self._frames)
        self._eye = look_at(around, eye.position - eye.middle, eye.up)
        self._camera = framing_camera(self._eye, around, width=width, height=height)

    def picture(self, k: int) -> Image:
        """The picture of frame k, with title, time and key."""
        seen = self._frames.get(k).seen
        seen = None if seen is None or not len(seen.points) else fewer(seen)
        points = None if seen is None else seen.points.astype(np.float64)
        colours = None if seen is None else error_colours(seen) / 255.0
        layers = _layers(self.scene, k)
        image = render(layers, self._eye, self._camera, points=points, point_colour=colours)
        keys = _body_keys(self.scene) + _point_keys(self.scene)
        return captioned(image, self.scene.title, _said(self.scene, k), keys)

    def _around(self) -> Floats:
        some = np.unique(np.linspace(0, len(self.scene.times) - 1, _FRAMED).round().astype(int))
        found = [self._extent(int(k)) for k in some]
        points = np.concatenate([np.zeros((0, 3)), *found])
        if not len(points):
            raise MotionError("there is nothing to see in any frame", remedy="name a motion with tracked frames")
        return points

    def _extent(self, k: int) -> Floats:
        if self.scene.body is not None and self.scene.thetas is not None:
            theta = self.scene.thetas[k]
            return pose_skin(self.scene.body, theta) if np.isfinite(theta).all() else np.zeros((0, 3))
        seen = self._frames.get(k).seen
        return np.zeros((0, 3)) if seen is None else seen.points.astype(np.float64)


class OverlayFilm:
    """Skin and bones over what one sensor saw: its colour image where there is one, else its depth."""

    def __init__(self, scene: Scene, sensor: str | None = None, *, width: int = 960) -> None:
        if scene.recording is None or scene.moments is None:
            raise MotionError("an overlay shows what a sensor saw", remedy="name the motion's recording: --recording")
        self.scene, self._moments = scene, scene.moments
        self._sensor = _sensor(scene.recording, sensor)
        self._world_from_eye, self._lens = world_from_sensor(scene.recording, self._sensor.name), self._sensor.camera
        self._colour: tuple[FrameFile, ...] = ()
        colour = self._sensor.colour
        if colour is not None and colour.frames and colour.camera and colour.colour_from_depth is not None:
            self._lens, self._colour = colour.camera, colour.frames
            self._world_from_eye = self._world_from_eye @ inverse(colour.colour_from_depth)
        self._camera = _without_distortion(self._lens, width)
        self._source = _pixels_of(self._camera, self._lens)

    def picture(self, k: int) -> Image:
        """The picture of frame k, with title, time and key."""
        behind = self._behind(k)
        said = _said(self.scene, k) + (", no image" if behind is None else "")
        straight = None if behind is None else cv2.remap(behind, *self._source, cv2.INTER_LINEAR)
        image = render(_layers(self.scene, k), self._world_from_eye, self._camera, background=straight)
        return captioned(image, f"{self.scene.title}, {self._sensor.name}", said, _body_keys(self.scene))

    def _behind(self, k: int) -> Image | None:
        """The sensor's image (H, W, 3) of frame k, red first; None where it has none."""
        if self._colour:
            time = self._moments[k].time_s
            nearest = min(self._colour, key=lambda frame: abs(frame.time_s - time))
            read = cv2.imread(str(nearest.path)) if abs(nearest.time_s - time) < _COLOUR_S else None
            return None if read is None else np.asarray(read[:, :, ::-1], dtype=np.uint8)
        frame = self._moments[k].frames.get(self._sensor.name)
        if frame is None:
            return None
        near, far = self._sensor.depth_range_m
        depth = read_depth(self._sensor, frame)
        share = np.clip((depth - near) / (far - near), 0.0, 1.0)
        grey = np.where(depth > 0.0, 235.0 - 190.0 * np.sqrt(share), 20.0).astype(np.uint8)
        return np.repeat(grey[:, :, None], 3, axis=2)


def _sensor(recording: Recording, name: str | None) -> Sensor:
    """The sensor of that name, else the first."""
    found = [sensor for sensor in recording.sensors if name in (None, sensor.name)]
    if not found:
        names = ", ".join(sensor.name for sensor in recording.sensors)
        raise MotionError(f"has no sensor {name!r}", where=recording.path, remedy=f"there are {names}")
    return found[0]


def _without_distortion(camera: Camera, width: int) -> Camera:
    """The camera without distortion, its image so wide (px)."""
    scale = width / camera.width
    cx, cy = scale * (camera.cx + 0.5) - 0.5, scale * (camera.cy + 0.5) - 0.5  # pixels' middles are whole numbers
    return Camera(width, round(scale * camera.height), scale * camera.fx, scale * camera.fy, cx, cy)


def _pixels_of(camera: Camera, lens: Camera) -> tuple[Singles, Singles]:
    """For each pixel (H, W) of a camera where a lens at its place sees the same: columns and rows."""
    uv, _ = project(lens, np.concatenate([ray_slopes(camera), np.ones((camera.height, camera.width, 1))], axis=2))
    at = np.nan_to_num(uv, nan=-1e6).astype(np.float32).reshape(camera.height, camera.width, 2)
    return at[:, :, 0], at[:, :, 1]


def _layers(scene: Scene, k: int) -> list[Layer]:
    """What shows of the body in frame k; nothing where it was lost."""
    if scene.body is None or scene.thetas is None or not np.isfinite(scene.thetas[k]).all():
        return []
    shown = None if scene.motion is None else scene.motion.shown[k]
    layers = body_layers(scene.body, scene.thetas[k], shown=shown)
    return [layer for layer in layers if len(layer.faces)]


def _said(scene: Scene, k: int) -> str:
    lost = scene.motion is not None and bool(scene.motion.lost[k])
    return f"{scene.times[k]:.2f} s" + (", lost" if lost else "")


def _body_keys(scene: Scene) -> list[Key]:
    return [] if scene.body is None else [key_of(SKIN, "skin"), key_of(BONE, "bones")]


def _point_keys(scene: Scene) -> list[Key]:
    if scene.recording is None:
        return []
    if scene.body is None:
        return [Key(PLAIN, "points seen")]
    off = SeenPoints(np.zeros((2, 3), np.float32), np.array([0.0, LARGEST_ERROR_M], np.float32))
    (on_skin, far_off), most = error_colours(off).tolist(), 1e3 * LARGEST_ERROR_M
    words = ("points on the skin", f"{most:.0f} mm off and more", f"over {1e3 * FAR_M:.0f} mm: something else")
    return [Key((r, g, b), text) for (r, g, b), text in zip((on_skin, far_off, FAR), words, strict=True)]
