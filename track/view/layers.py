"""The layers of a scene in a viser server: skin, bones, points, truth, joint labels; one frame shown at a time.

Bones are sent once and moved as rigid bodies; skin, points and bones along a curve are sent for every frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from adapt.anatomy import Floats, Ints
from adapt.model.body import pose_skin, rest_theta
from capture.recording import world_from_sensor
from track.poses_by_hand import UNITS, as_shown
from track.view.frames import FrameContent, FrameStore, Posed, SeenPoints, Single, pose_body
from track.view.scene import Scene, joint_coordinates

if TYPE_CHECKING:
    import viser

SKIN, BONE, TRUTH, PLAIN, FAR = (233, 178, 150), (224, 203, 158), (0, 158, 115), (60, 90, 150), (150, 150, 150)
MARKER = (204, 26, 115)
LARGEST_ERROR_M, FAR_M = 0.010, 0.020
"""Where the colours of the error end, and beyond which a point is taken for something else than the limb."""
POINTS = 1800  # drawn of a cloud
_FRAMED, _BESIDE = 5, np.deg2rad(-35.0)  # frames looked at, angle beside the line of sight
_FIELD, _MARGIN = np.deg2rad(45.0), 1.05  # of view
_UNKNOWN = (214, 110, 95)  # a bone that did not show in its frame
LAYERS = {
    "skin": "Skin",
    "bones": "Bones",
    "points": "Points",
    "truth": "True bones",
    "markers": "Laboratory's markers",
    "labels": "Angles",
}
"""The switches: node name -> what people read."""


@dataclass(frozen=True, eq=False)
class Skin:
    """What is drawn of the skin: some of its vertices, joined by faces (F, 3)."""

    vertices: Ints | slice
    faces: Ints


class Layers:
    """The nodes of a scene's layers; ``show`` puts a frame into them."""

    def __init__(self, server: viser.ViserServer, scene: Scene, *, skin: Skin | None = None) -> None:
        self.scene = scene
        self._server = server
        self._groups = {name: server.scene.add_frame(f"/{name}", show_axes=False) for name in self.names()}
        self._skin_part = skin
        self._skin: Any = None
        self._points: Any = None
        self._markers: Any = None
        self._bones: dict[str, Any] = {}
        self._truth: dict[str, Any] = {}
        self._labels: dict[str, Any] = {}
        self._add_bodies()

    def names(self) -> list[str]:
        """The layers that this scene has."""
        there = {
            "skin": self.scene.body is not None,
            "bones": self.scene.body is not None,
            "points": self.scene.recording is not None,
            "truth": self.scene.truth is not None,
            "markers": self.scene.markers is not None,
            "labels": self.scene.body is not None,
        }
        return [name for name in LAYERS if there[name]]

    def switch(self, name: str, visible: bool) -> None:
        """Show or hide a layer."""
        self._groups[name].visible = visible

    def show(self, k: int, content: FrameContent, *, theta: Floats | None = None) -> None:
        """Show frame k. ``theta`` (n,) is the pose that ``content`` is posed in, for the labels."""
        with self._server.atomic():
            self._show_posed(k, content.posed)
            self._show_truth(content.truth)
            self._show_points(content.seen)
            self._show_markers(k)
            self._show_labels(k, content.posed, theta)

    def _add_bodies(self) -> None:
        if self.scene.body is not None:
            anatomy, rest = self.scene.body.anatomy, pose_body(self.scene.body, rest_theta(self.scene.body))
            part = self._skin_part = self._skin_part or Skin(slice(None), anatomy.skin_faces)
            vertices = np.zeros((0, 3)) if rest is None else rest.skin[part.vertices]
            self._skin = self._mesh("/skin/surface", vertices, part.faces, SKIN, 0.24)
            for bone in anatomy.bones:
                mesh = self.scene.body.rest_bones[bone.name]
                self._bones[bone.name] = self._mesh(f"/bones/{bone.name}", mesh, bone.faces, BONE, None)
            for k, joint in enumerate(anatomy.joints):
                # Joints may lie close together (elbow and forearm): their words go to either side.
                self._labels[joint.name] = self._server.scene.add_label(
                    f"/labels/{joint.name}", "", anchor="bottom-left" if k % 2 else "top-left", visible=False
                )
        if self.scene.truth is not None:
            for bone in self.scene.truth.body.anatomy.bones:
                mesh = self.scene.truth.body.rest_bones[bone.name]
                self._truth[bone.name] = self._mesh(f"/truth/{bone.name}", mesh, bone.faces, TRUTH, None)

    def _mesh(self, name: str, vertices: Any, faces: Ints, colour: tuple[int, int, int], opacity: float | None) -> Any:
        return self._server.scene.add_mesh_simple(
            name,
            np.asarray(vertices, dtype=np.float32),
            faces.astype(np.uint32),
            color=colour,
            opacity=opacity,
            side="front",
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )

    def _show_posed(self, k: int, posed: Posed | None) -> None:
        if self._skin is None or self._skin_part is None:
            return
        self._skin.visible = posed is not None
        if posed is not None:
            self._skin.vertices = posed.skin[self._skin_part.vertices]
        for name, handle in self._bones.items():
            _place(handle, posed, name)
            colour = BONE if self.scene.shows(name, k) else _UNKNOWN
            if handle.color != colour:
                handle.color = colour

    def _show_truth(self, truth: Posed | None) -> None:
        for name, handle in self._truth.items():
            _place(handle, truth, name)

    def _show_points(self, seen: SeenPoints | None) -> None:
        if seen is None or not len(seen.points):
            if self._points is not None:
                self._points.visible = False
            return
        seen = fewer(seen)
        # Replaced as a whole: a node with more points than colours for a moment would be an error.
        self._points = self._server.scene.add_point_cloud(
            "/points/cloud",
            seen.points,
            error_colours(seen),
            point_size=0.0018,
            point_shape="circle",
            precision="float32",
        )

    def _show_markers(self, k: int) -> None:
        if self.scene.markers is None:
            return
        at = np.array([points[k] for points in self.scene.markers.values()])
        known = at[np.isfinite(at).all(axis=1)]
        shown = known if len(known) else np.zeros((1, 3))  # a node without points would be an error
        self._markers = self._server.scene.add_point_cloud(
            "/markers/cloud", shown, MARKER, point_size=0.008, point_shape="circle", precision="float32"
        )
        self._markers.visible = len(known) > 0

    def _show_labels(self, k: int, posed: Posed | None, theta: Floats | None) -> None:
        for name, handle in self._labels.items():
            text = "" if theta is None else label(self.scene, name, k, theta)
            handle.visible = bool(text) and posed is not None
            if posed is not None and text:
                handle.position = posed.centres[name]
                handle.text = text


