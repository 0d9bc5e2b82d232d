"""What a structured-light depth sensor makes of the true depth: noise, quantisation, holes, flying pixels.

The figures are those of the PrimeSense family (Kinect v1, Carmine), which share chip, baseline and pattern:

- Nguyen, Izadi, Lovell, "Modeling Kinect Sensor Noise for Improved 3D Reconstruction and Tracking" (2012): axial
  noise against depth and angle, lateral noise against angle;
- Khoshelham, Elberink, "Accuracy and Resolution of Kinect Depth Data for Indoor Mapping Applications" (2012):
  disparity in steps of 1/8 pixel, noise growing with depth squared, holes and grazing surfaces;
- PrimeSense's data sheet of the Carmine 1.09: 640 x 480, 57.5 x 45 degrees, from 0.35 m.

Depth is the z coordinate in the camera's frame (m), 0 where there is none.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from capture.camera import Camera

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]
Mask = NDArray[np.bool_]

_EDGE_STEP_M = 0.03  # neighbours farther apart in depth than this lie on different surfaces
_STEEPEST = np.deg2rad(85.0)  # beyond, Nguyen's hyperbola was not measured and has a pole
_EMPTY = 1e3  # m; stands for "no surface" where minima and maxima of depth are taken


@dataclass(frozen=True)
class NoiseModel:
    """How a sensor errs. All zero: the exact depth, rounded to the depth unit."""

    baseline_m: float = 0.0  # projector to camera, along the camera's +x; casts the shadows, sets the quantisation
    disparity_step_px: float = 0.0  # Khoshelham and Elberink: 1/8
    axial_floor_m: float = 0.0  # Nguyen: 0.0012
    axial_growth: float = 0.0  # per metre; Nguyen: 0.0019 (z - 0.4)^2
    axial_grazing: float = 0.0  # m^(3/2); Nguyen: 0.0001 / sqrt(z) * theta^2 / (pi/2 - theta)^2
    lateral_floor_px: float = 0.0  # Nguyen: 0.8
    lateral_grazing_px: float = 0.0  # Nguyen: 0.035 theta / (pi/2 - theta)
    correlation_px: float = 0.0  # standard deviation of the window over which errors hang together
    grazing_drop_rad: tuple[float, float] = (np.pi, np.pi)  # no pixel is lost below the first, all above the second
    edge_drop_probability: float = 0.0  # of a pixel beside a depth edge
    flying_probability: float = 0.0  # of a pixel beside a depth edge
    flying_reach_m: float = 0.0  # how far flying pixels fall behind an edge that has nothing behind it
    near_m: float = 0.0
    far_m: float = np.inf

    def axial_sigma(self, depth: Floats32, angle: Floats32) -> Floats32:
        """Standard deviation of depth (m) at a depth (m) and an angle (rad) of ray to surface normal, like shaped."""
        steep = np.minimum(angle, np.float32(_STEEPEST))
        grazing = self.axial_grazing / np.sqrt(np.maximum(depth, 0.1)) * (steep / (np.pi / 2 - steep)) ** 2
        return np.asarray(self.axial_floor_m + self.axial_growth * (depth - 0.4) ** 2 + grazing, dtype=np.float32)

    def lateral_sigma(self, angle: Floats32) -> Floats32:
        """Standard deviation (px) of where an edge shows, at an angle (rad) of ray to surface normal."""
        steep = np.minimum(angle, np.float32(_STEEPEST))
        return np.asarray(
            self.lateral_floor_px + self.lateral_grazing_px * steep / (np.pi / 2 - steep), dtype=np.float32
        )

    def scaled(self, factor: float) -> NoiseModel:
        """The same sensor with every error's size or probability times ``factor`` (>= 0); geometry and range stay.

        >>> carmine().scaled(2.0).axial_floor_m
        0.0024
        """
        sizes = {f.name: getattr(self, f.name) * factor for f in fields(self) if f.name in _SIZES}
        chances = {name: min(1.0, getattr(self, name) * factor) for name in _PROBABILITIES}
        return replace(self, **sizes, **chances)


_SIZES = frozenset(
    {
        "disparity_step_px",
        "axial_floor_m",
        "axial_growth",
        "axial_grazing",
        "lateral_floor_px",
        "lateral_grazing_px",
        "flying_reach_m",
    }
)
_PROBABILITIES = ("edge_drop_probability", "flying_probability")


def carmine() -> NoiseModel:
    """The PrimeSense Carmine 1.09 (short range).

    Where the papers give no number (correlation, drop and flying probabilities), values are set so that images look
    like the sensor's: ragged silhouettes one or two pixels wide, surfaces lost between 75 and 84 degrees. The data
    sheet recommends 0.35 to 1.4 m; the sensor goes on measuring, with growing noise, to about 3 m.

    >>> carmine().near_m, carmine().far_m, 1000.0 * carmine().axial_floor_m  # m, m, mm
    (0.35, 3.0, 1.2)
    """
    return NoiseModel(
        baseline_m=0.075,
        disparity_step_px=1.0 / 8.0,
        axial_floor_m=0.0012,
        axial_growth=0.0019,
        axial_grazing=0.0001,
        lateral_floor_px=0.8,
        lateral_grazing_px=0.035,
        correlation_px=1.5,
        grazing_drop_rad=(float(np.deg2rad(75.0)), float(np.deg2rad(84.0))),
        edge_drop_probability=0.3,
        flying_probability=0.1,
        flying_reach_m=0.02,
        near_m=0.35,
        far_m=3.0,
    )


def carmine_camera() -> Camera:
    """The Carmine 1.09's depth camera: 640 x 480 over 57.5 x 45 degrees, without distortion.

    >>> round(carmine_camera().fx, 1), round(carmine_camera().fy, 1)
    (583.3, 579.4)
    """
    return Camera(
        width=640,
        height=480,
        fx=320.0 / float(np.tan(np.deg2rad(57.5 / 2))),
        fy=240.0 / float(np.tan(np.deg2rad(45.0 / 2))),
        cx=319.5,
        cy=239.5,
    )


def observe(
    depth_true: Floats32,
    normal_cos: Floats32,
    shadow: Mask,
    camera: Camera,
    noise: NoiseModel,
    rng: np.random.Generator,
    *,
    depth_unit_m: float = 0.001,
) -> NDArray[np.uint16]:
    """The depth image a sensor returns of the true one.

    Args:
        depth_true: (H, W) m, 0 where the ray meets nothing.
        normal_cos: (H, W) cosine of the angle between ray and surface normal, in [0, 1].
        shadow: (H, W) true where the projector does not reach what the camera sees.
        camera: gives the focal length for disparity.
        noise: the sensor's errors.
        rng: all randomness comes from here.
        depth_unit_m: metres per unit of the result.

    Returns:
        (H, W) depth in ``depth_unit_m``, 0 where the sensor measured nothing.

    >>> near, well, far = np.full((3, 12, 12), [[[0.2]], [[1.0]], [[3.5]]], dtype=np.float32)
    >>> def seen(depth):
    ...     facing, lit = np.ones_like(depth), np.zeros(depth.shape, dtype=bool)
    ...     return observe(depth, facing, lit, carmine_camera(), carmine(), np.random.default_rng(0))
    >>> [int(np.median(seen(depth))) for depth in (near, well, far)]  # mm, 0 where out of the sensor's range
    [0, 1000, 0]
    """
    depth, angle = depth_true.astype(np.float32), np.arccos(np.clip(normal_cos, 0.0, 1.0)).astype(np.float32)
    depth, angle = _with_ragged_edges(depth, angle, noise, rng)
    edge, front, behind = _edge_neighbourhood(depth, radius=1)
    lost = shadow | _lost_at_grazing(angle, noise, rng) | (edge & _chance(noise.edge_drop_probability, depth, rng))
    flying = edge & _chance(noise.flying_probability, depth, rng)
    depth = np.where(flying, _between(front, behind, noise, rng), depth)
    valid = (depth > 0.0) & ~lost
    depth = _with_axial_error(depth, angle, camera, noise, rng)
    depth = _quantised(depth, camera, noise)
    valid &= (depth >= noise.near_m) & (depth <= noise.far_m)
    units = np.rint(np.where(valid, depth, 0.0) / depth_unit_m)
    return np.clip(units, 0, np.iinfo(np.uint16).max).astype(np.uint16)


def _field(shape: tuple[int, ...], noise: NoiseModel, rng: np.random.Generator) -> Floats32:
    """Unit-variance Gaussian noise (H, W), correlated over the sensor's matching window."""
    white = rng.standard_normal(shape, dtype=np.float32)
    if noise.correlation_px == 0.0:
        return white
    size = 2 * int(np.ceil(3.0 * noise.correlation_px)) + 1
    kernel = cv2.getGaussianKernel(size, noise.correlation_px, ktype=cv2.CV_32F)
    kernel /= np.linalg.norm(kernel)  # keeps the variance at one
    return np.asarray(cv2.sepFilter2D(white, -1, kernel, kernel, borderType=cv2.BORDER_REFLECT))


