"""What stands around a person: floor, walls, a chair, a table, odd things, something held; all of it boxes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from adapt.search.figure.names import JOINTS
from adapt.template_builder.first_pose.poses import about

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Box:
    """A box: its centre (3,) m, its axes as columns (3, 3), its sizes (3,) m."""

    centre: Floats = field(repr=False)
    axes: Floats = field(repr=False)
    size: Floats = field(repr=False)


def furnish(rng: np.random.Generator, joints: Floats, floor: float, heading: float, *, seated: bool) -> list[Box]:
    """Boxes about a person whose joints (19, 3) are known, above a floor at that height (m)."""
    boxes = _shell(rng, joints[0], floor)
    if seated or rng.random() < 0.12:
        boxes += _chair(rng, joints[0], floor, heading, seated=seated)
    if rng.random() < 0.25:
        boxes.append(_table(rng, joints[0], floor, heading))
    boxes += _things(rng, joints)
    if rng.random() < 0.15:
        hand = joints[JOINTS.index(f"wrist_{rng.choice(['l', 'r'])}")]
        boxes.append(Box(hand, _any_axes(rng), rng.uniform(0.03, 0.45, 3)))
    return boxes


def _shell(rng: np.random.Generator, centre: Floats, floor: float) -> list[Box]:
    boxes = []
    if rng.random() < 0.85:
        boxes.append(Box(np.array([centre[0], floor - 0.01, centre[2]]), np.eye(3), np.array([12.0, 0.02, 12.0])))
    for _ in range(rng.integers(0, 3)):
        turn = rng.uniform(0.0, 360.0)
        axes = about("y", turn)
        away = axes[:, 0] * rng.uniform(0.35, 2.5)
        middle = np.array([centre[0], floor + 1.2, centre[2]]) + away
        boxes.append(Box(middle, axes, np.array([0.02, 2.6, 6.0])))
    return boxes


def _chair(rng: np.random.Generator, pelvis: Floats, floor: float, heading: float, *, seated: bool) -> list[Box]:
    """Seat, perhaps a back, perhaps arms, and a post or four legs."""
    axes = about("y", np.degrees(heading))
    seat = pelvis[1] - rng.uniform(0.11, 0.15) if seated else floor + rng.uniform(0.4, 0.5)
    forward, side = (rng.uniform(0.02, 0.12), rng.uniform(-0.05, 0.05)) if seated else rng.uniform(-0.9, 0.9, 2)
    width, depth = rng.uniform(0.38, 0.6), rng.uniform(0.38, 0.5)

    def part(ahead: float, right: float, height: float, size: tuple[float, float, float]) -> Box:
        at = np.array([pelvis[0], height, pelvis[2]]) + axes @ np.array([forward + ahead, 0.0, side + right])
        return Box(at, axes, np.array(size))

    boxes = [part(0.0, 0.0, seat - 0.03, (depth, 0.06, width))]
    if rng.random() < 0.7:
        boxes.append(part(-depth / 2 - 0.05, 0.0, seat + rng.uniform(0.2, 0.35), (0.05, rng.uniform(0.3, 0.7), width)))
    if rng.random() < 0.4:
        boxes += [part(0.0, k * (width / 2 + 0.03), seat + 0.2, (depth, 0.05, 0.05)) for k in (-1, 1)]
    high, middle = max(seat - floor, 0.05), (seat + floor) / 2
    if rng.random() < 0.5:
        return [*boxes, part(0.0, 0.0, middle, (0.08, high, 0.08))]
    feet = [(a, b) for a in (-1, 1) for b in (-1, 1)]
    return boxes + [part(a * depth * 0.45, b * width * 0.45, middle, (0.04, high, 0.04)) for a, b in feet]


def _table(rng: np.random.Generator, pelvis: Floats, floor: float, heading: float) -> Box:
    axes = about("y", np.degrees(heading + rng.uniform(-0.5, 0.5)))
    ahead = axes @ np.array([rng.uniform(0.35, 0.9), 0.0, rng.uniform(-0.6, 0.6)])
    at = np.array([pelvis[0], floor + rng.uniform(0.6, 0.95), pelvis[2]]) + ahead
    return Box(at, axes, np.array([rng.uniform(0.4, 0.9), 0.04, rng.uniform(0.6, 1.6)]))


def _things(rng: np.random.Generator, joints: Floats) -> list[Box]:
    """Up to four boxes anywhere near, none of them in the person."""
    boxes = []
    for _ in range(rng.integers(0, 5)):
        size = rng.uniform(0.05, 0.5, 3)
        centre = joints[0] + np.array([rng.uniform(-1.1, 1.1), rng.uniform(-1.0, 0.8), rng.uniform(-1.1, 1.1)])
        if np.linalg.norm(joints - centre, axis=1).min() > np.linalg.norm(size) / 2 + 0.08:
            boxes.append(Box(centre, _any_axes(rng), size))
    return boxes


def _any_axes(rng: np.random.Generator) -> Floats:
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return np.asarray(axes)