def label(scene: Scene, joint_name: str, k: int, theta: Floats) -> str:
    """A joint's angles in frame k, each with one standard deviation where there is one."""
    if scene.anatomy is None:
        return ""
    joints = scene.anatomy.joints
    first = next(k for k, joint in enumerate(joints) if joint.name == joint_name)
    # A coordinate that joints share is told once.
    own = set(joints[first].coordinates).difference(*(joint.coordinates for joint in joints[:first]))
    parts = []
    for i, coordinate in joint_coordinates(scene.anatomy):
        if coordinate.name in own and np.isfinite(theta[i]):
            unit = "°" if UNITS[coordinate.unit] == "deg" else " m"
            spread = np.nan if scene.motion is None else scene.motion.deviations[k, i]
            error = f" ± {as_shown(coordinate, float(spread)):.1f}{unit}" if np.isfinite(spread) else ""
            parts.append(f"{coordinate.name} {as_shown(coordinate, float(theta[i])):.1f}{unit}{error}")
    return ", ".join(parts)


def fewer(seen: SeenPoints) -> SeenPoints:
    """Some of the points, spread over all: more of them would hide the bones.

    >>> points = np.zeros((100_000, 3), dtype=np.float32)
    >>> len(fewer(SeenPoints(points, None)).points), len(fewer(SeenPoints(points[:5], None)).points)
    (1800, 5)
    """
    some = np.linspace(0, len(seen.points) - 1, min(POINTS, len(seen.points))).astype(int)
    return SeenPoints(seen.points[some], None if seen.distances is None else seen.distances[some], seen.problem)


