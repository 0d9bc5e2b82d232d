"""Where points fall in a sensor's image: the one place where points are projected.

A point at slopes (x, y) = (X / Z, Y / Z) of the sensor's frame, with q = x^2 + y^2, falls on the pixel (u, v) of
OpenCV's lens model, whose coefficients are k1, k2, p1, p2, k3, k4, k5, k6, s1 to s4, tau_x, tau_y:

    R = (1 + k1 q + k2 q^2 + k3 q^3) / (1 + k4 q + k5 q^2 + k6 q^3)
    x' = x R + 2 p1 x y + p2 (q + 2 x^2) + s1 q + s2 q^2
    y' = y R + p1 (q + 2 y^2) + 2 p2 x y + s3 q + s4 q^2
    (x'', y'') = the homography of a tilted sensor, by tau_x and tau_y, of (x', y')
    (u, v) = (fx x'' + cx, fy y'' + cy)

These polynomials describe the image and little beyond. Farther out they fold over, or pass a pole, and OpenCV then
projects points from far aside into the middle of the image. Here such points have no pixel: ``Lens.furthest`` says how
far out from the axis the model still spreads points out in every direction.

Source: OpenCV's documentation of the module calib3d, and its ``computeTiltProjectionMatrix``.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from capture.camera import Camera
from capture.compiled import compiled, compiled_sums, inlined
from capture.rigid import Floats

Ints = NDArray[np.int64]
Ints32 = NDArray[np.int32]

_STEEPEST_DEG, _STEP_DEG = (
    89.0,
    0.05,
)  # from the axis: no lens of this model looks farther aside; how finely it is asked
_DIRECTIONS = 64  # around the axis in which it is asked


class Lens(NamedTuple):
    """A camera's numbers as compiled loops take them.

    ``tilt`` is the homography (3, 3) of a tilted sensor, row by row; ``furthest`` is the square of the slope, from the
    axis, beyond which points have no pixel.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    k1: float
    k2: float
    p1: float
    p2: float
    k3: float
    k4: float
    k5: float
    k6: float
    s1: float
    s2: float
    s3: float
    s4: float
    tilt: tuple[float, ...]
    distorts: bool
    tilts: bool
    furthest: float


@lru_cache(maxsize=64)
def lens_of(camera: Camera) -> Lens:
    """The numbers of a camera.

    >>> lens = lens_of(Camera(640, 480, 500.0, 500.0, 320.0, 240.0))
    >>> lens.distorts, lens.furthest  # a pinhole sees points at any slope
    (False, inf)
    >>> barrel = lens_of(Camera(640, 480, 500.0, 500.0, 320.0, 240.0, (-0.3, 0.0, 0.0, 0.0)))
    >>> round(barrel.furthest**0.5, 2)  # beyond this slope the polynomial turns back
    1.05
    """
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tau_x, tau_y = map(float, (*camera.distortion, *[0.0] * 14)[:14])
    fx, fy, cx, cy = map(float, (camera.fx, camera.fy, camera.cx, camera.cy))
    tilt, tilts = tuple(_tilt(tau_x, tau_y).ravel().tolist()), tau_x != 0.0 or tau_y != 0.0
    lens = Lens(
        fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, tilt, any(camera.distortion), tilts, np.inf
    )
    return lens._replace(furthest=_furthest(lens) ** 2) if lens.distorts else lens


def _tilt(tau_x: float, tau_y: float) -> Floats:
    """The homography (3, 3) of a sensor tilted by two angles (rad), as OpenCV defines it."""
    cos_x, sin_x, cos_y, sin_y = np.cos(tau_x), np.sin(tau_x), np.cos(tau_y), np.sin(tau_y)
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cos_x, sin_x], [0.0, -sin_x, cos_x]])
    about_y = np.array([[cos_y, 0.0, -sin_y], [0.0, 1.0, 0.0], [sin_y, 0.0, cos_y]])
    turned = about_y @ about_x
    onto = np.array([[turned[2, 2], 0.0, -turned[0, 2]], [0.0, turned[2, 2], -turned[1, 2]], [0.0, 0.0, 1.0]])
    return np.asarray(onto @ turned)


