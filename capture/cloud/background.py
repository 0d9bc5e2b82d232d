"""Floor and walls: planes that hold a large share of what a sensor sees and are larger than any flat side of a person.

They are taken out of every depth image, so that nobody grows together with the floor he stands on. A few images of a
recording are searched for them. In each image it is then looked whether they still hold: nobody can see through a wall,
so that a plane with much to be seen behind it stands no longer where it stood, for the sensor was moved. A plane that
still holds is fitted to the image anew; one that somebody hides is kept. Only an image of which the known planes
explain less than of those searched is searched itself. So what is taken out of an image does not hang on which images
were looked at before.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from capture.camera import Camera, backproject, ray_slopes
from capture.cloud.preprocess import DEPTH_STEP, Image, clean_depth
from capture.compiled import compiled
from capture.recording import Instant, Recording, instants, read_depth
from capture.rigid import Floats

_TOLERANCE_M = 0.02
_TOLERANCE_STEPS = 2.0 * DEPTH_STEP  # 1 / m: two steps of a reading, more than 2 cm beyond 1.9 m
_LEAST_NOISE, _MOST_NOISE = 0.75, 1.5  # times that tolerance: shoes and floor run into each other below 1.5 cm
_NOISE_QUANTILE, _NOISE_FACTOR = 0.9, 2.0  # this much of the distance that so many readings keep: 3.3 deviations
_SHARE = 0.25  # of the readings left
_SIDES_M = (1.2, 0.6)  # larger than any flat side of a person
_TRIALS = 200
_MOST = 3
_SAMPLE = 2000
_SEARCHED = 5  # images of each sensor
_STRIDE_PX = 12  # every twelfth pixel of every twelfth row tells whether a plane holds
_SEEN_THROUGH = 0.03  # of the readings, more than in the image in which the plane was found
_FITTED_TO = 0.03  # of the readings: fewer say less of where a plane is than the image it was found in
_FITS, _GROWN = 8, 1.01  # at most so many times, as long as the plane comes to hold so much more
_UNEXPLAINED = 0.05  # of the readings, more than in any image searched


@dataclass(frozen=True, eq=False)
class LargePlane:
    """``equation`` (4,), n . x + d = 0 (m, sensor frame) with |n| = 1 and d > 0, so that the sensor is on its side.

    ``noise`` says how far readings are off it, in units of ``_tolerance``; ``beyond`` which share of all is behind it.
    """

    equation: Floats
    noise: float = 1.0
    beyond: float = 0.0

    def off(self, points: Floats) -> Floats:
        """How far (...) points (..., 3) (m) are in front of it, in units of how far off its own readings may be."""
        return np.asarray((points @ self.equation[:3] + self.equation[3]) / (self.noise * _tolerance(points)))


@dataclass(frozen=True, eq=False)
class Background:
    """The large planes that a sensor sees in some image, and the largest share of readings in any that is on none."""

    planes: tuple[LargePlane, ...] = ()
    unexplained: float = 1.0


@lru_cache(maxsize=8)
def backgrounds(recording: Recording) -> dict[str, Background]:
    """What a few images of each sensor, by name, show of floor and walls, in its own frame.

    Raises:
        RecordingError: an image cannot be read.
    """
    every = instants(recording)
    found = {}
    for sensor in recording.sensors:
        having = [moment for moment in every if sensor.name in moment.frames]
        picks = np.unique(np.linspace(0, len(having) - 1, min(_SEARCHED, len(having))).round().astype(int))
        found[sensor.name] = _background(recording, [having[k] for k in picks], sensor.name)
    return found


def _background(recording: Recording, moments: list[Instant], name: str) -> Background:
    sensor, unexplained = recording.sensor(name), 0.0
    planes: tuple[LargePlane, ...] = ()
    for moment in moments:
        depth = clean_depth(read_depth(sensor, moment.frames[name]), sensor.camera)
        points = _grid(depth, sensor.camera)
        if len(points) >= 3:
            holding = _holding(points, planes)
            anew = _more_planes(depth, sensor.camera, holding)
            planes = (*planes, *(LargePlane(one.equation, one.noise, _beyond(one, points)) for one in anew))
            unexplained = max(unexplained, _share_on_none(points, (*holding, *anew)))
    return Background(planes, unexplained)


def planes_in(depth: Image, camera: Camera, known: Background) -> tuple[LargePlane, ...]:
    """The large planes of one depth image (H, W) (m), of a sensor of which others are known."""
    if not known.planes:
        return ()
    points = _grid(depth, camera)
    if len(points) < 3:
        return ()
    holding = _holding(points, known.planes)
    if _share_on_none(points, holding) <= known.unexplained + _UNEXPLAINED:
        return holding
    return (*holding, *_more_planes(depth, camera, holding))


def _more_planes(depth: Image, camera: Camera, known: tuple[LargePlane, ...]) -> tuple[LargePlane, ...]:
    return large_planes(without_planes(depth, camera, known), camera, most=_MOST - len(known))


def _holding(points: Floats, planes: tuple[LargePlane, ...]) -> tuple[LargePlane, ...]:
    """Those of the planes that some points (N, 3) of an image do not show to have gone, fitted to them.

    Of more than an image may have, those that most of the points are on.
    """
    there = [_fitted(plane, points) for plane in planes]
    there = [plane for plane in there if _beyond(plane, points) <= plane.beyond + _SEEN_THROUGH]
    return tuple(sorted(there, key=lambda plane: -_share_on(plane, points))[:_MOST])


def _fitted(plane: LargePlane, points: Floats) -> LargePlane:
    """The plane moved to where points (N, 3) of an image lie on it: a little turn leaves a strip of it in place."""
    on_plane = np.abs(plane.off(points)) < 1.0
    for _ in range(_FITS):
        count = np.count_nonzero(on_plane)
        if count < max(3.0, _FITTED_TO * len(points)):
            break
        plane = LargePlane(_through(points[on_plane]), plane.noise, plane.beyond)
        on_plane = np.abs(plane.off(points)) < 1.0
        if np.count_nonzero(on_plane) <= _GROWN * count:
            break
    return plane


def _share_on(plane: LargePlane, points: Floats) -> float:
    return float((np.abs(plane.off(points)) < 1.0).mean())


def _beyond(plane: LargePlane, points: Floats) -> float:
    return float((plane.off(points) < -2.0).mean())


def _share_on_none(points: Floats, planes: tuple[LargePlane, ...]) -> float:
    left = np.ones(len(points), dtype=np.bool_)
    for plane in planes:
        left &= np.abs(plane.off(points)) > 1.0
    return float(left.mean())


def _grid(depth: Image, camera: Camera) -> Floats:
    """Points (N, 3) (m, sensor frame) of some pixels, evenly picked."""
    z = depth[::_STRIDE_PX, ::_STRIDE_PX].astype(np.float64)
    slopes, seen = ray_slopes(camera)[::_STRIDE_PX, ::_STRIDE_PX], z > 0.0
    return np.column_stack([slopes[seen] * z[seen, None], z[seen]])


def large_planes(depth: Image, camera: Camera, *, most: int = _MOST) -> tuple[LargePlane, ...]:
    """The planes of a depth image (H, W) (m) that are floor or wall, not more than ``most``."""
    points = backproject(camera, depth)[depth > 0.0]
    everything = some_of(points)
    planes: list[LargePlane] = []
    while len(points) >= 3 and len(planes) < most:
        equation = largest_plane(some_of(points))
        on_plane = np.abs(LargePlane(equation).off(points)) < 1.0
        if on_plane.mean() < _SHARE or not _is_large(points[on_plane]):
            break
        plane = LargePlane(equation, _noise_about(equation, some_of(points)))
        if plane.noise == _MOST_NOISE and _beyond(plane, everything) > _SEEN_THROUGH:
            break  # a cut through somebody: not flat, and he is on both of its sides
        planes.append(plane)
        points = points[np.abs(plane.off(points)) >= 1.0]
    return tuple(planes)


def _noise_about(equation: Floats, points: Floats) -> float:
    """How far readings are off a plane (4,) that many of the points (N, 3) are of, in units of ``_tolerance``."""
    off = np.abs(LargePlane(equation).off(points))
    spread = _NOISE_FACTOR * float(np.quantile(off[off < _MOST_NOISE], _NOISE_QUANTILE))
    return float(np.clip(spread, _LEAST_NOISE, _MOST_NOISE))


def without_planes(depth: Image, camera: Camera, planes: tuple[LargePlane, ...]) -> Image:
    """The depth image (H, W) (m) without readings on any of the planes, nor specks that are left of them."""
    if not planes:
        return depth
    kept, equations = depth.copy(), np.stack([plane.equation for plane in planes])
    _clear(kept, ray_slopes(camera), equations, np.array([plane.noise for plane in planes]))
    return clean_depth(kept, camera)


@compiled
def _clear(depth: Image, slopes: Image, equations: Floats, noise: Floats) -> None:
    """Sets to 0 the readings of a depth image (H, W) that are on any of K planes: ``LargePlane.off`` within 1."""
    for row in range(depth.shape[0]):
        for column in range(depth.shape[1]):
            z = float(depth[row, column])
            if not z > 0.0:
                continue
            x, y = slopes[row, column, 0] * z, slopes[row, column, 1] * z
            tolerance = max(_TOLERANCE_M, _TOLERANCE_STEPS * z * z)
            for k in range(len(noise)):
                off = equations[k, 0] * x + equations[k, 1] * y + equations[k, 2] * z + equations[k, 3]
                if abs(off) < noise[k] * tolerance:
                    depth[row, column] = 0.0


def largest_plane(points: Floats) -> Floats:
    """The plane (4,), n . x + d = 0 with |n| = 1, that has the most of the points (N, 3) within tolerance (RANSAC).

    >>> floor = np.array([[x, 1.2, z] for x in np.linspace(-1.0, 1.0, 20) for z in np.linspace(1.0, 3.0, 20)])
    >>> person = np.random.default_rng(0).uniform([-0.2, -0.5, 1.8], [0.2, 1.0, 2.2], (100, 3))
    >>> (largest_plane(np.concatenate([floor, person])).round(6) + 0.0).tolist()  # 1.2 m below: y points down
    [0.0, -1.0, 0.0, 1.2]
    """
    random = np.random.default_rng(0)
    corner = points[random.integers(len(points), size=(_TRIALS, 3))]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal /= np.where(length > 0.0, length, 1.0)
    offset = -(normal * corner[:, 0]).sum(axis=1)
    votes = (np.abs(points @ normal.T + offset) < _tolerance(points)[:, None]).sum(axis=0)
    best = int(np.argmax(np.where(length[:, 0] > 0.0, votes, -1)))
    on_plane = points[np.abs(points @ normal[best] + offset[best]) < _tolerance(points)]
    return _through(on_plane)


def _through(points: Floats) -> Floats:
    """The least-squares plane (4,) of points (N, 3), with the sensor on its positive side."""
    centre = points.mean(axis=0)
    normal = np.linalg.eigh((points - centre).T @ (points - centre))[1][:, 0]
    return np.append(normal, -normal @ centre) * (-1.0 if normal @ centre > 0.0 else 1.0)


def some_of(points: NDArray[np.float64]) -> Floats:
    """At most a few thousand of the points (N, 3), evenly picked.

    >>> some_of(np.zeros((10_000, 3))).shape, some_of(np.zeros((100, 3))).shape
    ((2000, 3), (100, 3))
    """
    return points[:: max(1, len(points) // _SAMPLE)]


def _tolerance(points: Floats) -> Floats:
    """How far (...) (m) off a plane each of points (..., 3) of it may be read: noise grows with the square of depth."""
    return np.asarray(np.maximum(_TOLERANCE_M, _TOLERANCE_STEPS * points[..., 2] ** 2))


def _is_large(points: Floats) -> bool:
    sample = some_of(points)
    axes = np.linalg.svd(sample - sample.mean(axis=0), full_matrices=False)[2]
    low, high = np.percentile(sample @ axes[:2].T, [5, 95], axis=0)
    return bool((high - low >= _SIDES_M).all())
