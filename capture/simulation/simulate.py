"""Recordings of any moving triangle mesh, as depth sensors around it would have made them.

The mesh moves in its own frame, the *world* of the truth file: metres, any orientation (the default rig takes +Y as
up and stands on the +X side). Sensors see first a calibration box alone, then the mesh alone. ``truth.npz`` holds
what a real recording could not tell:

- ``times_s`` (T,);
- ``sensor_names`` (S,) and ``world_from_sensor`` (S, 4, 4), in the same order;
- ``world_from_box`` (4, 4), the box's axes in the order of its size;
- whatever the caller adds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from capture._open3d import open3d
from capture.camera import Camera, ray_slopes
from capture.errors import RecordingError
from capture.files import UNREADABLE
from capture.projection import project
from capture.recording import Recording, RecordingWriter, Sensor, open_recording
from capture.rigid import Floats, apply, inverse, transform
from capture.simulation.sensor import NoiseModel, carmine, carmine_camera, observe

Ints = NDArray[np.int64]
Floats32 = NDArray[np.float32]

BOX_SIZE_M = (0.30, 0.20, 0.15)
"""Sides of the calibration box: three different ones, so that each face tells by its shape which one it is."""

_DEPTH_UNIT_M = 0.001
_FARTHEST_M = 10.0  # of the range a recording states when the noise model has no limit
_FRAME_PERIOD_S = 1.0 / 30.0
_EDGE_MARGIN_PX = 8  # the default rig keeps the subject this far inside the image
_SHADOW_OFFSET_M = 0.001  # a shadow ray starts this far off the surface
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


@dataclass(frozen=True, eq=False)
class View:
    """What one ideal sensor sees, all (H, W): depth z (m, 0 for nothing), cosine of ray to normal, shadow."""

    depth: Floats32
    normal_cos: Floats32
    shadow: NDArray[np.bool_]


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


def simulate_recording(
    out: Path,
    frames: Iterable[Floats],
    faces: Ints,
    times: Iterable[float],
    *,
    rig: SensorRig | None = None,
    noise: NoiseModel | None = None,
    seed: int = 0,
    box_frames: int = 15,
    truth: Mapping[str, NDArray[Any]] | None = None,
    overwrite: bool = False,
    progress: Callable[[int], None] | None = None,
) -> Recording:
    """Record a moving mesh.

    Args:
        out: the folder to make.
        frames: vertices (V, 3) m at each time. With a rig they are taken one by one; without one all are read
            first, because the sensors are placed around the whole motion.
        faces: (F, 3) vertex indices, the same for all frames.
        times: of the frames (s), increasing, as many.
        rig: the sensors and the box; ``default_rig`` around the motion if None.
        noise: the sensors' errors; ``carmine()`` if None, ``NoiseModel()`` for exact depth.
        seed: of the noise and of the default rig.
        box_frames: how many images of the box each sensor takes.
        truth: arrays to add to ``truth.npz``.
        overwrite: replace a recording that stands there.
        progress: called with the number of frames done.

    Returns:
        The recording, opened.

    Raises:
        RecordingError: vertices or faces of the wrong shape, not finite or out of range; as many times as frames
            are missing; the motion does not fit into the images; the folder is taken.
    """
    faces = _checked_faces(faces)
    if rig is None:
        frames = list(frames)
        rig = default_rig(_swept_points(frames), seed=seed)
    noise = carmine() if noise is None else noise
    stamps: list[float] = []
    with RecordingWriter(
        out, sensors=[_described(s, noise) for s in rig.sensors], created_by="bonetrack simulate", overwrite=overwrite
    ) as writer:
        writer.set_box(rig.box_size_m)
        _record_box(writer, rig, noise, seed=seed, count=box_frames)
        for index, (vertices, time_s) in enumerate(_together(frames, times)):
            vertices = _checked_vertices(vertices, faces, index)
            scene = scene_of(vertices, faces)
            for number, sensor in enumerate(rig.sensors):
                rng = np.random.default_rng([seed, 1, number, index])
                view = cast(scene, sensor.camera, sensor.world_from_sensor, vertices, noise.baseline_m)
                image = _observed(view, sensor.camera, noise, rng)
                writer.add_frame(sensor.name, image, time_s + sensor.clock_offset_s)
            stamps.append(time_s)
            if progress is not None:
                progress(index + 1)
        writer.set_truth(_truth(rig, stamps) | dict(truth or {}))
    return open_recording(out)


def simulate_mesh_file(
    mesh: Path,
    out: Path,
    *,
    noise: NoiseModel | None = None,
    seed: int = 0,
    overwrite: bool = False,
    progress: Callable[[int], None] | None = None,
) -> Recording:
    """Record the moving mesh of an ``.npz`` file: ``vertices`` (T, V, 3) m, ``faces`` (F, 3), ``fps``.

    Raises:
        RecordingError: the file is not such a file, or as ``simulate_recording``.
    """
    vertices, faces, fps = _read_mesh_file(mesh)
    try:
        return simulate_recording(
            out,
            vertices,
            faces,
            (np.arange(len(vertices)) / fps).tolist(),
            noise=noise,
            seed=seed,
            overwrite=overwrite,
            progress=progress,
        )
    except RecordingError as error:
        if error.where is not None:
            raise
        raise RecordingError(error.problem, where=mesh, remedy=error.remedy) from error


def cast(scene: Any, camera: Camera, world_from_sensor: Floats, vertices: Floats, baseline_m: float) -> View:
    """The exact view of the scene of a mesh with ``vertices`` (V, 3) m (see ``scene_of``).

    Rays are cast only where the vertices' bounding rectangle is in the image. Without a baseline nothing is in shadow.
    """
    shape = (camera.height, camera.width)
    view = View(np.zeros(shape, np.float32), np.zeros(shape, np.float32), np.zeros(shape, np.bool_))
    window = _image_window(camera, apply(inverse(world_from_sensor), vertices))
    slopes = ray_slopes(camera)[window]
    if slopes.size == 0:
        return view
    rotation, origin = world_from_sensor[:3, :3], world_from_sensor[:3, 3]
    directions = np.concatenate([slopes, np.ones((*slopes.shape[:2], 1))], axis=-1) @ rotation.T
    hits = scene.cast_rays(_rays(np.broadcast_to(origin, directions.shape), directions))
    depth = hits["t_hit"].numpy()  # directions have z = 1 in the sensor's frame, so this is z
    hit = np.isfinite(depth)
    normals = hits["primitive_normals"].numpy()
    across = (normals * directions).sum(axis=-1)
    view.depth[window] = np.where(hit, depth, 0.0)
    view.normal_cos[window] = np.where(hit, np.abs(across) / np.linalg.norm(directions, axis=-1), 0.0)
    if baseline_m > 0.0:
        facing = normals[hit] * -np.sign(across[hit])[:, None]
        starts = origin + directions[hit] * depth[hit][:, None] + _SHADOW_OFFSET_M * facing
        projector = origin + rotation[:, 0] * baseline_m
        view.shadow[window][hit] = scene.test_occlusions(_rays(starts, projector - starts), tfar=1.0).numpy()
    return view


def _rays(origins: Floats, directions: Floats) -> Any:
    rays = np.concatenate([origins, directions], axis=-1).astype(np.float32)
    return open3d().core.Tensor.from_numpy(np.ascontiguousarray(rays))


def scene_of(vertices: Floats, faces: Ints) -> Any:
    """The mesh with vertices (V, 3) m and faces (F, 3), ready to cast rays at: an Open3D ``RaycastingScene``."""
    core = open3d().core
    scene = open3d().t.geometry.RaycastingScene()
    scene.add_triangles(
        core.Tensor.from_numpy(np.ascontiguousarray(vertices, dtype=np.float32)),
        core.Tensor.from_numpy(np.ascontiguousarray(faces, dtype=np.uint32)),
    )
    return scene


def _image_window(camera: Camera, points: Floats) -> tuple[slice, slice]:
    """Rows and columns of the image that points (N, 3) of the sensor's frame can fall on, one pixel around included."""
    pixels, _ = project(camera, points)
    if not np.isfinite(pixels).all():
        return slice(0, camera.height), slice(0, camera.width)
    low = np.clip(np.floor(pixels.min(axis=0)) - 1, 0, (camera.width, camera.height)).astype(int)
    high = np.clip(np.ceil(pixels.max(axis=0)) + 2, 0, (camera.width, camera.height)).astype(int)
    return slice(low[1], high[1]), slice(low[0], high[0])


