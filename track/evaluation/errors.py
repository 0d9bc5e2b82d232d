"""Errors of a motion against the known truth of a simulated recording.

Everything is compared in the truth's world. The recording's common frame (the box's) is carried there by what
its calibration says of the sensors and where the truth says they stood, so an error of the calibration between
sensors counts and the choice of common frame does not.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from adapt.anatomy import Anatomy, Floats
from adapt.model.body import Body, bone_frames, joint_centres, make_body, pose_skin, posed_bones
from adapt.model.pose_space import joint_coordinates, root_joint
from adapt.own_anatomy import KEY, MOST_BYTES, anatomy_kept, is_comparable
from adapt.subject import Subject
from capture.files import UNREADABLE, read_arrays
from capture.own import json_of, replaced_if_own
from capture.recording import Recording, world_from_sensor
from capture.rigid import apply, inverse, log_so3, transform
from track.motion import Motion, MotionError
from track.shown import Bools, centres_known, coordinates_known, skin_shown

_SURFACE_POINTS = 600  # of each surface, whose distance to the true surface is measured
_NEAREST_S = 1e-3

FORMAT = "bonetrack-evaluation"
MARK = json_of(FORMAT)


@dataclass(frozen=True, eq=False)
class Truth:
    """What a simulated recording knows: the body, its poses (T, n) over time (T,), where the sensors stood."""

    body: Body
    times: Floats
    thetas: Floats
    world_from_sensor: dict[str, Floats]


@dataclass(frozen=True)
class ErrorSummary:
    """One kind of error over the frames in which the motion knows what it is an error of.

    ``covered`` is the share of frames whose error is within two of the standard deviations that the motion states,
    None for kinds of error that it states none for.
    """

    name: str
    unit: str
    mean: float
    sd: float
    maximum: float
    rms: float
    covered: float | None


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Errors (T,) by kind, NaN where the frame was not tracked or the motion does not claim to know.

    ``frames`` and ``lost`` count frames; of the ``bones`` in all frames so many are ``claimed``. ``stated`` holds the
    standard deviations (T,) that the motion itself gives, for the kinds that have one.
    """

    errors: dict[str, Floats] = field(repr=False)
    units: dict[str, str] = field(repr=False)
    stated: dict[str, Floats] = field(repr=False)
    frames: int
    lost: int
    bones: int
    claimed: int

    def summaries(self) -> list[ErrorSummary]:
        """Mean, standard deviation, maximum and root mean square of every kind."""
        rows = []
        for name, values in self.errors.items():
            known = values[np.isfinite(values)]
            if len(known):
                rows.append(
                    ErrorSummary(
                        name,
                        self.units[name],
                        float(known.mean()),
                        float(known.std()),
                        float(known.max()),
                        float(np.sqrt((known**2).mean())),
                        self._covered(name),
                    )
                )
        return rows

    def _covered(self, name: str) -> float | None:
        if name not in self.stated:
            return None
        known = np.isfinite(self.errors[name])
        return float((self.errors[name] <= 2.0 * self.stated[name])[known].mean())

    def as_json(self) -> dict[str, Any]:
        """Plain numbers for a file."""
        counts = {name: getattr(self, name) for name in ("frames", "lost", "bones", "claimed")}
        return counts | {"errors": {row.name: _plain(row) for row in self.summaries()}}


def _plain(row: ErrorSummary) -> dict[str, Any]:
    plain = {"unit": row.unit, "mean": row.mean, "sd": row.sd, "max": row.maximum, "rms": row.rms}
    return plain if row.covered is None else plain | {"within_2_sd": row.covered}


_KNOWN = dict.fromkeys(
    ("anatomy", "displacement", "shape", "times_s", "theta", "sensor_names", "world_from_sensor"), 64 << 20
)
"""The arrays of a truth, and the most bytes of each."""
_KNOWN[KEY] = MOST_BYTES


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
        anatomy = anatomy_kept(str(data["anatomy"]), data.get(KEY), where=path)
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


