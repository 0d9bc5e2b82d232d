"""What each frame of a scene shows: posed skin and bones, the cloud and how far it is from the skin.

Computing a frame takes longer than showing it, so frames are kept, and made ahead of being asked for.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Floats
from adapt.model.body import Body, bone_transforms, joint_centres, pose_skin, posed_bones
from capture.cloud.fuse import Region, fuse
from capture.errors import BonetrackError
from track.accuracy.mesh_distance import distance_to_mesh
from track.view.scene import Scene

Single = NDArray[np.float32]
_PATIENCE_S = 5.0  # for a thread to end


@dataclass(frozen=True, eq=False)
class Posed:
    """A body in a pose: skin (V, 3) m, T_b (4, 4) of the bones that can be placed, joint centres (3,).

    ``along`` are surfaces (N, 3) m of bones along a curve, which no transform places.
    """

    skin: Single = field(repr=False)
    bones: dict[str, Floats]
    centres: dict[str, Floats]
    along: dict[str, Single] = field(default_factory=dict, repr=False)


@dataclass(frozen=True, eq=False)
class SeenPoints:
    """A cloud (N, 3) m and, where there is a body, each point's distance to its skin (N,) m."""

    points: Single = field(repr=False)
    distances: Single | None = field(repr=False)
    problem: str = ""


@dataclass(frozen=True, eq=False)
class FrameContent:
    """One frame: who is shown, what the truth is, what was seen. None where there is nothing."""

    posed: Posed | None
    truth: Posed | None
    seen: SeenPoints | None


def pose_body(body: Body, theta: Floats) -> Posed | None:
    """A body in the pose theta (n,); None where the pose is not known.

    >>> from adapt.anatomy_file import load_anatomy
    >>> from adapt.model.body import make_body
    >>> pose_body(make_body(load_anatomy("upper-limb-right")), np.full(10, np.nan)) is None
    True
    """
    if not np.isfinite(theta).all():
        return None
    skin = pose_skin(body, theta).astype(np.float32)
    return Posed(skin, bone_transforms(body, theta), joint_centres(body, theta), _along(body, theta))


def _along(body: Body, theta: Floats) -> dict[str, Single]:
    """The surfaces (N, 3) m of bones along a curve in a pose (n,)."""
    names = [bone.name for bone in body.anatomy.bones if bone.along is not None]
    posed = posed_bones(body, theta) if names else {}
    return {name: posed[name].astype(np.float32) for name in names}


def truth_of(scene: Scene, k: int) -> Posed | None:
    """The truth at frame k in the recording's frame."""
    if scene.truth is None or not np.isfinite(scene.truth.thetas[k]).all():
        return None
    common, theta = scene.truth.common_from_world, scene.truth.thetas[k]
    skin = pose_skin(scene.truth.body, theta) @ common[:3, :3].T + common[:3, 3]
    bones = {name: common @ placed for name, placed in bone_transforms(scene.truth.body, theta).items()}
    centres = {
        name: common[:3, :3] @ centre + common[:3, 3] for name, centre in joint_centres(scene.truth.body, theta).items()
    }
    along = {
        name: (surface @ common[:3, :3].T + common[:3, 3]).astype(np.float32)
        for name, surface in _along(scene.truth.body, theta).items()
    }
    return Posed(skin.astype(np.float32), bones, centres, along)


def seen_points(scene: Scene, k: int, posed: Posed | None, *, region: Region | None = None) -> SeenPoints | None:
    """The cloud of frame k, with distances to the posed skin."""
    if scene.recording is None or scene.moments is None:
        return None
    try:
        cloud = fuse(scene.recording, scene.moments[k], region=region or scene.region)
    except BonetrackError as error:
        return SeenPoints(np.zeros((0, 3), dtype=np.float32), None, error.problem)
    points = cloud.points.astype(np.float32)
    return SeenPoints(points, distances(scene, points, posed))


def distances(scene: Scene, points: Single, posed: Posed | None) -> Single | None:
    """Distance (N,) of points to the posed skin, or None without one."""
    if posed is None or scene.anatomy is None:
        return None
    faces = scene.anatomy.skin_faces
    return distance_to_mesh(points.astype(np.float64), posed.skin.astype(np.float64), faces).astype(np.float32)


class FrameStore:
    """Frames by number, kept once made (at most ``capacity``), and made ahead of time by a thread of its own."""

    def __init__(self, scene: Scene, *, capacity: int = 600, region: Region | None = None) -> None:
        self._scene, self._capacity, self._region = scene, capacity, region
        self._kept: OrderedDict[int, FrameContent] = OrderedDict()
        self._lock = threading.Lock()
        self._stopped = threading.Event()
        self._wanted = threading.Event()
        self._thread: threading.Thread | None = None
        self._from = 0

    def get(self, k: int) -> FrameContent:
        """Everything of frame k."""
        with self._lock:
            content = self._kept.get(k)
            if content is not None:
                self._kept.move_to_end(k)
                return content
        content = self._make(k)
        with self._lock:
            self._kept[k] = content
            while len(self._kept) > self._capacity:
                self._kept.popitem(last=False)
        return content

    def ready(self, k: int) -> FrameContent | None:
        """Frame k if it is there already."""
        with self._lock:
            return self._kept.get(k)

    def make_ahead(self, then: Callable[[int], None]) -> None:
        """Begin making frames, from the one last looked at onwards; ``then`` is told of each."""
        self._thread = threading.Thread(target=self._run, args=(then,), daemon=True)
        self._thread.start()

    def look_at(self, k: int) -> None:
        """Frames from k on are wanted next."""
        self._from = k
        self._wanted.set()

    def stop(self) -> None:
        """End the thread, after the frame that it is at."""
        self._stopped.set()
        self._wanted.set()
        if self._thread is not None:
            self._thread.join(_PATIENCE_S)

    def _run(self, then: Callable[[int], None]) -> None:
        while not self._stopped.is_set():
            number = self._next()
            if number is None:
                self._wanted.wait()
                self._wanted.clear()
                continue
            self.get(number)
            if not self._stopped.is_set():
                then(number)

    def _next(self) -> int | None:
        count = len(self._scene.times)
        ahead = min(count, self._capacity)
        for step in range(ahead):
            number = (self._from + step) % count
            if self.ready(number) is None:
                return number
        return None

    def _make(self, k: int) -> FrameContent:
        scene = self._scene
        posed = None if scene.body is None or scene.thetas is None else pose_body(scene.body, scene.thetas[k])
        return FrameContent(posed, truth_of(scene, k), seen_points(scene, k, posed, region=self._region))
