"""How far what one sensor saw lies from what another saw at the same instants: whether a calibration is true.

Where two sensors see the same surface, their clouds must lie on each other. A box that was moved between one sensor's
images of it and another's shifts one cloud against the other, by too little to be taken for another thing. That rigid
shift is estimated here from point-to-plane distances (Chen and Medioni, Image and Vision Computing 10(3), 1992).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from capture.camera import Camera
from capture.cloud.normals import surface_at
from capture.cloud.preprocess import Image, Mask, boundary, clean_depth
from capture.projection import pixels_in
from capture.rigid import Floats, apply, exp_so3, inverse, transform

_POINTS = 2000  # of each sensor at each instant
_REACH_M = 0.05  # two points of one surface are nearer than this; two sides of a limb mostly are not
_ALIKE = 0.8  # cosine between the normals of two points of one surface
_STEEPEST = 0.35  # cosine between normal and ray: what is seen at a lower angle is not measured well
_FEWEST, _FEWEST_INSTANTS = 200, 2  # points compared, of all instants together; instants that have any
_ROUNDS, _SMALL_STEP_M = 8, 2e-5
_TUKEY = 4.685  # in standard deviations: 95 % efficiency for Gaussian errors
_SMALLEST_SIGMA_M = 1e-3
_ARM_M = 0.1  # a turn by one radian counts as much as a shift by this
_SHARE = 0.02  # directions in which less than about this share of the surface looks are not judged

_Matches = tuple[Floats, Floats, Floats]
"""Points (N, 3) of one surface, those (N, 3) that another sensor saw on the same rays, and normals (N, 3)."""


@dataclass(frozen=True, eq=False)
class Surface:
    """What one sensor sees at one instant: points (N, 3) m and normals (N, 3) in its frame; its image, and what of it
    to trust (H, W)."""

    camera: Camera
    points: Floats
    normals: Floats
    depth: Image
    inner: Mask


@dataclass(frozen=True)
class CloudOffset:
    """By how much one sensor's clouds must be moved to lie on another's: distance and standard deviation (m)."""

    distance_m: float
    deviation_m: float


def surface(depth: Image, camera: Camera) -> Surface:
    """The surface in a depth image (H, W) (m, 0 for none), away from the scan's boundary."""
    depth = clean_depth(depth, camera)
    inner = (depth > 0.0) & ~boundary(depth, camera)
    pixels = np.argwhere(inner)
    points, normals = surface_at(depth, camera, pixels[:: max(1, len(pixels) // _POINTS)])
    plain = _plainly_seen(points, normals)
    return Surface(camera, points[plain], normals[plain], depth, inner)


def cloud_offset(pairs: Sequence[tuple[Surface, Surface]], b_from_a: Floats) -> CloudOffset | None:
    """By how much the first surfaces, laid upon the second by ``b_from_a`` (4, 4), must be moved to lie on them.

    One rigid motion x = (omega, tau) for all pairs minimises

        mean of rho(n . (p + omega x (p - c) + tau - q)) + share |x|^2

    with points p, q on one ray, their normal n, the points' middle c, and Tukey's rho. The last term keeps what the
    surfaces do not tell small: a straight limb says nothing of a shift along itself. The distance is the root mean
    square of the points' ways; its deviation is found by leaving out one pair at a time.

    Returns:
        None if too few points are seen by both sensors, or at one instant only: nothing then tells how sure it is.
    """
    motion, moved, centre = np.zeros(6), b_from_a, None
    for _ in range(_ROUNDS):
        matches = [_both_ways(a, b, moved) for a, b in pairs]
        points = np.concatenate([p for p, _, _ in matches])
        if len(points) < _FEWEST or sum(len(p) > 0 for p, _, _ in matches) < _FEWEST_INSTANTS:
            return None
        centre = points.mean(axis=0) if centre is None else centre
        before, (normal, right) = motion, _equations(matches, centre, motion)
        motion = _solved(normal.sum(axis=0), right.sum(axis=0), len(points))
        moved = _rigid(motion, centre) @ b_from_a
        if np.abs(motion - before).max() < _SMALL_STEP_M:
            break
    spread = np.array(
        [
            _way(_solved(normal.sum(axis=0) - a, right.sum(axis=0) - b, len(points)) - motion, points - centre)
            for a, b in zip(normal, right, strict=True)
        ]
    )
    count = len(pairs)
    return CloudOffset(_way(motion, points - centre), float(np.sqrt((count - 1) / count * (spread**2).sum())))


def _both_ways(a: Surface, b: Surface, b_from_a: Floats) -> _Matches:
    """Matches in the frame of the second sensor, from the first one's points to the second and back."""
    there, back = _matched(a, b, b_from_a), _matched(b, a, inverse(b_from_a))
    returned = apply(b_from_a, back[1]), apply(b_from_a, back[0]), back[2] @ b_from_a[:3, :3].T
    p, q, n = (np.concatenate(both) for both in zip(there, returned, strict=True))
    return p, q, n


def _matched(a: Surface, b: Surface, b_from_a: Floats) -> _Matches:
    """The points of the first surface that the second sensor saw, too, and what it saw on their rays."""
    p, n = apply(b_from_a, a.points), a.normals @ b_from_a[:3, :3].T
    before = p[:, 2] > _REACH_M
    p, n = p[before], n[before]
    row, column, seen = pixels_in(b.camera, p)
    p, n, pixels = p[seen], n[seen], np.column_stack([row[seen], column[seen]])
    trusted = b.inner[pixels[:, 0], pixels[:, 1]]
    p, n, pixels = p[trusted], n[trusted], pixels[trusted]
    q, m = surface_at(b.depth, b.camera, pixels)
    n_dot_m = (n * m).sum(axis=1)
    between = (n + m) / np.maximum(np.linalg.norm(n + m, axis=1, keepdims=True), 1e-9)
    same = (n_dot_m > _ALIKE) & _plainly_seen(q, m) & (np.abs(((p - q) * between).sum(axis=1)) < _REACH_M)
    return p[same], q[same], between[same]


def _plainly_seen(points: Floats, normals: Floats) -> Mask:
    """Which points (N, 3) with normals (N, 3) of the sensor's frame do not look past the sensor."""
    return np.asarray(-(points * normals).sum(axis=1) > _STEEPEST * np.linalg.norm(points, axis=1))


def _equations(matches: Sequence[_Matches], centre: Floats, motion: Floats) -> tuple[Floats, Floats]:
    """Normal matrices (P, 6, 6) and right sides (P, 6) of each pair's matches, linear about a motion (6,).

    The points p have been moved already, so the residual without the motion is n . (p - q) - J x.
    """
    residuals = [((p - q) * n).sum(axis=1) for p, q, n in matches]
    sigma = max(1.4826 * float(np.median(np.abs(np.concatenate(residuals)))), _SMALLEST_SIGMA_M)
    normal, right = np.zeros((len(matches), 6, 6)), np.zeros((len(matches), 6))
    for k, ((p, _, n), residual) in enumerate(zip(matches, residuals, strict=True)):
        jacobian = np.hstack([np.cross((p - centre) / _ARM_M, n), n])
        weight = np.maximum(1.0 - (residual / (_TUKEY * sigma)) ** 2, 0.0) ** 2
        normal[k] = jacobian.T @ (weight[:, None] * jacobian)
        right[k] = jacobian.T @ (weight * (jacobian @ motion - residual))
    return normal, right


def _solved(normal: Floats, right: Floats, points: int) -> Floats:
    return np.asarray(np.linalg.solve(normal / points + _SHARE * np.eye(6), right / points))


def _rigid(motion: Floats, centre: Floats) -> Floats:
    """The rigid transform (4, 4) that turns about the centre (3,) and shifts."""
    rotation = exp_so3(motion[:3] / _ARM_M)
    return transform(rotation, centre + motion[3:] - rotation @ centre)


def _way(motion: Floats, arms: Floats) -> float:
    """Root mean square way (m) of points at some arms (N, 3) from the centre under a small motion (6,)."""
    ways = motion[3:] + np.cross(motion[:3] / _ARM_M, arms)
    return float(np.sqrt((ways**2).sum(axis=1).mean()))
