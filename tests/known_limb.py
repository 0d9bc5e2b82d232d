"""A small simulated recording of a known body, and exact clouds of it, for tests of fitting and tracking."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from adapt.anatomy import Anatomy, Floats
from adapt.match.correspondences import Target
from adapt.match.visibility import pixel_of
from adapt.model.body import Body, pose_skin, rest_theta
from adapt.subject import Subject, load_subject, save_subject
from capture.calibration.calibrate import calibrate_recording, write_calibration
from capture.camera import Camera
from capture.cloud.fuse import Cloud, View, fuse, region_of_interest, view_points
from capture.recording import Recording, Region, instants, open_recording
from capture.rigid import inverse
from capture.simulation.ray_casting import cast, scene_of
from capture.simulation.rig import default_rig
from capture.simulation.sensor import carmine_camera
from track.accuracy.truth import read_truth, world_from_common
from track.evaluation.known import carried
from track.evaluation.random_bodies import random_body
from track.simulation.performance import Performance
from track.simulation.simulate import simulate_performance

ANATOMY = "upper-limb-right"
FRAMES = 12
FPS = 30.0
SEED = 3


@dataclass(frozen=True, eq=False)
class KnownLimb:
    """A recording with its truth carried into the recording's common frame: who moves, and how (T, n)."""

    recording: Recording
    subject: Subject
    times: Floats
    thetas: Floats

    @cached_property
    def targets(self) -> list[Target]:
        """The cloud of every frame."""
        region = region_of_interest(self.recording)
        return [Target(fuse(self.recording, moment, region=region)) for moment in instants(self.recording)]


def bending_and_twisting(body: Body, *, count: int = FRAMES, swing: float = 0.5) -> Performance:
    """Every joint moves, ``swing`` of its way, and the shoulder a little."""
    phase = 2.0 * np.pi * np.arange(count) / count
    waves = {
        "elbow_flexion": 65.0 - 35.0 * swing * np.cos(phase),
        "pro_sup": 45.0 * swing * np.cos(phase / 2.0),
        "flexion": 20.0 * swing * np.sin(phase + 1.0),
        "deviation": 5.0 + 8.0 * swing * np.sin(phase + 2.0),
    }
    thetas = np.tile(rest_theta(body), (count, 1))
    for name, degrees in waves.items():
        thetas[:, body.anatomy.coordinate_index(name)] = np.deg2rad(degrees)
    turn = Rotation.from_rotvec(np.deg2rad(8.0) * swing * np.sin(phase)[:, None] * [0.3, 0.5, 0.8])
    thetas[:, :3] = (turn * Rotation.from_rotvec(thetas[:, :3])).as_rotvec()
    thetas[:, 3:6] += 0.01 * np.sin(phase)[:, None]
    return Performance(body, np.arange(count) / FPS, thetas)


def record(anatomy: Anatomy, path: Path) -> KnownLimb:
    """Simulate, calibrate, and carry the truth into the common frame."""
    performance = bending_and_twisting(random_body(anatomy, SEED))
    recording = simulate_performance(performance, path, seed=SEED)
    write_calibration(recording, calibrate_recording(recording))
    recording = open_recording(path)
    truth = read_truth(recording)
    thetas = carried(anatomy, truth.thetas, inverse(world_from_common(recording, truth)))
    save_subject(known_subject(performance.body, thetas[::4], performance.times[::4]), path.parent / "subject.npz")
    subject = load_subject(path.parent / "subject.npz")  # its skin is stored in single precision
    return KnownLimb(recording, subject, performance.times, thetas)


def known_subject(body: Body, thetas: Floats, times: Floats) -> Subject:
    """A subject as an adaptation that made no error would have found it."""
    return Subject(body, thetas, times, 1e-6 * np.eye(len(body.shape)), {"poses": [], "landmarks_never_shown": []})


def exact_target(
    body: Body, theta: Floats, *, spacing_m: float = 0.0075, change: Callable[[View], View] = lambda view: view
) -> Target:
    """What two sensors without any error see of a posed body."""
    skin = pose_skin(body, theta)
    return Target(exact_cloud(skin, body.anatomy.skin_faces, spacing_m=spacing_m, change=change))


def exact_cloud(
    vertices: Floats,
    faces: np.ndarray,
    *,
    spacing_m: float = 0.0075,
    change: Callable[[View], View] = lambda view: view,
) -> Cloud:
    """What two sensors without any error see of a mesh; ``change`` is what becomes of each view."""
    scene, views = scene_of(vertices, faces), []
    for sensor in default_rig(vertices).sensors:
        depth = cast(scene, sensor.camera, sensor.world_from_sensor, vertices, 0.0).depth
        views.append(change(View(sensor.name, sensor.camera, sensor.world_from_sensor, depth)))
    everywhere = Region(np.full(3, -10.0), np.full(3, 10.0))
    parts = [view_points(view, everywhere, spacing_m=spacing_m) for view in views]
    points, normals, boundary = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    sensor_index = np.repeat(np.arange(len(parts)), [len(part[0]) for part in parts])
    return Cloud(points, normals, boundary, sensor_index, tuple(views))


def cropped(view: View, points: Floats) -> View:
    """The view by a sensor that has ``points`` (N, 3) out of its image, and as much else in it as can be."""
    row, column, _ = pixel_of(view, points)
    height, width = view.depth.shape
    sides = [(0, row.min(), 0, width), (row.max() + 1, height, 0, width)]
    sides += [(0, height, 0, column.min()), (0, height, column.max() + 1, width)]
    top, bottom, left, right = max(sides, key=lambda s: np.count_nonzero(view.depth[s[0] : s[1], s[2] : s[3]]))
    camera = view.camera
    moved = replace(camera, width=right - left, height=bottom - top, cx=camera.cx - left, cy=camera.cy - top)
    return replace(view, camera=moved, depth=view.depth[top:bottom, left:right])


def covered(view: View, points: Floats, *, nearer_m: float = 0.15, margin_px: int = 12) -> View:
    """The view with a board that faces the sensor before ``points`` (N, 3)."""
    row, column, _ = pixel_of(view, points)
    near = (points - view.world_from_sensor[:3, 3]) @ view.world_from_sensor[:3, 2]
    depth = view.depth.copy()
    rows = slice(max(0, row.min() - margin_px), row.max() + margin_px)
    depth[rows, max(0, column.min() - margin_px) : column.max() + margin_px] = near.min() - nearer_m
    return replace(view, depth=depth)


def empty_view(camera: Camera | None = None) -> View:
    """A sensor at the origin that looks along +Z and measured nothing."""
    camera = camera or replace(carmine_camera(), width=64, height=48, fx=57.5, fy=57.5, cx=31.5, cy=23.5)
    return View("one", camera, np.eye(4), np.zeros((camera.height, camera.width), np.float32))


def bent(body: Body, elbow_deg: float, twist_deg: float) -> Floats:
    """The rest pose with elbow and forearm at given angles."""
    theta = rest_theta(body)
    theta[body.anatomy.coordinate_index("elbow_flexion")] = np.deg2rad(elbow_deg)
    theta[body.anatomy.coordinate_index("pro_sup")] = np.deg2rad(twist_deg)
    return theta
