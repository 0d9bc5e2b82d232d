"""One training window: a sensor somewhere before a scene, what it sees of it, and the truth.

There are three kinds: a person (with or without the room, a second person), a crop (a lone arm or leg, or what a
sensor sees that stands near one), and a room without anybody.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import cast

import cv2
import numpy as np
from numpy.typing import NDArray

from adapt.search.figure.names import JOINTS, LIMBS, PARTS
from adapt.search.figure.window import NEAREST_M, PIXELS, REACH_M, Window
from adapt.template_builder.first_pose.faults import spoil
from adapt.template_builder.first_pose.render import Grid, draw_box, draw_mesh, empty_image
from adapt.template_builder.first_pose.room import Box

Floats = NDArray[np.float64]
Codes = NDArray[np.uint8]
Bools = NDArray[np.bool_]

KINDS = ("person", "crop", "nobody")
SHARES = (0.57, 0.38, 0.05)
OTHERS = 100
"""Added to the part codes of people who are not meant."""
NO_DEPTH = -32768

SAMPLE = np.dtype(
    [
        ("depth", "<i2", (PIXELS, PIXELS)),  # mm beyond the window's, NO_DEPTH where there is none
        ("parts", "u1", (PIXELS // 2, PIXELS // 2)),  # of every second pixel: rows and columns 1, 3, 5 ..
        ("joints", "<f4", (len(JOINTS), 3)),  # places in the window
        ("kind", "u1"),
    ]
)
"""A training window as it is kept in files."""

_LEAST_PIXELS = {"person": 120, "crop": 60, "nobody": 300}


@dataclass(frozen=True)
class Mesh:
    """A body's skin (V, 3) m with a code for each triangle (F,): its part, or that plus OTHERS."""

    points: Floats = field(repr=False)
    faces: NDArray[np.int32] = field(repr=False)
    codes: Codes = field(repr=False)


@dataclass(frozen=True)
class Scene:
    """People and things, the joints (19, 3) m of the person who is meant, and the floor's height (m)."""

    people: list[Mesh]
    boxes: list[Box]
    joints: Floats = field(repr=False)
    floor: float


@dataclass(frozen=True)
class View:
    """A sensor: where it is (3,) m, its axes as rows (right, down, forward), half its field of view as slopes."""

    eye: Floats = field(repr=False)
    axes: Floats = field(repr=False)
    half: tuple[float, float]

    def sees(self, points: Floats) -> Floats:
        """Points (N, 3) in the sensor's frame."""
        return np.asarray((points - self.eye) @ self.axes.T)


def draw_view(rng: np.random.Generator, scene: Scene, *, near: bool) -> View:
    """A sensor that looks at the person from anywhere about, 0.8 to 4 m off; ``near``: at one joint, 0.6 to 1.6 m."""
    if near:
        away, target = rng.uniform(0.6, 1.6), scene.joints[rng.integers(3, len(JOINTS))]
    else:
        away, target = rng.uniform(1.0, 4.2), scene.joints[0] + [0.0, rng.uniform(-0.15, 0.35), 0.0]
    target = target + rng.normal(0.0, 0.07, 3)
    turn = rng.uniform(0.0, 2.0 * np.pi)
    eye = target + away * np.array([np.sin(turn), 0.0, np.cos(turn)])
    eye[1] = scene.floor + rng.uniform(0.4, 2.3)
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    roll = np.radians(rng.normal(0.0, 5.0))
    axes = np.stack([np.cos(roll) * right + np.sin(roll) * down, np.cos(roll) * down - np.sin(roll) * right, forward])
    half = np.array([0.75, 0.62]) if rng.random() < 0.3 else np.array([0.56, 0.42]) * rng.uniform(0.85, 1.15)
    return View(eye, axes, (half[1], half[0]) if rng.random() < 0.12 else (half[0], half[1]))


