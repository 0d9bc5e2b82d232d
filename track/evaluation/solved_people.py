"""Bodies of MakeHuman's shape targets whose lengths and girths are those of a measured person.

What is minimised over the targets' coefficients c (what a target adds where c > 0, its opposite where c < 0):

    sum_m ((measured_m(c) - wanted_m) / tolerance)^2 + sum_k (c_k / usual_k)^2

Heights and lengths run between landmarks of our templates, carried by the skin (``track.evaluation.limb_ground``), so
that an arm is longer because its skin and what is inside it are; girths are those of the convex hull, as a tape's.
MakeHuman's height targets, which move skin away from its joints, take no part.

Assumptions: the acromion lies straight above the shoulder's centre, on the skin; ANSUR's upper arm and forearm are
flexed, and thicker by ``_FLEXED`` than relaxed ones.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial import ConvexHull

from adapt.anatomy import Floats, Ints
from adapt.template_builder.skin import catmull_clark, height_in
from adapt.template_builder.sources_makehuman import SourceSkin, load_skin, shaped_points
from track.evaluation.limb_ground import LimbGround, limb_ground, limb_plan
from track.evaluation.population import Measured

_TOLERANCE_M = 0.002
_USUAL = 2.0  # of a coefficient; MakeHuman's own sliders end at 1
_FLEXED = {"bicepscircumferenceflexed": 0.94, "forearmcircumferenceflexed": 0.97}
_ANCESTRIES = ("african", "asian", "caucasian")
_STEP, _ROUNDS = 1e-2, 12
_REACH_M = 0.16  # from the limb's middle: what a plane cuts farther off is another limb
_SIDEWAYS_M = 0.02  # how far from straight above the shoulder's centre the acromion's vertex may lie

SHAPES = (
    "arms/measure-upperarm-length",
    "arms/measure-lowerarm-length",
    "arms/measure-upperarm-circ",
    "arms/r-lowerarm-fat",
    "hands/measure-wrist-circ",
    "hands/r-hand-scale",
    "legs/measure-upperleg-height",
    "legs/measure-lowerleg-height",
    "legs/measure-thigh-circ",
    "legs/measure-knee-circ",
    "legs/measure-calf-circ",
    "feet/measure-ankle-circ",
    "torso/measure-hips-circ",
)
_WAYS = ("incr", "decr")
_ANATOMIES = {"arm": "upper-limb-right", "leg": "lower-limb-right"}
_HEIGHTS = {
    "trochanterionheight": ("trochanter",),
    "lateralfemoralepicondyleheight": ("FLE",),
    "tibialheight": ("plateau_medial",),
}
_LENGTHS = {
    "acromionradialelength": (("acromion",), ("GH",), ("radial_head",)),
    "radialestylionlength": (("radial_head",), ("RS",)),
    "handlength": (("US", "RS"), ("MC3_head",), ("finger3_tip",)),
}
_GIRTHS: dict[str, tuple[str, tuple[str, str], tuple[float, ...], Callable[[list[float]], float]]] = {
    "bicepscircumferenceflexed": ("arm", ("shoulder", "elbow"), (0.50, 0.58, 0.66), max),
    "forearmcircumferenceflexed": ("arm", ("elbow", "wrist"), (0.12, 0.20, 0.28), max),
    "wristcircumference": ("arm", ("elbow", "wrist"), (0.92, 0.96, 1.0), min),
    "thighcircumference": ("leg", ("hip", "knee"), (0.26,), max),
    "lowerthighcircumference": ("leg", ("hip", "knee"), (0.86,), max),
    "calfcircumference": ("leg", ("knee", "ankle"), (0.22, 0.28, 0.34), max),
    "anklecircumference": ("leg", ("knee", "ankle"), (0.80, 0.86, 0.92), min),
}


@dataclass(frozen=True, eq=False)
class Solved:
    """Somebody's body, and how far each measure (m) is from what was wanted."""

    body: SourceSkin
    missed: dict[str, float]
    coefficients: dict[str, float] = field(repr=False)


def solved(somebody: Measured) -> Solved:
    """A body with somebody's measures; those that are not known how to measure here are passed over."""
    wanted = somebody.measures
    stature, names = wanted["stature"], [name for name in (*_HEIGHTS, *_LENGTHS, *_GIRTHS) if name in wanted]
    goal = np.array([wanted[name] * _FLEXED.get(name, 1.0) for name in names])
    middle = _middle(somebody.sex)
    start = shaped_points(middle)
    moves = [[shaped_points(middle | {f"{name}-{way}": 1.0}) - start for way in _WAYS] for name in SHAPES]

    def vertices(c: Floats) -> Floats:
        points = start + sum(abs(k) * pair[int(k < 0.0)] for k, pair in zip(c, moves, strict=True))
        return np.asarray(points * stature / np.ptp(points[_skin_vertices(), 1]))

    def off(c: Floats) -> Floats:
        return np.concatenate([(measured(vertices(c), names) - goal) / _TOLERANCE_M, c / _USUAL])

    c = least_squares(off, np.full(len(SHAPES), 1e-3), diff_step=_STEP, x_scale=1.0, max_nfev=_ROUNDS).x
    chosen = {f"{name}-{_WAYS[int(k < 0.0)]}": abs(float(k)) for name, k in zip(SHAPES, c, strict=True)}
    body = load_skin(middle | chosen, stature=stature)
    missed = measured(body.vertices, names) - goal
    return Solved(body, dict(zip(names, missed.tolist(), strict=True)), chosen)