def _observed(view: View, camera: Camera, noise: NoiseModel, rng: np.random.Generator) -> NDArray[np.uint16]:
    return observe(view.depth, view.normal_cos, view.shadow, camera, noise, rng, depth_unit_m=_DEPTH_UNIT_M)


def _record_box(writer: RecordingWriter, rig: SensorRig, noise: NoiseModel, *, seed: int, count: int) -> None:
    vertices, faces = box_mesh(rig.box_size_m)
    vertices = apply(rig.world_from_box, vertices)
    scene = scene_of(vertices, faces)
    for number, sensor in enumerate(rig.sensors):
        view = cast(scene, sensor.camera, sensor.world_from_sensor, vertices, noise.baseline_m)
        for index in range(count):
            rng = np.random.default_rng([seed, 0, number, index])
            time_s = index * _FRAME_PERIOD_S + sensor.clock_offset_s
            writer.add_box_frame(sensor.name, _observed(view, sensor.camera, noise, rng), time_s)


def box_mesh(size_m: tuple[float, float, float]) -> tuple[Floats, Ints]:
    """Vertices (8, 3) m and outward faces (12, 3) of a box about the origin.

    >>> vertices, faces = box_mesh((2.0, 4.0, 6.0))
    >>> vertices.max(axis=0)
    array([1., 2., 3.])
    """
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * size_m
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    return corners, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def _described(sensor: RigSensor, noise: NoiseModel) -> Sensor:
    return Sensor(
        name=sensor.name,
        camera=sensor.camera,
        depth_unit_m=_DEPTH_UNIT_M,
        depth_range_m=(noise.near_m, min(noise.far_m, _FARTHEST_M)),
    )