def photograph(scene: Scene, view: View, grid: Grid) -> tuple[NDArray[np.float32], Codes]:
    """Clean depth (H, W) m and codes (H, W) on a grid of slopes."""
    depth, codes = empty_image(grid)
    for mesh in scene.people:
        draw_mesh(grid, view.sees(mesh.points), mesh.faces, mesh.codes, depth, codes)
    for box in scene.boxes:
        centre = view.sees(box.centre[None])[0]
        draw_box(grid, centre, (view.axes @ box.axes).T, box.size / 2.0, 0, depth, codes)
    return depth, codes


def draw_sample(rng: np.random.Generator, scene: Scene) -> np.void | None:
    """One window of the scene as a ``SAMPLE``, or None where too little of the person is in view."""
    kind = KINDS[rng.choice(len(KINDS), p=SHARES)]
    if kind == "nobody":
        scene = Scene([], scene.boxes, scene.joints, scene.floor)
    view = draw_view(rng, scene, near=kind == "crop" and rng.random() < 0.6)
    window = _aim(rng, scene, view, kind)
    if window is None:
        return None
    depth, codes = _seen(rng, scene, view, window, kind)
    if kind == "crop":
        kept = _cropped(rng, window, codes, window.place(view.sees(scene.joints)))
        depth = np.where(kept, depth, 0.0).astype(np.float32)
    depth, codes = spoil(rng, depth, np.where(codes > OTHERS, codes - OTHERS, codes).astype(np.uint8))
    return _sample(rng, scene, view, window, (depth, codes), kind)


def _aim(rng: np.random.Generator, scene: Scene, view: View, kind: str) -> Window | None:
    """A first window: about what is seen of the person, or, where there is nobody, about anything."""
    coarse = view.half[0] / 32
    rows = int(view.half[1] / coarse) * 2
    depth, codes = photograph(scene, view, Grid(-view.half[0], -view.half[1], coarse, rows, 64))
    aimed = (depth > 0.4) & (depth < 4.0) if kind == "nobody" else (codes > 0) & (codes < OTHERS)
    if aimed.sum() < 14:
        return None
    i, j = np.nonzero(aimed)
    if kind == "nobody":
        k = rng.integers(len(i))
        i, j, z = i[k : k + 1], j[k : k + 1], float(depth[i[k], j[k]])
    else:
        z = float(np.median(depth[aimed]))
    x, y = (np.array([j.min() + j.max(), i.min() + i.max()]) / 2) * coarse - np.array(view.half)
    return Window(z, float(x), float(y)) if z > 0.35 else None


def _seen(
    rng: np.random.Generator, scene: Scene, view: View, window: Window, kind: str
) -> tuple[NDArray[np.float32], Codes]:
    """The clean window: with the room, without its floor, or nothing but the person."""
    first = (0.5 - PIXELS / 2) * window.step
    depth, codes = photograph(scene, view, Grid(window.x + first, window.y + first, window.step, PIXELS, PIXELS))
    slopes = first + np.arange(PIXELS) * window.step
    within = (np.abs(window.x + slopes) <= view.half[0]) & (np.abs(window.y + slopes) <= view.half[1])[:, None]
    depth = np.where(within, depth, 0.0).astype(np.float32)
    lot = rng.random()
    if lot < 0.4 and kind != "nobody":
        own = (codes > 0) & (codes < OTHERS)
        if rng.random() < 0.3:
            own = cv2.dilate(own.astype(np.uint8), np.ones((3, 3))) > 0
        depth = np.where(own, depth, 0.0).astype(np.float32)
    elif lot < 0.65:
        heights = view.eye[1] + depth * (
            view.axes[0, 1] * (window.x + slopes) + view.axes[1, 1] * (window.y + slopes)[:, None] + view.axes[2, 1]
        )
        depth[(codes == 0) & (heights < scene.floor + rng.uniform(0.0, 0.06))] = 0.0
    return depth, np.where(depth > 0.0, codes, 0).astype(np.uint8)