def _chance(probability: float, like: NDArray[Any], rng: np.random.Generator) -> Mask:
    return rng.random(like.shape, dtype=np.float32) < probability


def _edge_neighbourhood(depth: Floats32, *, radius: int) -> tuple[Mask, Floats32, Floats32]:
    """Pixels within ``radius`` of a depth edge, and the nearest and farthest depth around each pixel.

    The farthest is 0 where part of the neighbourhood is empty.
    """
    window = np.ones((2 * radius + 1, 2 * radius + 1), np.uint8)
    filled = np.where(depth > 0.0, depth, np.float32(_EMPTY))
    front, behind = cv2.erode(filled, window), cv2.dilate(filled, window)
    edge = (behind - front > _EDGE_STEP_M) & (depth > 0.0)
    return edge, np.asarray(front), np.where(behind < _EMPTY, behind, np.float32(0.0))


def _with_ragged_edges(
    depth: Floats32, angle: Floats32, noise: NoiseModel, rng: np.random.Generator
) -> tuple[Floats32, Floats32]:
    """Move depth edges sideways: near an edge a pixel reads its value where the lateral error puts it.

    Away from edges nothing moves, because there the axial noise already holds what a slanted surface adds.
    """
    if noise.lateral_floor_px == 0.0 and noise.lateral_grazing_px == 0.0:
        return depth, angle
    near = _near_any_edge(depth)
    sigma = noise.lateral_sigma(np.where(depth > 0.0, angle, np.float32(0.0)))
    rows, columns = np.indices(depth.shape, dtype=np.float32)
    x = np.where(near, columns + sigma * _field(depth.shape, noise, rng), columns)
    y = np.where(near, rows + sigma * _field(depth.shape, noise, rng), rows)
    maps = (x.astype(np.float32), y.astype(np.float32))
    moved = cv2.remap(depth, *maps, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
    tilted = cv2.remap(angle, *maps, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(moved), np.asarray(tilted)


def _near_any_edge(depth: Floats32) -> Mask:
    """Pixels within three of a depth edge, on both of its sides."""
    window = np.ones((3, 3), np.uint8)
    filled = np.where(depth > 0.0, depth, np.float32(_EMPTY))
    edge = cv2.dilate(filled, window) - cv2.erode(filled, window) > _EDGE_STEP_M
    return np.asarray(cv2.dilate(edge.astype(np.uint8), np.ones((5, 5), np.uint8))).astype(bool)


def _lost_at_grazing(angle: Floats32, noise: NoiseModel, rng: np.random.Generator) -> Mask:
    """Surfaces seen at a grazing angle drop out in patches, more and more of them as the angle grows."""
    none_below, all_above = noise.grazing_drop_rad
    chance = np.clip((angle - none_below) / max(all_above - none_below, 1e-9), 0.0, 1.0)
    if not chance.any():
        return np.zeros(angle.shape, dtype=bool)
    return np.asarray(ndtr(_field(angle.shape, noise, rng)) < chance)


def _between(front: Floats32, behind: Floats32, noise: NoiseModel, rng: np.random.Generator) -> Floats32:
    """Depths of flying pixels: anywhere from the front surface to the one behind it, or a little way into nothing."""
    end = np.where(behind > 0.0, behind, front + np.float32(noise.flying_reach_m))
    return np.asarray(front + rng.random(front.shape, dtype=np.float32) * (end - front))


def _with_axial_error(
    depth: Floats32, angle: Floats32, camera: Camera, noise: NoiseModel, rng: np.random.Generator
) -> Floats32:
    """Add correlated depth noise. What rounding the disparity will add (step^2 / 12) is taken off beforehand,
    because the published figures were measured on quantised images.
    """
    sigma = noise.axial_sigma(depth, angle)
    if not sigma.any():
        return depth
    step = depth**2 * noise.disparity_step_px / _focal_times_baseline(camera, noise)
    free = np.sqrt(np.maximum(sigma**2 - step**2 / 12.0, 0.0))
    return np.asarray(depth + free * _field(depth.shape, noise, rng), dtype=np.float32)


def _quantised(depth: Floats32, camera: Camera, noise: NoiseModel) -> Floats32:
    """Depth whose disparity ``f b / z`` is a whole number of steps."""
    if noise.disparity_step_px == 0.0:
        return depth
    scale = _focal_times_baseline(camera, noise) / noise.disparity_step_px
    steps = np.rint(scale / np.maximum(depth, 1e-3))
    return np.asarray(scale / np.maximum(steps, 1.0), dtype=np.float32)


def _focal_times_baseline(camera: Camera, noise: NoiseModel) -> float:
    """In px m. Without a baseline there is no disparity, and no step of it: any number serves."""
    return camera.fx * noise.baseline_m if noise.baseline_m > 0.0 else 1.0
