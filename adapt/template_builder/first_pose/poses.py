"""Random poses of whole people: standing, walking, sitting, crouching, kneeling, bending; arms anywhere.

All angles are drawn from ranges; no captured motion is used. A pose is a rotation (3, 3) per role of a rig's bones, in
the axes of the rest pose (X forward, Y up, Z right). About +Z a hanging limb swings forward, about +X to the left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from adapt.template_builder.first_pose.people import Person

Floats = NDArray[np.float64]
Turns = dict[str, Floats]
Range = tuple[float, float]

SIGN = {"l": -1.0, "r": 1.0}
"""Where a side lies along Z."""


@dataclass(frozen=True)
class ArmRanges:
    """Degrees: elevation from hanging down, its plane from the side (0) to the front (90), elbow flexion, twist."""

    share: float  # how often
    elevation: Range
    plane: Range
    flexion: Range
    twist: Range


ARMS = {
    "hanging": ArmRanges(0.19, (0, 25), (-50, 120), (0, 45), (-40, 60)),
    "on hips": ArmRanges(0.07, (25, 55), (-40, 30), (70, 115), (40, 100)),
    "overhead": ArmRanges(0.11, (110, 175), (-20, 110), (0, 110), (-60, 60)),
    "crossed": ArmRanges(0.08, (15, 60), (55, 120), (75, 130), (20, 90)),
    "reaching": ArmRanges(0.15, (50, 115), (5, 115), (0, 60), (-60, 60)),
    "to face": ArmRanges(0.07, (30, 110), (30, 110), (105, 148), (-40, 60)),
    "on lap": ArmRanges(0.04, (10, 45), (60, 110), (20, 80), (0, 60)),
    "behind": ArmRanges(0.04, (10, 45), (-100, -40), (10, 100), (40, 100)),
    "anywhere": ArmRanges(0.25, (0, 160), (-45, 125), (0, 145), (-80, 90)),
}


@dataclass(frozen=True)
class LegRanges:
    """Degrees: hip flexion, knee flexion, abduction, inward twist."""

    hip: Range
    knee: Range
    abduction: Range
    twist: Range


@dataclass(frozen=True)
class Stance:
    """What the legs do (each its own ranges, sides drawn by lot), and how far the trunk bends forward (degrees)."""

    share: float
    legs: tuple[LegRanges, LegRanges]
    bend: Range
    pitch: Range
    alike: float = 0.0  # how much the second leg follows the first's hip and knee


_STANDING = LegRanges((-8, 16), (0, 18), (-3, 16), (-10, 15))
_SWINGING = LegRanges((5, 45), (0, 65), (-3, 8), (-8, 12)), LegRanges((-30, 5), (0, 60), (-3, 8), (-8, 12))
_SITTING = LegRanges((65, 108), (40, 120), (-6, 30), (-20, 20))
_CROUCHING = LegRanges((25, 122), (35, 145), (-8, 32), (-15, 20))
_KNEELING = LegRanges((-12, 30), (80, 145), (-3, 14), (-12, 12)), LegRanges((-12, 105), (75, 135), (-3, 14), (-12, 12))
_LUNGING = LegRanges((35, 105), (15, 105), (-3, 20), (-8, 14)), LegRanges((-28, 12), (0, 95), (-3, 14), (-8, 12))
_ANY_LEG = LegRanges((-25, 110), (0, 130), (-12, 40), (-25, 35))
STANCES = {
    "standing": Stance(0.32, (_STANDING, _STANDING), (-8, 18), (-6, 10)),
    "walking": Stance(0.14, _SWINGING, (-6, 14), (-4, 8)),
    "sitting": Stance(0.16, (_SITTING, _SITTING), (-15, 35), (-20, 12), alike=0.5),
    "crouching": Stance(0.1, (_CROUCHING, _CROUCHING), (0, 60), (0, 45), alike=0.8),
    "kneeling": Stance(0.05, _KNEELING, (-10, 40), (-5, 20)),
    "lunging": Stance(0.1, _LUNGING, (-10, 45), (-8, 25)),
    "anyhow": Stance(0.13, (_ANY_LEG, _ANY_LEG), (-15, 60), (-15, 30)),
}


@dataclass(frozen=True)
class ArmAngles:
    """Degrees: the upper arm's elevation and plane as in ``ArmRanges``, elbow flexion, twist of the upper arm inward;
    how far the collar bone rises and comes forward; turn of the forearm, bend of the wrist, closing of the fingers.
    """

    elevation: float
    plane: float
    flexion: float
    twist: float
    lift: float = 0.0
    forward: float = 0.0
    forearm: float = 0.0
    wrist: float = 0.0
    fist: float = 0.0


@dataclass(frozen=True)
class LegAngles:
    """Degrees: hip flexion, knee flexion, abduction, inward twist."""

    hip: float
    knee: float
    abduction: float
    twist: float


def leg_turns(side: str, angles: LegAngles) -> Turns:
    """The turns of thigh and shank."""
    sign = SIGN[side]
    thigh = about("x", -sign * angles.abduction) @ about("z", angles.hip) @ about("y", sign * angles.twist)
    return {f"thigh_{side}": thigh, f"shank_{side}": about("z", -angles.knee)}


def arm_turns(person: Person, side: str, angles: ArmAngles) -> Turns:
    """The turns of an arm: the upper arm to a direction of the trunk, then twisted; the elbow about its axis at rest.

    MakeHuman's elbows are bent at rest, so that they say what axis they are bent about.
    """
    joint = {name: person.cubes[f"{side}-{name}"] for name in ("shoulder", "elbow", "hand", "finger-2-1", "finger-5-1")}
    sign, (e, p) = SIGN[side], np.radians([angles.elevation, angles.plane])
    goal = np.array([np.sin(e) * np.sin(p), -np.cos(e), sign * np.sin(e) * np.cos(p)])
    clavicle = about("x", -sign * angles.lift) @ about("y", sign * angles.forward)
    upper, lower = joint["elbow"] - joint["shoulder"], joint["hand"] - joint["elbow"]
    axis = np.cross(upper, lower)
    at_rest = float(np.degrees(np.arctan2(np.linalg.norm(axis), upper @ lower)))
    across = joint["finger-2-1"] - joint["finger-5-1"]
    return {
        f"clavicle_{side}": clavicle,
        f"upper_arm_{side}": towards(upper, clavicle.T @ goal) @ about_axis(upper, -sign * angles.twist),
        f"forearm_{side}": about_axis(axis, angles.flexion - at_rest) @ about_axis(lower, 0.4 * angles.forearm),
        f"hand_{side}": about_axis(lower, 0.6 * angles.forearm) @ about_axis(across, angles.wrist),
        f"fingers_{side}": about_axis(across, sign * angles.fist),
    }


@dataclass(frozen=True)
class Pose:
    """Rotations by role, where the person faces (rad about Y), and what kind of stance it is."""

    turns: Turns
    heading: float
    stance: str


def draw_pose(rng: np.random.Generator, person: Person) -> Pose:
    """A pose at random; hands close to any degree, heads look about."""
    names = list(STANCES)
    stance = names[rng.choice(len(names), p=[STANCES[name].share for name in names])]
    turns: Turns = {}
    _legs(rng, STANCES[stance], turns)
    _trunk(rng, STANCES[stance], turns)
    kinds = list(ARMS)
    shares = np.array([ARMS[kind].share for kind in kinds])
    first = rng.choice(len(kinds), p=shares)
    for side in rng.permutation(["l", "r"]):
        _arm(rng, person, str(side), ARMS[kinds[first]], turns)
        if rng.random() < 0.55:
            first = rng.choice(len(kinds), p=shares)
    heading = rng.uniform(-np.pi, np.pi)
    turns["pelvis"] = about("y", np.degrees(heading)) @ turns["pelvis"]
    return Pose(turns, heading, stance)


def about(axes: str, *degrees: float) -> Floats:
    """Turns about fixed axes, the last first."""
    return np.asarray(Rotation.from_euler(axes.upper(), degrees, degrees=True).as_matrix()).reshape(3, 3)


def about_axis(axis: Floats, degrees: float) -> Floats:
    """A turn about a direction (3,), right-handed."""
    return np.asarray(Rotation.from_rotvec(np.radians(degrees) * axis / np.linalg.norm(axis)).as_matrix())


def towards(start: Floats, end: Floats) -> Floats:
    """The least turn (3, 3) that takes one direction (3,) to another."""
    a, b = start / np.linalg.norm(start), end / np.linalg.norm(end)
    axis = np.cross(a, b)
    sine = np.linalg.norm(axis)
    return np.eye(3) if sine < 1e-9 else about_axis(axis, float(np.degrees(np.arctan2(sine, a @ b))))


def _drawn(rng: np.random.Generator, ends: Range) -> float:
    return float(rng.uniform(*ends))


def _legs(rng: np.random.Generator, stance: Stance, turns: Turns) -> None:
    order = rng.permutation(["l", "r"])
    first = None
    for side, ranges in zip(order, stance.legs, strict=True):
        angles = [_drawn(rng, ends) for ends in (ranges.hip, ranges.knee, ranges.abduction, ranges.twist)]
        if first is not None:
            angles[:2] = [stance.alike * a + (1.0 - stance.alike) * b for a, b in zip(first, angles[:2], strict=True)]
        first = angles[:2]
        turns |= leg_turns(str(side), LegAngles(*angles))
        turns[f"foot_{side}"] = about("z", rng.uniform(-30, 20)) @ about("y", rng.uniform(-12, 12))


def _trunk(rng: np.random.Generator, stance: Stance, turns: Turns) -> None:
    bend, pitch = _drawn(rng, stance.bend), _drawn(rng, stance.pitch)
    if rng.random() < 0.12:
        bend, pitch = rng.uniform(30, 85), pitch + rng.uniform(0, 40)
    if rng.random() < 0.04:  # leaning far, or lying
        pitch += rng.choice([-1.0, 1.0]) * rng.uniform(50, 100)
    yaw, side = rng.normal(0, 14), rng.normal(0, 9)
    turns["spine"] = about("zyx", -bend / 3.0, yaw / 3.0, side / 3.0)
    nod = rng.normal(0, 10) - bend * rng.uniform(0, 0.3)
    turns["neck"] = about("zyx", -nod / 2.0, rng.normal(0, 12), rng.normal(0, 5))
    turns["head"] = about("zyx", -nod / 2.0, rng.normal(0, 12), rng.normal(0, 5))
    turns["pelvis"] = about("zx", -pitch, rng.normal(0, 5))


def _arm(rng: np.random.Generator, person: Person, side: str, ranges: ArmRanges, turns: Turns) -> None:
    elevation, plane = _drawn(rng, ranges.elevation), _drawn(rng, ranges.plane)
    forward = rng.uniform(0, 22) if plane > 45 and elevation > 30 else rng.uniform(-10, 10)
    angles = ArmAngles(
        elevation,
        plane,
        _drawn(rng, ranges.flexion),
        _drawn(rng, ranges.twist),
        lift=max(0.0, elevation - 30.0) * rng.uniform(0.15, 0.3),
        forward=forward,
        forearm=rng.uniform(-75, 75),
        wrist=rng.uniform(-45, 45),
        fist=abs(rng.normal(0, 30)),
    )
    turns |= arm_turns(person, side, angles)
