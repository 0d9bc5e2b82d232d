"""Errors of a motion against the known truth of a simulated recording.

Everything is compared in the truth's world. The recording's common frame (the box's) is carried there by what
its calibration says of the sensors and where the truth says they stood, so an error of the calibration between
sensors counts and the choice of common frame does not.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from adapt.anatomy import Anatomy, Floats
from adapt.own_anatomy import is_comparable
from adapt.subject import Subject
from capture.own import json_of, replaced_if_own
from capture.recording import Recording
from track.accuracy.frame_errors import frame_errors
from track.accuracy.truth import read_truth, world_from_common
from track.motion import Motion, MotionError
from track.observed_bones import Bools, centres_known, coordinates_known

_NEAREST_S = 1e-3

FORMAT = "bonetrack-evaluation"
MARK = json_of(FORMAT)


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


def evaluate_motion(motion: Motion, subject: Subject, recording: Recording) -> Evaluation:
    """Compare a motion of ``subject`` with the truth of its recording.

    Kinds of error: joint centres (mm), coordinates (deg, absolute), the root bone's orientation (deg), bone
    surfaces (mm, distance of tracked points to the true surface), bone points (mm, the same anatomical point),
    skin (mm, distance to the true skin). What the motion does not know is not scored (``track.observed_bones``).

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
        for (name, unit), value in frame_errors(
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


def write_evaluation(evaluation: Evaluation, path: Path) -> None:
    """Write the summary as JSON.

    Raises:
        OutputError: something else than such a file stands there.
    """
    with replaced_if_own(path, MARK) as partial:
        partial.write_text(json.dumps({"format": FORMAT} | evaluation.as_json(), indent=1) + "\n", encoding="utf-8")
