"""Recordings with one fault each: frames that are missing or swapped, clocks apart, noise, somebody in the way."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np

from adapt.anatomy import Floats
from adapt.anatomy_file import load_anatomy
from adapt.model.body import pose_skin
from capture.calibration.calibrate import calibrate_recording
from capture.recording import FrameFile, Recording, open_recording
from capture.recording.depth_png import Readings, read_readings, write_readings
from capture.rigid import apply
from capture.simulation.rig import Ints, RigSensor, SensorRig, box_mesh, default_rig
from capture.simulation.simulate import simulate_recording
from track.evaluation.known import CARMINE, KnownRecording, record_known
from track.evaluation.made_up_motions import perform
from track.evaluation.random_bodies import random_body
from track.simulation.performance import Performance

_SECONDS = 3.5
_SEED = 7
HIDDEN_S = (0.75, 2.75)
_SLIDE_S = 0.3  # in which the screens come and go
_SALT = 0.1
_BLOTCH_PX, _HOLES, _RIMS, _RIM_ERROR = 12, 0.2, 0.05, 0.02  # size; shares of all pixels; share of the depth
_SCALE = 1.01
_SWAPPED = 6  # frames apart


@dataclass(frozen=True)
class Limb:
    """Who moves how, and the joint that errors are told of: its flexion and its centre."""

    anatomy: str
    motions: tuple[str, ...]
    flexion: str
    centre: str


LIMBS = {
    "arm": Limb("upper-limb-right", ("bend-and-twist",), "elbow_flexion", "elbow"),
    "leg": Limb("lower-limb-right", ("walk",), "knee_angle_r", "knee"),
}


@dataclass(frozen=True, eq=False)
class Scene:
    """A recording without a fault, and what it takes to record it again."""

    known: KnownRecording
    performance: Performance
    rig: SensorRig = field(repr=False)
    points: Floats = field(repr=False)  # (N, 3), all places of the skin

    def with_frames(self, frames: Mapping[str, Sequence[FrameFile]]) -> Recording:
        """The recording with other frames for some sensors."""
        recording = self.known.recording
        sensors = [replace(s, frames=tuple(frames.get(s.name, s.frames))) for s in recording.sensors]
        return replace(recording, sensors=tuple(sensors))


def make_scene(limb: Limb, folder: Path) -> Scene:
    """A random person's limb that moves, recorded without a fault."""
    body = random_body(load_anatomy(limb.anatomy), _SEED)
    performance = perform(body, limb.motions, seconds_each=_SECONDS, seed=_SEED)
    points = np.concatenate([pose_skin(body, theta) for theta in performance.thetas[::3]])
    rig = default_rig(points, seed=_SEED)
    return Scene(record_known(performance, folder, rig=rig, seed=_SEED), performance, rig, points)


def _no_fault(scene: Scene, folder: Path) -> Recording:
    return scene.known.recording


def _dropped(share: float) -> Callable[[Scene, Path], Recording]:
    def fault(scene: Scene, folder: Path) -> Recording:
        rng = np.random.default_rng(_SEED)
        frames = {}
        for sensor in scene.known.recording.sensors:
            kept = rng.random(len(sensor.frames)) >= share
            frames[sensor.name] = [frame for frame, keep in zip(sensor.frames, kept, strict=True) if keep]
        return scene.with_frames(frames)

    return fault


