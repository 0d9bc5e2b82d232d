"""Shards of simulated windows: a person, a pose, a room and several sensors at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adapt.template_builder.first_pose.clothes import Wardrobe
from adapt.template_builder.first_pose.people import Rig, draw_phenotype
from adapt.template_builder.first_pose.poses import draw_pose
from adapt.template_builder.first_pose.room import furnish
from adapt.template_builder.first_pose.windows import OTHERS, SAMPLE, Mesh, Scene, draw_sample
from capture.files import replaced_when_complete

PER_SHARD = 1024
_PER_SCENE = 5
_SECOND = 0.25  # of scenes, with another person
_SEATED_FLOOR = 0.42  # m below the pelvis, at least


def make_shards(folder: Path, *, seed: int, shards: int, say: Callable[[str], object], per: int = PER_SHARD) -> None:
    """Write ``shards`` files ``SEED-NNNN.npy`` into a folder; those that are there are kept, so that it goes on.

    Shard n of a seed is the same whenever it is made.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rig = Rig()
    wardrobe = Wardrobe(rig)
    for shard in range(shards):
        path = folder / f"{seed}-{shard:04d}.npy"
        if path.exists():
            continue
        windows = draw_windows(np.random.default_rng([seed, shard]), rig, wardrobe)
        samples = np.array([next(windows) for _ in range(per)], SAMPLE)
        with replaced_when_complete(path) as partial:
            np.save(partial, samples)
        say(f"{path}: {len(samples)} windows")


def read_shards(folder: Path) -> list[NDArray[np.void]]:
    """The shards of a folder, in the order of their names, mapped into memory."""
    return [np.load(path, mmap_mode="r") for path in sorted(folder.glob("*.npy"))]


def draw_windows(rng: np.random.Generator, rig: Rig, wardrobe: Wardrobe) -> Iterator[np.void]:
    """Windows without end: a new person, pose and room every few of them."""
    other: Mesh | None = None
    while True:
        scene, other = draw_scene(rng, rig, wardrobe, other)
        for _ in range(_PER_SCENE):
            sample = draw_sample(rng, scene)
            if sample is not None:
                yield sample


def draw_scene(rng: np.random.Generator, rig: Rig, wardrobe: Wardrobe, other: Mesh | None) -> tuple[Scene, Mesh]:
    """A scene about a person whose pelvis is at the origin, and that person's mesh to stand by in the next scene."""
    person = rig.person(draw_phenotype(rng))
    pose = draw_pose(rng, person)
    skin, joints = rig.pose(person, pose.turns, wardrobe.dress(rng, person))
    skin, joints = skin - joints[0], joints - joints[0]
    seated = pose.stance == "sitting"
    floor = float(min(skin[:, 1].min(), -_SEATED_FLOOR)) if seated else float(skin[:, 1].min())
    people = [Mesh(skin, rig.faces, rig.face_parts)]
    if other is not None and rng.random() < _SECOND:
        turn, away = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.55, 1.4)
        beside = np.array([away * np.sin(turn), floor - other.points[:, 1].min(), away * np.cos(turn)])
        people.append(Mesh(other.points + beside, other.faces, (other.codes + OTHERS).astype(np.uint8)))
    boxes = furnish(rng, joints, floor, pose.heading, seated=seated)
    return Scene(people, boxes, joints, floor), people[0]
