"""Things besides the limb that sensors see: what stands in the way, and what a hand holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from adapt.anatomy import Floats, Ints
from adapt.model.body import Body, bone_frames, bone_transforms, pose_skin, rest_theta
from adapt.model.handles import deform, handle_positions
from capture._open3d import open3d
from capture.recording import Recording
from capture.rigid import apply, transform
from capture.simulation.rig import RigSensor, SensorRig, box_mesh
from capture.simulation.sensor import NoiseModel
from capture.simulation.simulate import simulate_recording
from track.simulation.performance import Performance
from track.simulation.simulate import performance_rig, truth_of


@dataclass(frozen=True, eq=False)
class Thing:
    """A mesh, (N, 3) m and (F, 3), that rides on a ``bone`` of somebody at rest, or stands still where that is None."""

    vertices: Floats = field(repr=False)
    faces: Ints = field(repr=False)
    bone: str | None = None

    def at(self, body: Body, theta: Floats) -> Floats:
        """Its vertices (N, 3) while a body is in a pose."""
        return self.vertices if self.bone is None else apply(bone_transforms(body, theta)[self.bone], self.vertices)


def skin_and_things(body: Body, theta: Floats, things: Sequence[Thing]) -> Floats:
    """Vertices of the skin and of all things, one after the other."""
    return np.concatenate([pose_skin(body, theta), *(thing.at(body, theta) for thing in things)])


def faces_with_things(body: Body, things: Sequence[Thing]) -> Ints:
    """The triangles of ``skin_and_things``."""
    counts = [len(body.anatomy.skin_vertices), *(len(thing.vertices) for thing in things)]
    starts = np.cumsum([0, *counts[:-1]])
    faces = [body.anatomy.skin_faces, *(thing.faces for thing in things)]
    return np.concatenate([start + part for start, part in zip(starts, faces, strict=True)])


def board(sensor: RigSensor, point: Floats, *, before_m: float, side_m: float) -> Thing:
    """A square board that faces a sensor so far ``before`` a point (3,) of the world."""
    vertices, faces = box_mesh((side_m, side_m, 0.005))
    ray = point - sensor.world_from_sensor[:3, 3]
    centre = point - before_m * ray / np.linalg.norm(ray)
    return Thing(apply(transform(sensor.world_from_sensor[:3, :3], centre), vertices), faces)


def ball_in_hand(body: Body, *, radius_m: float, gap_m: float) -> Thing:
    """A ball that rides on the last bone, before its distal handle on the palm's side, ``gap_m`` off the handle."""
    bone, handle = body.anatomy.bones[-1], body.anatomy.handles[-1]
    own = len(body.anatomy.handles) - 1
    place = deform(np.array([handle.position]), np.eye(own + 1)[[own]], handle_positions(body.anatomy), body.a)[0]
    palm = bone_frames(body, rest_theta(body))[bone.name][:3, 0]
    mesh = open3d().geometry.TriangleMesh.create_sphere(radius_m, 12)
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.triangles).astype(np.int64)
    return Thing(vertices + place + (gap_m + radius_m) * palm, faces, bone.name)


def simulate_with_things(
    performance: Performance,
    out: Path,
    things: Sequence[Thing],
    *,
    noise: NoiseModel | None = None,
    rig: SensorRig | None = None,
    seed: int = 0,
) -> Recording:
    """Record a performance and ``things`` besides, as ``track.simulation.simulate`` records it alone."""
    body = performance.body
    return simulate_recording(
        out,
        (skin_and_things(body, theta, things) for theta in performance.thetas),
        faces_with_things(body, things),
        performance.times.tolist(),
        rig=performance_rig(performance, seed=seed) if rig is None else rig,
        noise=noise,
        seed=seed,
        truth=truth_of(performance),
        overwrite=True,
    )
