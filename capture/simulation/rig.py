"""Sensors around a motion, and the calibration box before them: where they stand so that all of it is seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from capture.camera import Camera
from capture.errors import RecordingError
from capture.projection import project
from capture.rigid import Floats, apply, inverse, transform
from capture.simulation.sensor import carmine, carmine_camera

Ints = NDArray[np.int64]

BOX_SIZE_M = (0.30, 0.20, 0.15)
"""Sides of the calibration box: three different ones, so that each face tells by its shape which one it is."""

_EDGE_MARGIN_PX = 8  # the default rig keeps the subject this far inside the image
_BOX_CANDIDATES = 256
_POINTS_IN_VIEW = 50_000  # of the whole motion's; the edge margin covers what lies between them


@dataclass(frozen=True, eq=False)
class RigSensor:
    """One sensor of a rig: its pose (4, 4), and what its clock adds to the true time (s)."""

    name: str
    camera: Camera
    world_from_sensor: Floats
    clock_offset_s: float = 0.0


@dataclass(frozen=True, eq=False)
class SensorRig:
    """The sensors that record together, and where the calibration box stands in front of them (4, 4)."""

    sensors: tuple[RigSensor, ...]
    world_from_box: Floats = field(repr=False)
    box_size_m: tuple[float, float, float] = BOX_SIZE_M


def default_rig(
    points: Floats,
    *,
    distance_m: float = 1.2,
    spread_deg: float = 80.0,
    elevations_deg: Sequence[float] = (24.0, 12.0),
    box_size_m: tuple[float, float, float] = BOX_SIZE_M,
    seed: int = 0,
) -> SensorRig:
    """Carmine sensors on the +X side of ``points`` (N, 3), looking at the middle of their bounding box.

    There are as many sensors as elevations (deg above the XZ plane), spread evenly over ``spread_deg`` about +Y.
    All stand ``distance_m`` away, or as much farther as it takes to have every point in each image. The box stands
    in the middle, turned so that every sensor sees three of its faces well.

    Raises:
        RecordingError: the points do not fit into the images from anywhere within the sensors' range.

    >>> rig = default_rig(np.array([[-0.1, -0.3, -0.1], [0.1, 0.3, 0.1]]))
    >>> [(sensor.name, round(float(np.linalg.norm(sensor.world_from_sensor[:3, 3])), 3)) for sensor in rig.sensors]
    [('sensor1', 1.2), ('sensor2', 1.2)]
    """
    centre = (points.min(axis=0) + points.max(axis=0)) / 2.0
    azimuths = np.linspace(-0.5, 0.5, len(elevations_deg)) * spread_deg if len(elevations_deg) > 1 else [0.0]
    directions = [_direction(azimuth, elevation) for azimuth, elevation in zip(azimuths, elevations_deg, strict=True)]
    camera = carmine_camera()
    some = points[:: max(1, len(points) // _POINTS_IN_VIEW)]
    for distance in np.arange(distance_m, carmine().far_m, 0.05):
        poses = [_looking_at(centre, centre + distance * direction) for direction in directions]
        if all(_in_view(camera, pose, some) for pose in poses):
            break
    else:
        size = " x ".join(f"{side:.2f}" for side in np.ptp(points, axis=0))
        raise RecordingError(
            f"a motion that fills {size} m does not fit into the sensors' images", remedy="is the mesh in metres?"
        )
    sensors = tuple(RigSensor(f"sensor{i + 1}", camera, pose) for i, pose in enumerate(poses))
    return SensorRig(sensors, transform(_box_turned_to(directions, seed=seed), centre), box_size_m)


def box_mesh(size_m: tuple[float, float, float]) -> tuple[Floats, Ints]:
    """Vertices (8, 3) m and outward faces (12, 3) of a box about the origin.

    >>> vertices, faces = box_mesh((2.0, 4.0, 6.0))
    >>> vertices.max(axis=0)
    array([1., 2., 3.])
    """
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * size_m
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    return corners, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def _direction(azimuth_deg: float, elevation_deg: float) -> Floats:
    """Unit vector (3,): +X turned about +Y by the azimuth and raised by the elevation."""
    azimuth, elevation = np.deg2rad(azimuth_deg), np.deg2rad(elevation_deg)
    level = np.cos(elevation)
    return np.array([level * np.cos(azimuth), np.sin(elevation), -level * np.sin(azimuth)])


def _looking_at(target: Floats, eye: Floats) -> Floats:
    """Pose (4, 4) of a sensor at ``eye`` that looks at ``target`` and holds +Y upwards in its image."""
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, (0.0, 1.0, 0.0))
    right /= np.linalg.norm(right)
    return transform(np.column_stack([right, np.cross(forward, right), forward]), eye)


def _in_view(camera: Camera, world_from_sensor: Floats, points: Floats) -> bool:
    pixels, depth = project(camera, apply(inverse(world_from_sensor), points))
    if (depth < carmine().near_m).any():
        return False
    margin, size = _EDGE_MARGIN_PX, np.array([camera.width, camera.height])
    return bool(((pixels >= margin) & (pixels <= size - 1 - margin)).all())


def _box_turned_to(directions: Sequence[Floats], *, seed: int) -> Floats:
    """Of many random rotations (3, 3) the one whose worst seen face looks most towards its sensor.

    A face is seen under the cosine |R^T d|: a box shows one of each pair of opposite faces.
    """
    candidates = Rotation.random(_BOX_CANDIDATES, np.random.default_rng([seed, 2])).as_matrix()
    cosines = np.abs(np.einsum("nij,si->nsj", candidates, np.asarray(directions)))
    return np.asarray(candidates[cosines.min(axis=(1, 2)).argmax()])
