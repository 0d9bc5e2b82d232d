"""Recordings of one or more moving bodies and of what stands around them, seen by two simulated sensors."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Floats, load_anatomy
from adapt.model.body import Body, make_body, pose_skin, rest_theta
from capture.calibration.calibrate import calibrate_recording, write_calibration
from capture.camera import Camera
from capture.recording import Recording, RecordingWriter, open_recording, read_depth
from capture.rigid import apply
from capture.simulation.sensor import NoiseModel
from capture.simulation.simulate import SensorRig, box_mesh, simulate_recording
from track.evaluation.performance import Performance, motion_names, perform, random_body
from track.evaluation.simulate import performance_rig
from track.motion import coordinate_names

FPS, SECONDS = 12.0, 3.0
"""Short and slow: what is tried here is whether something is right, not how exactly."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Moving vertices, a function of the frame, and triangles (F, 3)."""

    at: Callable[[int], Floats]
    faces: NDArray[np.int64]


def person(anatomy: str, seed: int, *, scale: float = 1.0) -> Performance:
    """A random body of that anatomy, grown or shrunk as a whole, in the anatomy's made-up motions."""
    body = random_body(load_anatomy(anatomy), seed)
    if scale != 1.0:
        body = resized(body, scale)
    motions = motion_names(body.anatomy)[-1:]
    return perform(body, motions, seconds_each=SECONDS, fps=FPS, seed=seed)


def resized(body: Body, scale: float) -> Body:
    """The body grown or shrunk as a whole, about its first group of handles."""
    affine = body.affine
    grown = affine.uniform(scale).reshape(-1, 4)
    shape = body.shape.reshape(-1, 4).copy()
    shape[:, 1:] = scale * shape[:, 1:] + grown[:, 1:]
    shape[:, 0] *= scale
    # Tissue is displaced in the template and grows with the scales of the handles.
    return make_body(body.anatomy, shape=shape.ravel(), v_hat=body.v_hat)


def skin_of(performance: Performance) -> Mesh:
    """The moving skin of a performance."""
    return Mesh(lambda t: pose_skin(performance.body, performance.thetas[t]), performance.body.anatomy.skin_faces)


def moved(mesh: Mesh, world_from_mesh: Floats) -> Mesh:
    """The mesh, placed elsewhere by a rigid transform (4, 4)."""
    return Mesh(lambda t: apply(world_from_mesh, mesh.at(t)), mesh.faces)


def block(size_m: tuple[float, float, float], centre: Floats) -> Mesh:
    """A box that stands still, its sides cut fine enough to be seen whole."""
    vertices, faces = box_mesh(size_m)
    placed = vertices + centre
    return Mesh(lambda t: placed, faces)


def record(
    performance: Performance,
    out: Path,
    *,
    seed: int,
    meshes: Sequence[Mesh] | None = None,
    noise: NoiseModel | None = None,
    rig: SensorRig | None = None,
) -> Recording:
    """Record a performance (or other ``meshes`` in its stead), calibrated; the truth is the performance's."""
    shown = [skin_of(performance)] if meshes is None else list(meshes)
    starts = np.cumsum([0, *(len(mesh.at(0)) for mesh in shown[:-1])])
    faces = np.concatenate([start + mesh.faces for start, mesh in zip(starts, shown, strict=True)])
    body = performance.body
    truth = {
        "anatomy": np.array(body.anatomy.name),
        "coordinates": np.array(coordinate_names(body.anatomy)),
        "theta": performance.thetas,
        "shape": body.shape,
        "displacement": (body.v_hat - body.anatomy.skin_vertices).astype(np.float32),
    }
    recording = simulate_recording(
        out,
        (np.concatenate([mesh.at(t) for mesh in shown]) for t in range(len(performance.times))),
        faces,
        performance.times.tolist(),
        rig=rig or performance_rig(performance, seed=seed),
        noise=noise,
        seed=seed,
        truth=truth,
    )
    write_calibration(recording, calibrate_recording(recording))
    return open_recording(recording.path)


def rewritten(
    recording: Recording,
    out: Path,
    *,
    camera: Callable[[Camera], Camera] = lambda camera: camera,
    images: Callable[[str, Floats], Floats] = lambda name, depth: depth,
    unit: float = 1.0,
) -> Recording:
    """The recording as another program would have handed it over: other cameras, other images, times ``unit`` longer.

    It keeps its truth, and is calibrated by its own images of the box.
    """
    sensors = [replace(s, camera=camera(s.camera), frames=(), box_frames=()) for s in recording.sensors]
    with RecordingWriter(out, sensors=sensors, created_by="a field trial") as writer:
        if recording.box_size_m is not None:
            writer.set_box(recording.box_size_m)
        for old in recording.sensors:
            for frame in old.box_frames:
                writer.add_box_frame(old.name, images(old.name, read_depth(old, frame)), frame.time_s)
            for frame in old.frames:
                writer.add_frame(old.name, images(old.name, read_depth(old, frame)), frame.time_s * unit)
    if recording.truth_path is not None:
        shutil.copy(recording.truth_path, out)
    made = open_recording(out)
    write_calibration(made, calibrate_recording(made))
    return open_recording(out)


def flipped(camera: Camera) -> Camera:
    """The camera whose image is the mirror image; a user who does not know of the flip keeps the camera instead."""
    return replace(camera, cx=camera.width - 1 - camera.cx)


def flip(depth: Floats) -> Floats:
    """The mirror image of a depth image (H, W)."""
    return np.ascontiguousarray(cv2.flip(np.asarray(depth), 1))


def without(body: Body, bones: Sequence[str]) -> NDArray[np.int64]:
    """The triangles (F, 3) of the skin that does not ride mostly on some bones, closed at the cut by a fan."""
    names = [bone.name for bone in body.anatomy.bones]
    gone = np.isin(body.skin_riding.argmax(axis=1), [names.index(name) for name in bones])
    faces = body.anatomy.skin_faces
    kept = faces[~gone[faces].any(axis=1)]
    edges = np.concatenate([kept[:, [0, 1]], kept[:, [1, 2]], kept[:, [2, 0]]])
    there = {tuple(edge) for edge in edges.tolist()}
    rim = [edge for edge in there if edge[::-1] not in there]
    original = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    open_before = {tuple(edge) for edge in original.tolist()}
    cut = [edge for edge in rim if edge[::-1] in open_before]
    middle = cut[0][0]
    fan = [(b, a, middle) for a, b in cut if middle not in (a, b)]
    return np.concatenate([kept, np.array(fan, dtype=np.int64)])


def standing(performance: Performance) -> Floats:
    """The lowest, middle and highest corner (3, 3) m of the performance's skin at its first frame."""
    skin = pose_skin(performance.body, performance.thetas[0])
    return np.stack([skin.min(axis=0), skin.mean(axis=0), skin.max(axis=0)])


def at_rest(body: Body) -> Floats:
    """The skin (V, 3) of a body at rest."""
    return pose_skin(body, rest_theta(body))
