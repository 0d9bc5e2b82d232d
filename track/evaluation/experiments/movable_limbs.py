"""A real man's limbs made to move: his joints, and how far they turn over time."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from adapt.anatomy import Floats
from capture.rigid import exp_so3, transform
from track.evaluation.experiments.real_limbs import FOLDER, LIMBS, in_world, read_limb
from track.evaluation.experiments.surface_fit import read_mesh
from track.evaluation.jointed import Jointed, Turn, heat_weights, shared_along
from track.evaluation.made_up_motions import FPS
from track.evaluation.swing import Swing, times_and_phase

SECONDS = 2.0
_SWAY_DEG = 14.0


@dataclass(frozen=True, eq=False)
class Movable:
    """How his limb moves.

    ``rides``: bones by the turn that carries them. ``forearm``: two bones that share the skin between landmarks. In
    ``centres``, the bone that carries each joint's centre. ``angles``: our coordinate, the turn it follows, its sign.
    """

    turns: tuple[Turn, ...]
    rides: dict[str, str | None]
    forearm: tuple[str, str, str, str] | None
    swings: dict[str, Swing]
    centres: dict[str, str]
    angles: tuple[tuple[str, str, float], ...] = field(repr=False)


MOVABLE = {
    "arm": Movable(
        (
            Turn("shoulder flexion", None, "humeral_head_centre", "right"),
            Turn("shoulder abduction", "shoulder flexion", "humeral_head_centre", "forward"),
            Turn("elbow", "shoulder abduction", "medial_epicondyle", "lateral_epicondyle"),
            Turn("forearm", "elbow", "ulnar_head_centre", "radial_head_centre"),
            Turn("wrist", "forearm", "ulnar_styloid", "radial_styloid"),
        ),
        {
            "scapula": None,
            "clavicle": None,
            "humerus": "shoulder abduction",
            "ulna": "elbow",
            "radius": "forearm",
            "hand": "wrist",
        },
        ("ulna", "radius", "elbow_centre_epicondyle_mid", "wrist_centre_styloid_mid"),
        {
            "shoulder flexion": Swing(12.0, 14.0, 1.0, 0.4),
            "shoulder abduction": Swing(-10.0, 8.0, 1.5),
            "elbow": Swing(50.0, 42.0, 1.0, -0.25),
            "forearm": Swing(55.0, 42.0, 2.0),
            "wrist": Swing(0.0, 15.0, 3.0),
        },
        {"shoulder": "humerus", "elbow": "humerus", "wrist": "radius"},
        (("elbow_flexion", "elbow", 1.0), ("pro_sup", "forearm", 1.0), ("flexion", "wrist", 1.0)),
    ),
    "leg": Movable(
        (
            Turn("hip flexion", None, "femoral_head_centre", "right"),
            Turn("hip adduction", "hip flexion", "femoral_head_centre", "forward"),
            Turn("knee", "hip adduction", "lateral_femoral_epicondyle", "medial_femoral_epicondyle"),
            Turn("kneecap", "hip adduction", "lateral_femoral_epicondyle", "medial_femoral_epicondyle", share=0.6),
            Turn("ankle", "knee", "medial_malleolus_tip", "lateral_malleolus_tip"),
        ),
        {
            "pelvis": None,
            "femur": "hip adduction",
            "patella": "kneecap",
            "tibia": "knee",
            "fibula": "knee",
            "foot": "ankle",
        },
        None,
        {
            "hip flexion": Swing(16.0, 20.0, 1.0, -0.1),
            "hip adduction": Swing(0.0, 7.0, 1.5),
            "knee": Swing(33.0, 31.0, 1.0, -0.25),
            "ankle": Swing(0.0, 12.0, 2.0),
        },
        {"hip": "femur", "knee": "femur", "ankle": "tibia"},
        (("knee_angle_r", "knee", 1.0), ("ankle_angle_r", "ankle", 1.0)),
    ),
}


def make_movable(name: str, data: Path) -> Jointed:
    """His limb with joints."""
    him, how = read_limb(LIMBS[name], data), MOVABLE[name]
    folder = data / FOLDER / LIMBS[name].folder / "bones"
    bones = {bone: in_world(read_mesh(folder / f"{bone}.ply")) for bone in how.rides}
    skin = him.skin
    weights = heat_weights(skin, list(bones.values()))
    if how.forearm is not None:
        first, second = (list(bones).index(bone) for bone in how.forearm[:2])
        start, end = (him.landmarks[landmark] for landmark in how.forearm[2:])
        weights = shared_along(weights, skin.vertices, first, second, start, end)
    return Jointed(skin, bones, him.landmarks, how.turns, how.rides, weights)


def degrees_over_time(name: str) -> dict[str, Floats]:
    """Degrees (T,) of his turns."""
    _, u = times_and_phase(SECONDS, FPS)
    degrees = {turn: swing.degrees(u) for turn, swing in MOVABLE[name].swings.items()}
    return degrees | {"kneecap": degrees["knee"]} if "knee" in degrees else degrees


def motions_over_time(name: str, him: Jointed) -> list[dict[str, Floats]]:
    """Each frame's motions (4, 4) of his bones, the whole limb swaying about the middle of its skin."""
    degrees = degrees_over_time(name)
    middle, count = him.skin.vertices.mean(axis=0), len(next(iter(degrees.values())))
    frames = []
    for t in range(count):
        turn = exp_so3(np.array([0.0, np.deg2rad(_SWAY_DEG) * np.sin(2.0 * np.pi * t / count + 0.6), 0.0]))
        world = transform(turn, middle - turn @ middle)
        frames.append(him.motions({turn: values[t] for turn, values in degrees.items()}, world))
    return frames
