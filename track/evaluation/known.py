"""A simulated recording whose truth is carried into the frame that its calibration found: where experiments start."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from adapt.anatomy import Anatomy, Floats, Ints
from adapt.match.correspondences import Target
from adapt.model.body import Body, joint_centres
from adapt.model.pose_space import moved_rigidly
from capture.calibration.calibrate import calibrate_recording, write_calibration
from capture.cloud.fuse import Region, fuse, region_of_interest
from capture.recording import Calibration, Recording, instants, open_recording
from capture.rigid import inverse
from capture.simulation.rig import SensorRig, default_rig
from capture.simulation.sensor import NoiseModel, carmine
from capture.simulation.simulate import simulate_recording
from track.accuracy.truth import read_truth, world_from_common, world_of_sensors
from track.evaluation.things import Thing, simulate_with_things
from track.simulation.performance import Performance

CARMINE = carmine()


@dataclass(frozen=True, eq=False)
class KnownRecording:
    """A calibrated recording, who moves in it, and how: poses (T, n) in the recording's common frame."""

    recording: Recording
    body: Body
    thetas: Floats = field(repr=False)

    @cached_property
    def region(self) -> Region:
        """The automatic region of interest."""
        return region_of_interest(self.recording)

    def targets(self, frames: list[int]) -> list[Target]:
        """The clouds of some frames."""
        moments = instants(self.recording)
        return [Target(fuse(self.recording, moments[frame], region=self.region)) for frame in frames]


def record_known(
    performance: Performance,
    out: Path,
    *,
    noise: NoiseModel | None = CARMINE,
    rig: SensorRig | None = None,
    things: Sequence[Thing] = (),
    calibration: Calibration | None = None,
    seed: int = 0,
) -> KnownRecording:
    """Simulate a performance with ``things`` besides, calibrate by the box, and carry the truth into the common frame.

    A recording that stands there already is used as it is. A ``calibration`` is taken instead of the box's.
    """
    if not (out / "truth.npz").is_file():
        simulate_with_things(performance, out, things, noise=noise, rig=rig, seed=seed)
    recording = open_recording(out)
    if recording.calibration is None:
        write_calibration(recording, calibration or calibrate_recording(recording))
        recording = open_recording(out)
    truth = read_truth(recording)
    common_from_world = inverse(world_from_common(recording, truth))
    return KnownRecording(recording, truth.body, carried(truth.body.anatomy, truth.thetas, common_from_world))


def record_meshes(
    frames: Iterable[Floats], faces: Ints, times: Sequence[float], out: Path, *, points: Floats, seed: int
) -> tuple[Recording, Floats]:
    """The calibrated recording of any moving mesh by two Carmine sensors, and where its common frame is (4, 4).

    The sensors are placed around ``points`` (N, 3). A recording that stands there already is used as it is.
    """
    if not (out / "truth.npz").is_file():
        rig = default_rig(points, seed=seed)
        simulate_recording(out, frames, faces, times, rig=rig, noise=CARMINE, seed=seed, overwrite=True)
    recording = open_recording(out)
    if recording.calibration is None:
        write_calibration(recording, calibrate_recording(recording))
        recording = open_recording(out)
    with np.load(out / "truth.npz", allow_pickle=False) as truth:
        sensors = dict(zip(truth["sensor_names"].tolist(), truth["world_from_sensor"], strict=True))
    return recording, world_of_sensors(recording, sensors)


def carried(anatomy: Anatomy, thetas: Floats, to_from: Floats) -> Floats:
    """Poses (T, n) as another frame (4, 4) sees them."""
    return np.array([moved_rigidly(anatomy, theta, to_from) for theta in thetas])


def centre_errors(body: Body, thetas: Floats, true_body: Body, true_thetas: Floats) -> dict[str, Floats]:
    """Distances (T,) in metres between the joint centres of two bodies, pose by pose in one frame."""
    pairs = [
        (joint_centres(body, theta), joint_centres(true_body, true))
        for theta, true in zip(thetas, true_thetas, strict=True)
    ]
    return {name: np.array([np.linalg.norm(a[name] - b[name]) for a, b in pairs]) for name in pairs[0][0]}