def _cropped(rng: np.random.Generator, window: Window, codes: Codes, joints: Floats) -> Bools:
    """What is kept (128, 128) of a crop: a limb's own pixels, perhaps with a rim, or a rectangle about a joint."""
    lot = rng.random()
    if lot < 0.45:
        limb = list(LIMBS)[rng.choice(4, p=[0.3, 0.3, 0.2, 0.2])]
        parts = LIMBS[limb] if rng.random() < 0.75 else LIMBS[limb][1:]
        own = np.isin(codes, parts)
        if rng.random() < 0.4:
            own = cv2.dilate(own.astype(np.uint8), np.ones((5, 5))) > 0
        return np.asarray(own)
    if lot < 0.85:
        u, v = joints[rng.integers(3, len(JOINTS)), :2] + rng.normal(0.0, 4.0, 2)
        half = rng.uniform(9.0, 36.0, 2)
        across, down = np.abs(np.arange(PIXELS) + 0.5 - u) < half[0], np.abs(np.arange(PIXELS) + 0.5 - v) < half[1]
        return np.asarray(across & down[:, None])
    legs = (*LIMBS["leg_l"], *LIMBS["leg_r"])  # both legs, as a gait laboratory's sensor sees them
    below = np.arange(PIXELS)[:, None] + 0.5 > joints[JOINTS.index("pelvis"), 1] + rng.uniform(-4.0, 20.0)
    lower = np.broadcast_to(below, codes.shape) if rng.random() < 0.5 else np.isin(codes, legs)
    return np.asarray(lower)


def _sample(
    rng: np.random.Generator,
    scene: Scene,
    view: View,
    window: Window,
    seen: tuple[NDArray[np.float32], Codes],
    kind: str,
) -> np.void | None:
    """The sample, its window moved by lot about what is left of the person."""
    depth, codes = seen
    own = (depth > NEAREST_M) & (codes > 0) if kind != "nobody" else depth > NEAREST_M
    if own.sum() < _LEAST_PIXELS[kind]:
        return None
    z0 = float(np.median(depth[own])) if kind == "crop" else window.depth
    z0 += rng.normal(0.0, 0.05)
    i, j = np.nonzero(own) if kind == "crop" else (np.array([0, PIXELS - 1]),) * 2
    shift = np.rint(PIXELS / 2 - np.array([j.min() + j.max() + 1, i.min() + i.max() + 1]) / 2 + rng.normal(0, 3.5, 2))
    beyond = _moved(np.where(depth > NEAREST_M, depth - z0, np.nan), shift)
    parts = _moved(codes.astype(np.float64), shift)
    with np.errstate(invalid="ignore"):
        kept = np.abs(beyond) < REACH_M
    if (kept & (parts > 0)).sum() < (0 if kind == "nobody" else _LEAST_PIXELS[kind] // 2):
        return None
    sample = np.zeros((), SAMPLE)
    sample["depth"] = np.where(kept, np.rint(1e3 * np.nan_to_num(beyond)), NO_DEPTH)
    sample["parts"] = np.where(kept, np.nan_to_num(parts), PARTS.index("nothing"))[1::2, 1::2]
    joints = window.place(view.sees(scene.joints))
    joints[:, :2] += shift
    joints[:, 2] += window.depth - z0
    sample["joints"] = joints
    sample["kind"] = KINDS.index(kind)
    return cast(np.void, sample[()])


def _moved(image: Floats, shift: Floats) -> Floats:
    """An image (128, 128) moved by whole pixels (right, down); NaN comes in."""
    move = np.array([[1.0, 0.0, shift[0]], [0.0, 1.0, shift[1]]])
    return np.asarray(
        cv2.warpAffine(image.astype(np.float32), move, image.shape[::-1], flags=cv2.INTER_NEAREST, borderValue=np.nan)
    )
