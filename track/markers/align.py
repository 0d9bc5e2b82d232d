"""Where and when a laboratory's markers are in a motion: a shift of its clock and a rigid transform of its frame.

Pairs of points that should be about the same (a marker on a landmark and the landmark) tell both. How fast they move
does not depend on the frame, so the courses of their speeds are shifted until they agree, as those of two sensors are
(``capture.importers.offset``); then min over R, t of the sum over pairs and frames of |R x + t - y|^2 (Kabsch), at the
shift, close to the one found, where that is least.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from adapt.anatomy import Floats
from capture.errors import BonetrackError
from capture.importers.offset import MotionSignal, estimate_offset
from capture.rigid import apply, transform
from track.markers.read import MarkerError, MarkerTrial
from track.motion import Motion

LARGEST_RMS_M = 0.03
"""What is farther apart than this is not the same: markers sit on skin, a centimetre or two from what they mark."""
LARGEST_POINTS_M = 0.01
"""Of points that were measured in both frames."""
_LEAST_WIDTH_M = 0.02  # root mean square across the line or plane that points lie nearest to
_SPAN_S = 0.1  # speeds are those over this time
_CLOSE_S = 0.1  # how far the best shift may be from that of the speeds
_LARGEST_SCALE = 1.25


@dataclass(frozen=True, eq=False)
class Alignment:
    """A laboratory in a motion's frame and clock.

    ``offset_s`` is what its clock lacks of the motion's; ``deviation_s`` one standard deviation, None where it was
    stated. ``apart`` (T,) m by pair (the laboratory's name, ours) are the distances that remain at the motion's times.
    """

    offset_s: float
    deviation_s: float | None
    motion_from_lab: Floats
    apart: dict[tuple[str, str], Floats] = field(repr=False)

    def carried(self, trial: MarkerTrial) -> MarkerTrial:
        """The trial in the motion's frame and clock."""
        points = {name: apply(self.motion_from_lab, at) for name, at in trial.points.items()}
        return MarkerTrial(trial.times + self.offset_s, points)


def pairs_of(trial: MarkerTrial, ours: Mapping[str, Floats], stated: Mapping[str, str]) -> dict[str, str]:
    """Which marker goes with which of our points: as stated, and those of the same name, in capitals or not.

    Raises:
        MarkerError: a name that is stated is not there.

    >>> still = np.zeros((2, 3))
    >>> pairs_of(MarkerTrial(np.arange(2.0), {"el": still, "RSHO": still}), {"EL": still, "GH": still}, {"RSHO": "GH"})
    {'RSHO': 'GH', 'el': 'EL'}
    """
    for name, known, what in [
        *((name, trial.points, "marker") for name in stated),
        *((name, ours, "point of the motion") for name in stated.values()),
    ]:
        if name not in known:
            raise MarkerError(f"no {what} is called {name!r}", remedy=f"there are {', '.join(known)}")
    named = {name.lower(): name for name in ours if name not in stated.values()}
    alike = {name: named[name.lower()] for name in trial.points if name.lower() in named and name not in stated}
    return {**stated, **alike}


def align(
    trial: MarkerTrial,
    motion: Motion,
    ours: Mapping[str, Floats],
    pairs: Mapping[str, str],
    *,
    offset_s: float | None = None,
    motion_from_lab: Floats | None = None,
) -> Alignment:
    """Find, or take as stated, the shift of a trial's clock and the transform (4, 4) of its frame.

    Raises:
        MarkerError: too few pairs, nothing in common, no shift stands out, or what was found does not fit.
    """
    if len(pairs) < 3 and (motion_from_lab is None or not pairs):
        problem = f"{len(pairs)} marker(s) have the name of a point of the motion; 3 are needed"
        raise MarkerError(problem, remedy=f"say which go together: --pair MARKER POINT; points are {', '.join(ours)}")
    theirs, mine = [trial.points[name] for name in pairs], [ours[name] for name in pairs.values()]
    deviation = None
    if offset_s is None:
        offset_s, deviation = _found_offset(trial, motion, theirs, mine)
        offset_s = _closest(trial, motion, theirs, mine, offset_s, motion_from_lab)
    x, y = _together(trial, motion, theirs, mine, offset_s)
    placed = _placed(x, y) if motion_from_lab is None else motion_from_lab
    apart = np.linalg.norm(apply(placed, x.reshape(-1, 3)).reshape(x.shape) - y, axis=2)
    rms = float(np.sqrt(np.nanmean(apart**2)))
    if rms > LARGEST_RMS_M:
        problem = f"the markers are {1e3 * rms:.0f} mm (root mean square) from the points that they go with"
        remedy = "check the pairs' names and sides, and the time: --pair, --offset"
        raise MarkerError(f"{problem}, more than {1e3 * LARGEST_RMS_M:.0f}", remedy=remedy)
    named = {pair: apart[k] for k, pair in enumerate(pairs.items())}
    return Alignment(float(offset_s), deviation, placed, named)


def at_times(trial_times: Floats, at: Floats, times: Floats) -> Floats:
    """Paths (T, 3) at other times (N,), evenly between two frames; NaN where either is not known, and outside."""
    place = np.interp(times, trial_times, np.arange(len(trial_times)), left=np.nan, right=np.nan)
    known = np.isfinite(place)
    before = np.where(known, np.minimum(np.floor(place), len(trial_times) - 2), 0).astype(int)
    share = (place - before)[:, None]
    between = at[before] + share * (at[before + 1] - at[before])
    exact = np.where(share == 0.0, at[before], np.where(share == 1.0, at[before + 1], between))
    exact[~known] = np.nan
    return np.asarray(exact)


def transform_of_points(lab: Floats, here: Floats) -> tuple[Floats, Floats]:
    """The transform (4, 4) that takes points (N, 3) m of the laboratory to ours, and the distances (N,) that remain.

    Raises:
        MarkerError: fewer than three, or nearly on a line.
    """
    placed = _placed(lab[:, None], here[:, None])
    return placed, np.linalg.norm(apply(placed, lab) - here, axis=1)


def _together(
    trial: MarkerTrial, motion: Motion, theirs: list[Floats], mine: list[Floats], offset_s: float
) -> tuple[Floats, Floats]:
    """Both sides of all pairs (P, T, 3) at the motion's times."""
    x = np.array([at_times(trial.times + offset_s, at, motion.times) for at in theirs])
    y = np.array(mine)
    if not (np.isfinite(x) & np.isfinite(y)).any():
        problem = f"from {trial.times[0] + offset_s:.2f} to {trial.times[-1] + offset_s:.2f} s no pair is known in both"
        span = f"the motion runs from {motion.times[0]:.2f} to {motion.times[-1]:.2f} s"
        raise MarkerError(problem, remedy=f"{span}; state the time with --offset")
    return x, y


def _placed(x: Floats, y: Floats) -> Floats:
    """The transform (4, 4) that takes x (P, T, 3) nearest to y where both are known."""
    known = np.isfinite(x).all(axis=2) & np.isfinite(y).all(axis=2)
    a, b = x[known], y[known]
    middle, goal = a.mean(axis=0), b.mean(axis=0)
    width = np.linalg.svd(a - middle, compute_uv=False) / np.sqrt(len(a))
    if len(a) < 3 or width[1] < _LEAST_WIDTH_M:
        raise MarkerError("the points lie about on a line, which tells no turn about it", remedy="give more of them")
    scale = float(np.linalg.norm(a - middle) / np.linalg.norm(b - goal))
    if not 1.0 / _LARGEST_SCALE < scale < _LARGEST_SCALE:
        problem = f"the markers' paths are {scale:.2g} times as large as ours"
        raise MarkerError(problem, remedy="check the file's unit, and which markers go with which points")
    turn = Rotation.align_vectors(b - goal, a - middle)[0].as_matrix()
    return transform(turn, goal - turn @ middle)


def _found_offset(trial: MarkerTrial, motion: Motion, theirs: list[Floats], mine: list[Floats]) -> tuple[float, float]:
    """What the laboratory's clock lacks of ours by the speeds of the pairs, and one standard deviation (s)."""
    try:
        found = estimate_offset(_speeds(motion.times, mine), _speeds(trial.times, theirs), where="the trial")
    except BonetrackError as error:
        problem = f"beside the motion the trial {error.problem}"
        raise MarkerError(problem, remedy="state the time with --offset") from error
    return float(motion.times[0] + found.seconds - trial.times[0]), found.deviation_s


def _speeds(times: Floats, points: list[Floats]) -> MotionSignal:
    """The mean speed of the points that are known, over time, as the square root that signals are compared by."""
    middles = times[(times >= times[0] + _SPAN_S / 2.0) & (times <= times[-1] - _SPAN_S / 2.0)]
    half = _SPAN_S / 2.0
    steps = [
        np.linalg.norm(at_times(times, at, middles + half) - at_times(times, at, middles - half), axis=1)
        for at in points
    ]
    moved = np.ma.masked_invalid(np.array(steps)).mean(axis=0)
    known = ~np.ma.getmaskarray(moved)
    return MotionSignal(middles[known] - times[0], np.sqrt(moved.filled(0.0)[known] / _SPAN_S))


def _closest(
    trial: MarkerTrial,
    motion: Motion,
    theirs: list[Floats],
    mine: list[Floats],
    near_s: float,
    motion_from_lab: Floats | None,
) -> float:
    """The shift close to one (s) at which the pairs come nearest to each other."""

    def apart(offset_s: float) -> float:
        x, y = _together(trial, motion, theirs, mine, offset_s)
        placed = _placed(x, y) if motion_from_lab is None else motion_from_lab
        return float(np.nanmean((apply(placed, x.reshape(-1, 3)) - y.reshape(-1, 3)) ** 2))

    bounds = (near_s - _CLOSE_S, near_s + _CLOSE_S)
    return float(minimize_scalar(apart, bounds=bounds, method="bounded", options={"xatol": 1e-4}).x)