def _truth(rig: SensorRig, times: list[float]) -> dict[str, NDArray[Any]]:
    return {
        "times_s": np.array(times),
        "sensor_names": np.array([sensor.name for sensor in rig.sensors]),
        "world_from_sensor": np.stack([sensor.world_from_sensor for sensor in rig.sensors]),
        "world_from_box": rig.world_from_box,
    }


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


def _swept_points(frames: list[Floats]) -> Floats:
    """All positions (N, 3) of all vertices."""
    if not frames:
        raise RecordingError("there are no frames to record")
    points = np.concatenate([np.asarray(vertices, dtype=np.float64).reshape(-1, 3) for vertices in frames])
    if not len(points) or not np.isfinite(points).all():
        raise RecordingError("the mesh has no vertices, or some that are not finite numbers")
    return points


def _together(frames: Iterable[Floats], times: Iterable[float]) -> Iterator[tuple[Floats, float]]:
    for index, (vertices, time_s) in enumerate(zip_longest(frames, times)):
        if vertices is None or time_s is None:
            raise RecordingError(
                f"there must be as many times as frames, and one of them ends after {index}",
                remedy="give one time for each frame",
            )
        yield vertices, time_s


def _checked_faces(faces: Ints) -> Ints:
    faces = np.asarray(faces)
    if faces.ndim != 2 or faces.shape[1] != 3 or not len(faces) or faces.dtype.kind not in "iu" or faces.min() < 0:
        raise RecordingError(f"faces must be whole numbers of shape (F, 3), got {faces.dtype} {faces.shape}")
    return faces.astype(np.int64)


def _checked_vertices(vertices: Floats, faces: Ints, index: int) -> Floats:
    vertices = np.asarray(vertices, dtype=np.float64)
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise RecordingError(f"frame {index}: vertices must have the shape (V, 3), got {vertices.shape}")
    if faces.max() >= len(vertices):
        raise RecordingError(f"frame {index}: faces name vertex {faces.max()}, and there are {len(vertices)}")
    if not np.isfinite(vertices).all():
        raise RecordingError(f"frame {index}: some vertices are not finite numbers")
    return vertices


def _read_mesh_file(path: Path) -> tuple[Floats, Ints, float]:
    """Vertices (T, V, 3) m, faces (F, 3) and frames per second of a mesh file."""
    try:
        with np.load(path, allow_pickle=False) as data:
            missing = [key for key in ("vertices", "faces", "fps") if key not in data]
            arrays = {} if missing else {key: np.asarray(data[key]) for key in ("vertices", "faces", "fps")}
    except FileNotFoundError as error:
        raise RecordingError("does not exist", where=path, remedy="name the mesh's .npz file") from error
    except UNREADABLE as error:
        raise RecordingError("is not an .npz file of plain arrays", where=path, remedy="use numpy.savez") from error
    if missing:
        raise RecordingError(
            f"has no {', '.join(missing)}", where=path, remedy="store vertices (T, V, 3) m, faces (F, 3) and fps"
        )
    vertices, fps = arrays["vertices"], arrays["fps"]
    if vertices.ndim != 3 or vertices.shape[2] != 3 or vertices.dtype.kind != "f" or not vertices.size:
        raise RecordingError(
            f"vertices must be floating point numbers (T, V, 3), got {vertices.dtype} {vertices.shape}", where=path
        )
    if fps.size != 1 or fps.dtype.kind not in "iuf" or not 0.0 < float(fps.reshape(())) < np.inf:
        problem = f"fps must be one positive number, got {fps}"
        raise RecordingError(problem, where=path, remedy="store fps as one number, as 30.0")
    return vertices.astype(np.float64), arrays["faces"], float(fps.reshape(()))