def error_colours(seen: SeenPoints) -> NDArray[np.uint8]:
    """Colours (N, 3) of points: dark violet on the skin to orange at 10 mm; grey beyond 20 mm, or one colour.

    >>> seen = SeenPoints(np.zeros((3, 3), np.float32), np.array([0.0, 0.01, 0.03], np.float32))
    >>> error_colours(seen).tolist()
    [[12, 7, 134], [252, 166, 53], [150, 150, 150]]
    """
    if seen.distances is None:
        return np.tile(np.array(PLAIN, dtype=np.uint8), (len(seen.points), 1))
    share = np.clip(seen.distances / LARGEST_ERROR_M, 0.0, 1.0)
    colours: NDArray[np.uint8] = _scale()[(255.0 * share).astype(int)]
    colours[seen.distances > FAR_M] = FAR
    return colours


@lru_cache(maxsize=1)
def _scale() -> NDArray[np.uint8]:
    from matplotlib import colormaps

    # The light end of the map is left out: on a light ground nobody sees it.
    scale: NDArray[np.uint8] = np.asarray(
        255.0 * colormaps["plasma"](np.linspace(0.0, 0.8, 256))[:, :3], dtype=np.uint8
    )
    return scale


def _place(handle: Any, posed: Posed | None, bone: str) -> None:
    """Put a bone's mesh where a body has it; of a bone along a curve all vertices anew."""
    transform = None if posed is None else posed.bones[bone]
    known = transform is not None and bool(np.isfinite(transform).all())
    handle.visible = known
    if posed is None or transform is None or not known:
        return
    if bone in posed.along:
        handle.vertices = posed.along[bone]
        return
    handle.wxyz = Rotation.from_matrix(transform[:3, :3]).as_quat(scalar_first=True)
    handle.position = transform[:3, 3]


@dataclass(frozen=True, eq=False)
class Eye:
    """Where a scene is looked at from: position (3,), what is in the middle (3,), which way is up (3,)."""

    position: Floats
    middle: Floats
    up: Floats


def first_eye(scene: Scene, frames: FrameStore) -> Eye:
    """Half beside the first sensor's line of sight, so near that the limb fills the picture in every frame."""
    some = np.unique(np.linspace(0, len(scene.times) - 1, _FRAMED).round().astype(int))
    points = np.concatenate([_extent(scene, frames, int(k)) for k in some])
    middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
    if scene.recording is None:
        up, towards = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.25, 1.0])
    else:
        sensors = [world_from_sensor(scene.recording, sensor.name) for sensor in scene.recording.sensors]
        # Sensors that look down from opposite sides tilt to either side: their mean is upright.
        up = -np.sum([sensor[:3, 1] for sensor in sensors], axis=0)
        up, towards = up / np.linalg.norm(up), sensors[0][:3, 3] - middle
        towards = Rotation.from_rotvec(_BESIDE * up).apply(towards)
    towards = towards / np.linalg.norm(towards)
    return Eye(middle + distance_to_see(points - middle, towards) * towards, middle, up)


def distance_to_see(points: Floats, towards: Floats) -> float:
    """How far along ``towards`` (3,) an eye must be to have all points (N, 3) about the origin in a square picture.

    >>> ends = np.array([[0.0, 0.1, 0.0], [0.0, -0.1, 0.0]])
    >>> [round(distance_to_see(size * ends, np.array([1.0, 0.0, 0.0])), 2) for size in (1.0, 2.0)]
    [0.25, 0.51]
    """
    along = points @ towards
    beside = np.linalg.norm(points - along[:, None] * towards, axis=1)
    return _MARGIN * float((along + beside / np.tan(0.5 * _FIELD)).max())


def _extent(scene: Scene, frames: FrameStore, k: int) -> Single:
    if scene.body is not None and scene.thetas is not None and np.isfinite(scene.thetas[k]).all():
        return pose_skin(scene.body, scene.thetas[k]).astype(np.float32)
    seen = frames.get(k).seen
    if seen is not None and len(seen.points):
        return seen.points
    return np.zeros((0, 3), dtype=np.float32)


def set_eye(server: viser.ViserServer, eye: Eye) -> None:
    """Look from there when a browser connects."""
    server.scene.set_up_direction(eye.up)
    server.initial_camera.up = tuple(eye.up)
    server.initial_camera.position = tuple(eye.position)
    server.initial_camera.look_at = tuple(eye.middle)
    server.initial_camera.fov = float(_FIELD)
