"""Frames to judge the first-pose network by: bodies, rig and poses that it was not trained on, before two sensors.

Bodies are MakeHuman's of other seeds in Mixamo's rig; poses are drawn from ranges of angles, every joint by itself,
which training does not do; the joints are MakeHuman's own centres, in truth and answer alike. All of it is synthetic.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from adapt.search.figure.names import JOINTS, LIMBS
from adapt.template_builder.first_pose.clothes import Wardrobe
from adapt.template_builder.first_pose.people import Person, Rig, draw_phenotype
from adapt.template_builder.first_pose.poses import (
    SIGN,
    ArmAngles,
    LegAngles,
    Turns,
    about,
    arm_turns,
    leg_turns,
)
from adapt.template_builder.first_pose.render import Grid
from adapt.template_builder.first_pose.room import Box, furnish
from adapt.template_builder.first_pose.windows import Mesh, Scene, View, photograph
from capture.camera import Camera, backproject
from capture.rigid import apply, inverse, transform

Floats = NDArray[np.float64]

RIG = "mixamo"
CAMERA = Camera(320, 240, 285.0, 285.0, 159.5, 119.5)
_AWAY_M, _ASIDE_DEG, _HIGH_M = 2.4, 40.0, 1.2
_NOISE = 1.2e-3  # m at 1 m, growing with the square of depth
_EDGE_M = 0.05  # depth is lost where it jumps by more


@dataclass(frozen=True)
class Difficulty:
    """How much of the ranges of angles is used, and how far people turn away from the sensors (degrees)."""

    angles: float
    heading: float


HARD, EASY = Difficulty(1.0, 180.0), Difficulty(0.35, 40.0)

_ARM = {"elevation": (0.0, 150.0), "plane": (-30.0, 120.0), "flexion": (0.0, 140.0), "twist": (-60.0, 70.0)}
_HAND = {"forearm": (-60.0, 60.0), "wrist": (-35.0, 35.0), "fist": (0.0, 40.0)}
_LEG = {"hip": (-15.0, 95.0), "knee": (0.0, 120.0), "abduction": (-8.0, 35.0), "twist": (-20.0, 25.0)}
_TRUNK = {"bend": (-10.0, 50.0), "yaw": (-30.0, 30.0), "side": (-20.0, 20.0), "pitch": (-10.0, 30.0)}


@dataclass(frozen=True, eq=False)
class SensorImage:
    """What one sensor sees: depth (H, W) m, 0 where none; true parts (H, W), 0 off the person; its place (4, 4)."""

    depth: NDArray[np.float32] = field(repr=False)
    parts: NDArray[np.uint8] = field(repr=False)
    world_from_sensor: Floats = field(repr=False)


@dataclass(frozen=True, eq=False)
class Frame:
    """Images of two sensors, and the true joints (19, 3) m."""

    images: tuple[SensorImage, ...]
    joints: Floats = field(repr=False)


@lru_cache(maxsize=1)
def _people() -> tuple[Rig, Wardrobe]:
    rig = Rig(RIG)
    return rig, Wardrobe(rig)


def draw_frames(seed: int, count: int, difficulty: Difficulty) -> Iterator[Frame]:
    """So many frames, each of another person, dressed, on a floor that is left in the picture."""
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        scene = _scene(rng, difficulty)
        images = tuple(_image(rng, scene, angle) for angle in (-_ASIDE_DEG, _ASIDE_DEG))
        yield Frame(images, scene.joints)


def draw_limb_images(seed: int, count: int, limb: str) -> Iterator[tuple[SensorImage, NDArray[np.bool_]]]:
    """Images of a sensor 1 m from an elbow or a knee, and which pixels are of that limb of ``LIMBS``.

    Nothing but the limb and what else lies within 0.35 m of its elbow or knee is left in every second image, nothing
    but the limb in the others.
    """
    middle = ("elbow" if limb.startswith("arm") else "knee") + limb[-2:]
    drawn, k = 0, 0
    while drawn < count:
        k += 1
        rng = np.random.default_rng([seed, k])
        scene = _scene(rng, HARD)
        centre = scene.joints[JOINTS.index(middle)]
        turn = rng.uniform(0.0, 2.0 * np.pi)
        eye = centre + np.array([np.cos(turn), rng.uniform(0.0, 0.5), np.sin(turn)])
        image = _picture(rng, scene, _looking(eye, centre))
        own = np.isin(image.parts, LIMBS[limb]) & (image.depth > 0.0)
        if own.sum() < 1500:
            continue
        kept = own if drawn % 2 else _near(image, centre, 0.35) & (image.parts > 0)
        drawn += 1
        yield SensorImage(np.where(kept, image.depth, 0.0), image.parts, image.world_from_sensor), own & kept


def draw_rooms(seed: int, count: int) -> Iterator[SensorImage]:
    """Images of furniture and walls without anybody."""
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        joints = rng.normal(0.0, 0.3, (19, 3))
        boxes = furnish(rng, joints, -0.9, 0.0, seated=True)[1:]
        yield _image(rng, Scene([], boxes, joints, -0.9), rng.uniform(-60.0, 60.0))


def _scene(rng: np.random.Generator, difficulty: Difficulty) -> Scene:
    rig, wardrobe = _people()
    person = rig.person(draw_phenotype(rng))
    skin, joints = rig.pose(person, _turns(rng, person, difficulty), wardrobe.dress(rng, person))
    floor = float(skin[:, 1].min())
    ground = Box(np.array([joints[0, 0], floor - 0.01, joints[0, 2]]), np.eye(3), np.array([8.0, 0.02, 8.0]))
    return Scene([Mesh(skin, rig.faces, rig.face_parts)], [ground], joints, floor)


def _turns(rng: np.random.Generator, person: Person, difficulty: Difficulty) -> Turns:
    def drawn(ranges: dict[str, tuple[float, float]]) -> dict[str, float]:
        return {name: difficulty.angles * rng.uniform(*ends) for name, ends in ranges.items()}

    turns: Turns = {}
    for side in SIGN:
        turns |= arm_turns(person, side, ArmAngles(**drawn(_ARM), **drawn(_HAND)))
        turns |= leg_turns(side, LegAngles(**drawn(_LEG)))
    trunk = drawn(_TRUNK)
    turns["spine"] = about("zyx", -trunk["bend"] / 3.0, trunk["yaw"] / 3.0, trunk["side"] / 3.0)
    turns["pelvis"] = about("y", rng.uniform(-1.0, 1.0) * difficulty.heading) @ about("z", -trunk["pitch"])
    return turns


def _image(rng: np.random.Generator, scene: Scene, angle: float) -> SensorImage:
    """The scene from the front, turned about the person by an angle (degrees)."""
    front = about("y", angle) @ np.array([_AWAY_M, 0.0, 0.0])
    eye = scene.joints[0] * [1.0, 0.0, 1.0] + front + [0.0, scene.floor + _HIGH_M, 0.0]
    return _picture(rng, scene, _looking(eye, scene.joints[0]))


def _looking(eye: Floats, at: Floats) -> View:
    forward = (at - eye) / np.linalg.norm(at - eye)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    return View(eye, np.stack([right, np.cross(forward, right), forward]), (1.0, 1.0))


def _picture(rng: np.random.Generator, scene: Scene, view: View) -> SensorImage:
    grid = Grid(-CAMERA.cx / CAMERA.fx, -CAMERA.cy / CAMERA.fy, 1.0 / CAMERA.fx, CAMERA.height, CAMERA.width)
    depth, parts = photograph(scene, view, grid)
    noisy = depth + _NOISE * depth**2 * rng.standard_normal(depth.shape, np.float32)
    rise = np.hypot(*np.gradient(depth))
    noisy = np.where((depth > 0.0) & (rise < _EDGE_M), noisy, 0.0).astype(np.float32)
    world_from_sensor = inverse(transform(view.axes, -view.axes @ view.eye))
    return SensorImage(noisy, parts, world_from_sensor)


def _near(image: SensorImage, centre: Floats, within: float) -> NDArray[np.bool_]:
    """The pixels (H, W) whose points lie within a distance (m) of a point."""
    points = apply(image.world_from_sensor, backproject(CAMERA, image.depth).reshape(-1, 3))
    with np.errstate(invalid="ignore"):
        near = np.linalg.norm(points - centre, axis=1) < within
    return np.asarray(near.reshape(image.depth.shape))