def _sensor_dies(scene: Scene, folder: Path) -> Recording:
    dying = scene.known.recording.sensors[0]
    return scene.with_frames({dying.name: dying.frames[: len(dying.frames) // 2]})


def _swapped(scene: Scene, folder: Path) -> Recording:
    copy = folder / "recording"
    shutil.copytree(scene.known.recording.path, copy, dirs_exist_ok=True)
    listed = copy / scene.known.recording.sensors[0].name / "frames.csv"
    lines = listed.read_text(encoding="utf-8").split("\n")
    middle = len(lines) // 2
    lines[middle], lines[middle + 1] = lines[middle + 1], lines[middle]
    listed.write_text("\n".join(lines), encoding="utf-8")
    return open_recording(copy)


def _images_swapped(scene: Scene, folder: Path) -> Recording:
    """Two images of one sensor under each other's times, a fifth of a second apart."""
    one, *_ = scene.known.recording.sensors
    frames, middle = list(one.frames), len(one.frames) // 2
    a, b = frames[middle], frames[middle + _SWAPPED]
    frames[middle], frames[middle + _SWAPPED] = replace(a, path=b.path), replace(b, path=a.path)
    return scene.with_frames({one.name: frames})


def _clock_off(seconds: float) -> Callable[[Scene, Path], Recording]:
    """The second sensor sees the limb so much later than its clock says."""

    def fault(scene: Scene, folder: Path) -> Recording:
        performance, late = scene.performance, scene.rig.sensors[1]
        times = performance.times + seconds
        thetas = np.column_stack([np.interp(times, performance.times, column) for column in performance.thetas.T])
        skins = (pose_skin(performance.body, theta) for theta in thetas)
        recorded = _recorded(scene, folder, skins, performance.body.anatomy.skin_faces, sensors=(late,))
        return scene.with_frames({late.name: recorded.sensor(late.name).frames})

    return fault


def _changed(change: Callable[[Readings, np.random.Generator], Readings]) -> Callable[[Scene, Path], Recording]:
    """Every image of every sensor is changed at random."""

    def fault(scene: Scene, folder: Path) -> Recording:
        rng, frames = np.random.default_rng(_SEED), {}
        for sensor in scene.known.recording.sensors:
            home = folder / sensor.name
            home.mkdir(exist_ok=True)
            frames[sensor.name] = [replace(frame, path=home / frame.path.name) for frame in sensor.frames]
            for clean, changed in zip(sensor.frames, frames[sensor.name], strict=True):
                readings = read_readings(clean.path, width=sensor.camera.width, height=sensor.camera.height)
                write_readings(changed.path, change(readings, rng))
        return scene.with_frames(frames)

    return fault


def _salted(readings: Readings, rng: np.random.Generator) -> Readings:
    """Some pixels read any depth."""
    any_depth = rng.integers(500, 4000, readings.shape, dtype=np.uint16)
    return np.where(rng.random(readings.shape) < _SALT, any_depth, readings)


def _disturbed(readings: Readings, rng: np.random.Generator) -> Readings:
    """Holes, and rims of wrong depth around them, where another projector's dots fall among one's own.

    How large and how many they are is an assumption: blotches of a dozen pixels, elsewhere in every image.
    """
    height, width = readings.shape
    rough = rng.standard_normal((height // _BLOTCH_PX, width // _BLOTCH_PX)).astype(np.float32)
    field = cv2.resize(rough, (width, height), interpolation=cv2.INTER_CUBIC)
    hole, rim = np.quantile(field, [_HOLES, _HOLES + _RIMS])
    wrong = readings * (1.0 + _RIM_ERROR * rng.standard_normal(readings.shape))
    kept = np.where((field < rim) & (readings > 0), np.clip(wrong, 0, 65535), readings)
    return np.where(field < hole, 0, kept).astype(np.uint16)


def _scaled(scene: Scene, folder: Path) -> Recording:
    """All depths are wrong by one factor, those of the box, too."""
    clean = scene.known.recording
    sensors = tuple(replace(sensor, depth_unit_m=_SCALE * sensor.depth_unit_m) for sensor in clean.sensors)
    recording = replace(clean, sensors=sensors)
    return replace(recording, calibration=calibrate_recording(recording))


def _hidden(scene: Scene, folder: Path) -> Recording:
    """A screen slides before the limb, one for each sensor, stays, and slides away."""

    def added(time_s: float) -> Floats:
        inside = min(time_s - HIDDEN_S[0], HIDDEN_S[1] - time_s)
        return np.concatenate([_screen(scene.points, sensor, inside) for sensor in scene.rig.sensors])

    return _with_another_mesh(scene, folder, added, np.concatenate([box_mesh((1, 1, 1))[1] + 8 * k for k in range(2)]))


def _screen(points: Floats, sensor: RigSensor, inside_s: float) -> Floats:
    """The vertices (8, 3) of a screen 45 cm before the limb; a single point while it is away."""
    pose, centre = sensor.world_from_sensor, (points.min(axis=0) + points.max(axis=0)) / 2.0
    distance = float(np.linalg.norm(centre - pose[:3, 3]))
    side = 1.2 * float(np.ptp(points, axis=0).max()) * (distance - 0.45) / distance
    aside = (side + 0.5) * float(np.clip(1.0 - (inside_s + _SLIDE_S) / _SLIDE_S, 0.0, 1.0))
    board = box_mesh((side, side, 0.02) if inside_s > -_SLIDE_S else (0.0, 0.0, 0.0))[0]
    return apply(pose, board + np.array([aside, 0.0, distance - 0.45]))


def _another_person(scene: Scene, folder: Path) -> Recording:
    """Somebody walks past behind the limb, 15 cm away from it."""
    vertices, faces = person()
    low, high = scene.points.min(axis=0), scene.points.max(axis=0)
    start = np.array([low[0] - 0.15 - vertices[:, 0].max(), (low[1] + high[1]) / 2.0, -1.0])

    def added(time_s: float) -> Floats:
        return np.asarray(vertices + start + [0.0, 0.0, 2.0 * time_s / _SECONDS])

    return _with_another_mesh(scene, folder, added, faces)


def person() -> tuple[Floats, Ints]:
    """Vertices (V, 3) m and faces (F, 3) of trunk, head, arms and legs, all ellipsoids, upright about the origin."""
    parts = {  # middle, half axes (m)
        "trunk": ((0.0, 0.15, 0.0), (0.12, 0.32, 0.19)),
        "head": ((0.0, 0.62, 0.0), (0.10, 0.13, 0.09)),
        "arms": ((0.0, 0.05, 0.24), (0.05, 0.36, 0.05)),
        "legs": ((0.0, -0.55, 0.10), (0.08, 0.45, 0.08)),
    }
    middles = [(np.array(middle) * [1, 1, side], axes) for middle, axes in parts.values() for side in (1, -1)]
    ball, faces = _ball()
    vertices = np.concatenate([middle + ball * axes for middle, axes in middles])
    return vertices, np.concatenate([faces + k * len(ball) for k in range(len(middles))])


def _ball(rings: int = 12, sectors: int = 16) -> tuple[Floats, Ints]:
    polar = np.linspace(0.0, np.pi, rings + 1)[:, None]
    turn = 2.0 * np.pi * np.arange(sectors) / sectors
    ball = np.stack(
        np.broadcast_arrays(np.sin(polar) * np.cos(turn), np.cos(polar), np.sin(polar) * np.sin(turn)), axis=-1
    ).reshape(-1, 3)
    ring, sector = (grid.ravel() for grid in np.mgrid[:rings, :sectors])
    a, b = ring * sectors + sector, ring * sectors + (sector + 1) % sectors
    return ball, np.concatenate([np.column_stack([a, b, b + sectors]), np.column_stack([a, b + sectors, a + sectors])])


def _with_another_mesh(scene: Scene, folder: Path, added: Callable[[float], Floats], faces: Ints) -> Recording:
    body, performance = scene.performance.body, scene.performance

    def vertices() -> Iterator[Floats]:
        for time_s, theta in zip(performance.times, performance.thetas, strict=True):
            yield np.concatenate([pose_skin(body, theta), added(time_s)])

    together = np.concatenate([body.anatomy.skin_faces, faces + len(body.anatomy.skin_vertices)])
    recorded = _recorded(scene, folder, vertices(), together, sensors=scene.rig.sensors)
    return scene.with_frames({sensor.name: sensor.frames for sensor in recorded.sensors})


def _recorded(
    scene: Scene, folder: Path, vertices: Iterator[Floats], faces: Ints, *, sensors: tuple[RigSensor, ...]
) -> Recording:
    """Frames of a moving mesh by some of the scene's sensors; a recording that stands there already is used."""
    out, rig, times = folder / "recording", replace(scene.rig, sensors=sensors), scene.performance.times.tolist()
    if not (out / "recording.json").is_file():
        simulate_recording(
            out, vertices, faces, times, rig=rig, noise=CARMINE, seed=_SEED, box_frames=1, overwrite=True
        )
    return open_recording(out)


FAULTS: dict[str, Callable[[Scene, Path], Recording]] = {
    "no fault": _no_fault,
    "10 percent of frames dropped": _dropped(0.1),
    "30 percent of frames dropped": _dropped(0.3),
    "50 percent of frames dropped": _dropped(0.5),
    "one sensor dies half-way": _sensor_dies,
    "hidden for 2 s": _hidden,
    "two frames swapped": _swapped,
    "two images swapped unnoticed": _images_swapped,
    "clocks 10 ms apart": _clock_off(0.010),
    "clocks 20 ms apart": _clock_off(0.020),
    "clocks 50 ms apart": _clock_off(0.050),
    "10 percent salt in the depth": _changed(_salted),
    "sensors disturb each other": _changed(_disturbed),
    "all depths 1 percent too large": _scaled,
    "somebody passes behind": _another_person,
}
