"""What a simulated recording knows of itself, and where the recording's common frame stands in that truth's world."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from adapt.anatomy import Floats
from adapt.model.body import Body, make_body
from adapt.own_anatomy import DIGEST, KEY, MOST_BYTES, anatomy_kept
from capture.files import UNREADABLE, read_arrays
from capture.recording import Recording, world_from_sensor
from capture.rigid import inverse, transform
from track.motion import MotionError


@dataclass(frozen=True, eq=False)
class Truth:
    """What a simulated recording knows: the body, its poses (T, n) over time (T,), where the sensors stood."""

    body: Body
    times: Floats
    thetas: Floats
    world_from_sensor: dict[str, Floats]


_KNOWN = dict.fromkeys(
    ("anatomy", "displacement", "shape", "times_s", "theta", "sensor_names", "world_from_sensor"), 64 << 20
)
"""The arrays of a truth, and the most bytes of each."""
_KNOWN[KEY] = _KNOWN[DIGEST] = MOST_BYTES


def read_truth(recording: Recording) -> Truth:
    """The truth of a recording that ``bonetrack simulate --anatomy`` made.

    Raises:
        MotionError: there is none.
    """
    path = recording.path / "truth.npz"
    remedy = "only recordings of `bonetrack simulate --anatomy` have it"
    if not path.is_file():
        raise MotionError("has no known truth (truth.npz)", where=recording.path, remedy=remedy)
    try:
        data = read_arrays(path, _KNOWN)
        anatomy = anatomy_kept(str(data["anatomy"]), data, where=path)
        v_hat = anatomy.skin_vertices + data["displacement"]
        sensors = dict(zip(data["sensor_names"].tolist(), data["world_from_sensor"], strict=True))
        return Truth(make_body(anatomy, shape=data["shape"], v_hat=v_hat), data["times_s"], data["theta"], sensors)
    except UNREADABLE as error:
        raise MotionError("does not hold an anatomy's truth", where=path, remedy=remedy) from error


def world_from_common(recording: Recording, truth: Truth) -> Floats:
    """Where the recording's common frame stands in the truth's world (4, 4): the mean over its sensors.

    Raises:
        MotionError: the truth does not know one of the sensors.
    """
    strange = [sensor.name for sensor in recording.sensors if sensor.name not in truth.world_from_sensor]
    if strange:
        problem = f"has a sensor {strange[0]!r} that its truth does not know, only {', '.join(truth.world_from_sensor)}"
        raise MotionError(problem, where=recording.path, remedy="give the recording that the truth was made with")
    return world_of_sensors(recording, truth.world_from_sensor)


def world_of_sensors(recording: Recording, known: Mapping[str, Floats]) -> Floats:
    """The same (4, 4), given where each sensor stands in the world (4, 4)."""
    guesses = np.array([known[s.name] @ inverse(world_from_sensor(recording, s.name)) for s in recording.sensors])
    rotation = Rotation.from_matrix(guesses[:, :3, :3]).mean().as_matrix()
    # The mean is taken where the sensors look, not at the far origin of a frame.
    middle = np.mean([world_from_sensor(recording, s.name) @ [0, 0, 1.2, 1] for s in recording.sensors], axis=0)
    return transform(rotation, (guesses @ middle).mean(axis=0)[:3] - rotation @ middle[:3])
