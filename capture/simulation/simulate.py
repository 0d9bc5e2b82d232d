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

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.camera import Camera
from capture.errors import RecordingError
from capture.recording import Recording, RecordingWriter, Sensor, open_recording
from capture.rigid import Floats, apply
from capture.simulation.ray_casting import View, cast, scene_of
from capture.simulation.rig import Ints, RigSensor, SensorRig, box_mesh, default_rig
from capture.simulation.sensor import NoiseModel, carmine, observe

_DEPTH_UNIT_M = 0.001
_FARTHEST_M = 10.0  # of the range a recording states when the noise model has no limit
_FRAME_PERIOD_S = 1.0 / 30.0


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
    """Record a moving mesh, and open the recording.

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

    Raises:
        RecordingError: vertices or faces of the wrong shape, not finite or out of range; as many times as frames
            are missing; the motion does not fit into the images; the folder is taken.
    """
    faces = checked_faces(faces)
    if rig is None:
        frames = list(frames)
        rig = default_rig(_swept_points(frames), seed=seed)
    noise = carmine() if noise is None else noise
    with RecordingWriter(
        out, sensors=[_described(s, noise) for s in rig.sensors], created_by="bonetrack simulate", overwrite=overwrite
    ) as writer:
        writer.set_box(rig.box_size_m)
        _record_box(writer, rig, noise, seed=seed, count=box_frames)
        stamps = _record_motion(writer, rig, noise, _together(frames, times), faces, seed=seed, progress=progress)
        writer.set_truth(_truth(rig, stamps) | dict(truth or {}))
    return open_recording(out)


def _record_motion(
    writer: RecordingWriter,
    rig: SensorRig,
    noise: NoiseModel,
    frames: Iterable[tuple[Floats, float]],
    faces: Ints,
    *,
    seed: int,
    progress: Callable[[int], None] | None,
) -> list[float]:
    """Write what the sensors see of every frame; the frames' times (s)."""
    stamps = []
    for index, (frame, time_s) in enumerate(frames):
        vertices = checked_vertices(frame, faces, index)
        scene = scene_of(vertices, faces)
        for number, sensor in enumerate(rig.sensors):
            rng = np.random.default_rng([seed, 1, number, index])
            view = cast(scene, sensor.camera, sensor.world_from_sensor, vertices, noise.baseline_m)
            image = _observed(view, sensor.camera, noise, rng)
            writer.add_frame(sensor.name, image, time_s + sensor.clock_offset_s)
        stamps.append(time_s)
        if progress is not None:
            progress(index + 1)
    return stamps


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


def checked_faces(faces: Ints) -> Ints:
    """Triangles (F, 3) as whole numbers; RecordingError where they are none."""
    faces = np.asarray(faces)
    if faces.ndim != 2 or faces.shape[1] != 3 or not len(faces) or faces.dtype.kind not in "iu" or faces.min() < 0:
        raise RecordingError(f"faces must be whole numbers of shape (F, 3), got {faces.dtype} {faces.shape}")
    return faces.astype(np.int64)


def checked_vertices(vertices: Floats, faces: Ints, index: int) -> Floats:
    """A frame's vertices (V, 3) m; RecordingError where the faces (F, 3) need others, or some are not finite."""
    vertices = np.asarray(vertices, dtype=np.float64)
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise RecordingError(f"frame {index}: vertices must have the shape (V, 3), got {vertices.shape}")
    if faces.max() >= len(vertices):
        raise RecordingError(f"frame {index}: faces name vertex {faces.max()}, and there are {len(vertices)}")
    if not np.isfinite(vertices).all():
        raise RecordingError(f"frame {index}: some vertices are not finite numbers")
    return vertices