def measured(vertices: Floats, names: list[str]) -> Floats:
    """Measures (m) of a body with these vertices (N, 3), by ANSUR's names."""
    floor = vertices[_skin_vertices(), 1].min()
    limbs = {_GIRTHS[name][0] for name in names if name in _GIRTHS}
    finer = {limb: _finer(vertices, limb) for limb in limbs}
    found = []
    for name in names:
        if name in _HEIGHTS:
            found.append(_ground("leg").landmark(vertices, _HEIGHTS[name])[1] - floor)
        elif name in _LENGTHS:
            found.append(_length(vertices, _LENGTHS[name]))
        else:
            found.append(_girth(vertices, finer, *_GIRTHS[name]))
    return np.array(found)


def _length(vertices: Floats, way: tuple[tuple[str, ...], ...]) -> float:
    """Along the arm's landmarks from stop to stop; "acromion" is the skin above the shoulder."""
    ground = _ground("arm")
    stops = [vertices[_acromion()] if stop == ("acromion",) else ground.landmark(vertices, stop) for stop in way]
    return float(sum(np.linalg.norm(b - a) for a, b in pairwise(stops)))


def _girth(
    vertices: Floats,
    finer: dict[str, Floats],
    limb: str,
    ends: tuple[str, str],
    shares: tuple[float, ...],
    chosen: Callable[[list[float]], float],
) -> float:
    """The convex girth of a limb across the line between two joints, at the shares of the way that are asked for."""
    start, end = (_ground(limb).centre(vertices, joint) for joint in ends)
    along, edges = (end - start) / np.linalg.norm(end - start), _topology(limb)[1]
    girths = []
    for share in shares:
        height = (finer[limb] - start - share * (end - start)) @ along
        a, b = edges[height[edges[:, 0]] * height[edges[:, 1]] < 0.0].T
        t = (height[a] / (height[a] - height[b]))[:, None]
        cut = finer[limb][a] + t * (finer[limb][b] - finer[limb][a])
        cut = cut[np.linalg.norm(cut - start - share * (end - start), axis=1) < _REACH_M]
        girths.append(float(ConvexHull(cut @ _across(along).T).area))  # of a plane figure: its perimeter
    return chosen(girths)


def _across(along: Floats) -> Floats:
    """Two unit vectors (2, 3) at right angles to a unit vector."""
    return np.asarray(np.linalg.svd(along[None])[2][1:])


def _ground(limb: str) -> LimbGround:
    return limb_ground(_ANATOMIES[limb])


def _finer(vertices: Floats, limb: str) -> Floats:
    """The limb's skin once subdivided."""
    kept, _, quads = _topology(limb)
    return catmull_clark(vertices[kept], quads)[0]


@lru_cache(maxsize=2)
def _topology(limb: str) -> tuple[Ints, Ints, Ints]:
    """The limb's vertices in the body, the edges of its skin once subdivided, and its quads before."""
    ground, cuts = _ground(limb), limb_plan(_ANATOMIES[limb]).skin.cuts
    quads = ground.body.quads
    quads = quads[(height_in(cuts, ground.body.vertices) > 0.0)[quads].all(axis=1)]
    kept = np.unique(quads)
    quads = np.searchsorted(kept, quads)
    finer = catmull_clark(ground.body.vertices[kept], quads)[1]
    return kept, np.unique(np.sort(np.concatenate([finer[:, [0, 1]], finer[:, [1, 2]]]), axis=1), axis=0), quads


@lru_cache(maxsize=1)
def _skin_vertices() -> Ints:
    return np.unique(_ground("arm").body.quads)


@lru_cache(maxsize=1)
def _acromion() -> int:
    """The vertex of the skin straight above the shoulder's centre."""
    body, ground = _ground("arm").body.vertices, _ground("arm")
    centre, skin = ground.centre(body, "shoulder"), _skin_vertices()
    above = body[skin] - centre
    near = (np.hypot(above[:, 0], above[:, 2]) < _SIDEWAYS_M) & (above[:, 1] > 0.0)
    return int(skin[near][np.argmax(above[near, 1])])


def _middle(sex: str) -> dict[str, float]:
    """Targets of a sex's middle: ancestries in equal parts."""
    middle = {f"macrodetails/universal-{sex}-young-averagemuscle-averageweight": 1.0}
    return middle | {f"macrodetails/{ancestry}-{sex}-young": 1.0 / len(_ANCESTRIES) for ancestry in _ANCESTRIES}