def evaluate_motion(motion: Motion, subject: Subject, recording: Recording) -> Evaluation:
    """Compare a motion of ``subject`` with the truth of its recording.

    Kinds of error: joint centres (mm), coordinates (deg, absolute), the root bone's orientation (deg), bone
    surfaces (mm, distance of tracked points to the true surface), bone points (mm, the same anatomical point),
    skin (mm, distance to the true skin). What the motion does not know is not scored (``track.shown``).

    Raises:
        MotionError: no truth, other anatomies, or no frame at a time of the truth.
    """
    truth = read_truth(recording)
    if not motion.anatomy == truth.body.anatomy.name == subject.anatomy.name:
        raise MotionError(
            f"a motion of {motion.anatomy} by a subject of {subject.anatomy.name}, truth of {truth.body.anatomy.name}",
            remedy="give the subject and recording that the motion was made from",
        )
    if not is_comparable(truth.body.anatomy, subject.anatomy):
        raise MotionError(
            f"its truth is of another {subject.anatomy.name} than the subject: that anatomy's file was changed between",
            where=recording.path,
            remedy="simulate the recording again, or adapt and track again",
        )
    common = world_from_common(recording, truth)
    errors: dict[str, list[float]] = {}
    units: dict[str, str] = {}
    known = _known(subject.anatomy, motion)
    for t, time in enumerate(motion.times):
        nearest = int(np.abs(truth.times - time).argmin())
        if abs(truth.times[nearest] - time) > _NEAREST_S:
            problem = f"no truth at {time:.3f} s"
            raise MotionError(problem, where=recording.path, remedy="give the recording that was tracked")
        if motion.lost[t]:
            for values in errors.values():
                values.append(np.nan)
            continue
        for (name, unit), value in _frame_errors(
            subject.body, motion.thetas[t], motion.shown[t], truth.body, truth.thetas[nearest], common
        ).items():
            units[name] = unit
            errors.setdefault(name, [np.nan] * t).append(value if known[name][t] else np.nan)
    arrays = {name: np.array(values) for name, values in errors.items()}
    stated = {
        f"angle {name}": np.rad2deg(motion.deviations[:, i])
        for i, name in enumerate(motion.coordinates)
        if f"angle {name}" in arrays
    }
    lost, claimed = int((~motion.tracked).sum()), int(motion.shown.sum())
    return Evaluation(arrays, units, stated, len(motion.times), lost, motion.shown.size, claimed)


def _known(anatomy: Anatomy, motion: Motion) -> dict[str, Bools]:
    """In which frames (T,) the motion knows what each kind of error is of."""
    shown = {bone.name: motion.shown[:, k] for k, bone in enumerate(anatomy.bones)}
    names = zip(motion.coordinates, coordinates_known(anatomy, motion.shown).T, strict=True)
    known = {f"centre {name}": there for name, there in centres_known(anatomy, motion.shown).items()}
    known |= {f"angle {name}": there for name, there in names}
    known |= {f"{kind} {name}": there for name, there in shown.items() for kind in ("orientation", "surface", "points")}
    return known | {"skin": motion.tracked}


def _frame_errors(
    body: Body, theta: Floats, shown: Bools, true_body: Body, true_theta: Floats, common: Floats
) -> dict[tuple[str, str], float]:
    errors: dict[tuple[str, str], float] = {}
    true_centres = joint_centres(true_body, true_theta)
    for name, centre in joint_centres(body, theta).items():
        distance = np.linalg.norm(apply(common, centre[None])[0] - true_centres[name])
        errors[f"centre {name}", "mm"] = 1e3 * float(distance)
    errors |= _angle_errors(body.anatomy, theta, true_theta)
    root = root_joint(body.anatomy).child
    turn = common[:3, :3] @ bone_frames(body, theta)[root][:3, :3] @ bone_frames(true_body, true_theta)[root][:3, :3].T
    errors[f"orientation {root}", "deg"] = float(np.rad2deg(np.linalg.norm(log_so3(turn))))
    true_bones = posed_bones(true_body, true_theta)
    for bone in body.anatomy.bones:
        tracked = apply(common, posed_bones(body, theta)[bone.name])
        some = tracked[:: max(1, len(tracked) // _SURFACE_POINTS)]
        errors[f"surface {bone.name}", "mm"] = 1e3 * float(
            distance_to_mesh(some, true_bones[bone.name], bone.faces).mean()
        )
        apart = np.linalg.norm(tracked - true_bones[bone.name], axis=1)
        errors[f"points {bone.name}", "mm"] = 1e3 * float(apart.mean())
    counted = np.flatnonzero((body.anatomy.fit_weight > 0.5) & skin_shown(body, shown))
    counted = counted[:: max(1, len(counted) // _SURFACE_POINTS)]
    skin = apply(common, pose_skin(body, theta, vertices=counted))
    true_skin = pose_skin(true_body, true_theta)
    errors["skin", "mm"] = np.nan
    if len(counted):
        errors["skin", "mm"] = 1e3 * float(distance_to_mesh(skin, true_skin, body.anatomy.skin_faces).mean())
    return errors


def _angle_errors(anatomy: Anatomy, theta: Floats, true_theta: Floats) -> dict[tuple[str, str], float]:
    return {
        (f"angle {anatomy.coordinates[i].name}", "deg"): float(np.rad2deg(abs(theta[i] - true_theta[i])))
        for i in joint_coordinates(anatomy)
    }


def distance_to_mesh(points: Floats, vertices: Floats, faces: NDArray[np.int64]) -> Floats:
    """Distance (N,) in metres from points (N, 3) to the nearest place on a triangle mesh."""
    import igl

    squared, _, _ = igl.point_mesh_squared_distance(
        np.ascontiguousarray(points), np.ascontiguousarray(vertices), np.ascontiguousarray(faces)
    )
    return np.asarray(np.sqrt(squared), dtype=np.float64)


def write_evaluation(evaluation: Evaluation, path: Path) -> None:
    """Write the summary as JSON.

    Raises:
        OutputError: something else than such a file stands there.
    """
    with replaced_if_own(path, MARK) as partial:
        partial.write_text(json.dumps({"format": FORMAT} | evaluation.as_json(), indent=1) + "\n", encoding="utf-8")