def _furthest(lens: Lens) -> float:
    """The slope from the axis up to which the lens spreads points out, in every direction.

    Rings of rays are projected. While the lens spreads points out, the four corners of each patch between two rings
    keep their sense of rotation; at a fold a patch turns over. Beyond a pole of the radial model all is turned by
    half a turn, which keeps that sense: there its denominator is negative.
    """
    slope = np.tan(np.deg2rad(np.arange(0.0, _STEEPEST_DEG + _STEP_DEG, _STEP_DEG)))
    turn = np.linspace(0.0, 2.0 * np.pi, _DIRECTIONS + 1)
    rays = np.ones((len(slope), len(turn), 3))
    rays[..., :2] = slope[:, None, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    pixels = np.zeros((rays.shape[0] * rays.shape[1], 2))
    _project(lens, rays.reshape(-1, 3), pixels)
    rings = pixels.reshape(*rays.shape[:2], 2)
    out, around = np.diff(rings, axis=0)[:, :-1], np.diff(rings[1:], axis=1)
    area = out[..., 0] * around[..., 1] - out[..., 1] * around[..., 0]
    q = slope[1:] ** 2
    before_pole = 1.0 + q * (lens.k4 + q * (lens.k5 + q * lens.k6)) > 0.0
    spread = np.append((area > 0.0).all(axis=1) & before_pole, False)  # the last ring ends it at the latest
    return float(slope[max(0, int(spread.argmin()) - 1)])


def project(camera: Camera, points: Floats) -> tuple[Floats, Floats]:
    """Pixel coordinates (N, 2) and depths z (N,) of points (N, 3) (m, sensor frame).

    Points that are not in front of the sensor (z <= 0), or farther aside than the lens model reaches, get NaN pixel
    coordinates.

    >>> project(Camera(640, 480, 500.0, 500.0, 320.0, 240.0), np.array([[0.1, 0.0, 1.0]]))
    (array([[370., 240.]]), array([1.]))
    """
    points = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
    pixels = np.zeros((len(points), 2))
    _project(lens_of(camera), points, pixels)
    return pixels, points[:, 2].copy()


def pixels_in(camera: Camera, points: Floats) -> tuple[Ints, Ints, NDArray[np.bool_]]:
    """Row and column (N,) of the pixels that points (N, 3) (m, sensor frame) fall on, and whether they have one.

    Outside the image, row and column are 0.

    >>> pixels_in(Camera(640, 480, 500.0, 500.0, 320.0, 240.0), np.array([[0.1, 0.0, 1.0], [9.0, 0.0, 1.0]]))
    (array([240,   0]), array([370,   0]), array([ True, False]))
    """
    pixels, _ = project(camera, points)
    with np.errstate(invalid="ignore"):
        column, row = np.rint(pixels).T
        inside = (column >= 0.0) & (column < camera.width) & (row >= 0.0) & (row < camera.height)
    return np.where(inside, row, 0.0).astype(np.int64), np.where(inside, column, 0.0).astype(np.int64), inside


@inlined
def _coordinates(lens: Lens, x: float, y: float, z: float) -> tuple[float, float]:
    """Pixel coordinates of one point (m, sensor frame), NaN where it has none; equations on top."""
    x, y = x / z, y / z
    q = x * x + y * y
    has_pixel = (z > 0.0) & (q <= lens.furthest)
    if lens.distorts:
        top = 1.0 + q * (lens.k1 + q * (lens.k2 + q * lens.k3))
        radial = top / (1.0 + q * (lens.k4 + q * (lens.k5 + q * lens.k6)))
        xx, xy, yy = q + 2.0 * x * x, 2.0 * x * y, q + 2.0 * y * y
        x = x * radial + lens.p1 * xy + lens.p2 * xx + q * (lens.s1 + q * lens.s2)
        y = y * radial + lens.p1 * yy + lens.p2 * xy + q * (lens.s3 + q * lens.s4)
        if lens.tilts:
            t = lens.tilt
            x, y, w = t[0] * x + t[1] * y + t[2], t[3] * x + t[4] * y + t[5], t[6] * x + t[7] * y + t[8]
            x, y = x / w, y / w
    return lens.fx * x + lens.cx if has_pixel else np.nan, lens.fy * y + lens.cy


@compiled
def _project(lens: Lens, points: Floats, pixels: Floats) -> None:
    """Fill in the pixel coordinates (N, 2) of points (N, 3)."""
    for i in range(len(points)):
        u, v = _coordinates(lens, points[i, 0], points[i, 1], points[i, 2])
        pixels[i, 0], pixels[i, 1] = u, v if u == u else np.nan


@compiled
def pixel_within(lens: Lens, shape: tuple[int, int], x: float, y: float, z: float) -> tuple[int, int]:
    """Row and column of the pixel that one point (m, sensor frame) falls on; -1 outside an image of that shape.

    >>> lens = lens_of(Camera(640, 480, 500.0, 500.0, 320.0, 240.0))
    >>> pixel_within(lens, (480, 640), 0.1, 0.0, 1.0), pixel_within(lens, (480, 640), 0.1, 0.0, -1.0)  # behind it
    ((240, 370), (-1, -1))
    """
    u, v = _coordinates(lens, x, y, z)
    column, row = np.rint(u), np.rint(v)
    if (column >= 0.0) & (column < shape[1]) & (row >= 0.0) & (row < shape[0]):
        return int(row), int(column)
    return -1, -1


@compiled_sums
def pixels_within(
    lens: Lens, shape: tuple[int, int], x: Floats, y: Floats, z: Floats, rows: Ints32, columns: Ints32
) -> None:
    """The same for many points at once, as many as there is room for (N,) in ``rows`` and ``columns``.

    A lens with distortion then hardly takes longer than a pinhole: the processor takes several points at a time.
    """
    height, width = shape
    for i in range(len(rows)):
        u, v = _coordinates(lens, x[i], y[i], z[i])
        column, row = np.rint(u), np.rint(v)
        inside = (column >= 0.0) & (column < width) & (row >= 0.0) & (row < height)
        rows[i], columns[i] = np.int32(row if inside else -1.0), np.int32(column if inside else -1.0)
