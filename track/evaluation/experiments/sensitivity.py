"""What errors depend on: sensors, noise, distance, poses, calibration, and things in the way, one at a time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from adapt.adapt_recording import adapt_recording
from adapt.anatomy_file import load_anatomy
from adapt.model.body import joint_centres
from adapt.options import AdaptOptions
from adapt.subject import Subject, load_subject, save_subject
from capture.errors import BonetrackError
from capture.recording import Calibration, Recording
from capture.simulation.rig import SensorRig
from track.accuracy.errors import evaluate_motion
from track.evaluation.experiments.bend_and_twist import errors_by_kind
from track.evaluation.experiments.drawing import new_figure, save_figure
from track.evaluation.experiments.experiment import Experiment, Result, markdown_table, summary
from track.evaluation.known import CARMINE, KnownRecording, record_known
from track.evaluation.made_up_motions import perform
from track.evaluation.random_bodies import random_body
from track.evaluation.things import Thing, ball_in_hand, board
from track.simulation.performance import Performance
from track.simulation.simulate import performance_rig
from track.track_recording import track_recording

_SECONDS = 2.0
_BEFORE_M, _BOARD_M = 0.3, 0.20  # the board stands so far before the joint, towards the first sensor
_BALL_M, _PALM_M = 0.035, 0.015  # radius, and from the knuckles' middle to the palm
_RIGS: dict[int, tuple[float, tuple[float, ...]]] = {
    1: (0.0, (18.0,)),
    2: (80.0, (24.0, 12.0)),
    4: (270.0, (24.0, 12.0, 24.0, 12.0)),
}
"""By number of sensors: the spread about the vertical and the elevations, in degrees."""


@dataclass(frozen=True)
class Limb:
    """What is simulated: an anatomy, a motion, the joint that a board hides, and two coordinates to report."""

    anatomy: str
    motion: str
    hidden: str
    bend: str
    turn: str


LIMBS = {
    "arm": Limb("upper-limb-right", "bend-and-twist", "elbow", "elbow_flexion", "pro_sup"),
    "leg": Limb("lower-limb-right", "walk", "knee", "knee_angle_r", "hip_rotation_r"),
}


@dataclass(frozen=True)
class Condition:
    """One departure from the standard: two Carmine sensors at 1.2 m, six example poses, and nothing in the way."""

    name: str
    sensors: int = 2
    noise: float = 1.0
    distance_m: float = 1.2
    poses: int = 6
    shift_mm: float = 0.0  # added to where the last sensor is believed to stand
    board: bool = False
    ball: bool = False

    @property
    def adapts(self) -> bool:
        """Whether a subject of its own is adapted; otherwise only tracking is concerned, with the standard's."""
        return not (self.shift_mm or self.board or self.ball)

    @property
    def records(self) -> bool:
        """Whether it needs a recording of its own."""
        return replace(self, name="", poses=6, shift_mm=0.0) != replace(STANDARD, name="")


STANDARD = Condition("standard")
CONDITIONS = (
    STANDARD,
    Condition("one sensor", sensors=1),
    Condition("four sensors all round", sensors=4),
    Condition("half the noise", noise=0.5),
    Condition("twice the noise", noise=2.0),
    Condition("four times the noise", noise=4.0),
    Condition("160 cm away", distance_m=1.6),
    Condition("220 cm away", distance_m=2.2),
    Condition("four example poses", poses=4),
    Condition("eight example poses", poses=8),
    Condition("sensor 2 mm off", shift_mm=2.0),
    Condition("sensor 5 mm off", shift_mm=5.0),
    Condition("sensor 10 mm off", shift_mm=10.0),
    Condition("board before the joint", board=True),
    Condition("ball in the hand", ball=True),
)


def case_name(limb: str, condition: Condition, seed: int) -> str:
    """Such as "arm one sensor seed 1"."""
    return f"{limb} {condition.name} seed {seed}"


def case_parts(case: str) -> tuple[str, Condition, int]:
    """The limb, condition and seed that a case names."""
    limb, *name, _, seed = case.split()
    return limb, next(c for c in CONDITIONS if c.name == " ".join(name)), int(seed)


def run(case: str, folder: Path) -> Result:
    """Track one subject under one condition; what stops that is the result, too."""
    limb, condition, seed = case_parts(case)
    home = folder.parent / "standard" / f"{limb}-{seed}"  # what the other conditions share with the standard one
    try:
        standard = _recorded(limb, STANDARD, seed, home)
        box = standard.recording.calibration if condition.noise != STANDARD.noise else None
        known = _recorded(limb, condition, seed, folder, calibration=box) if condition.records else standard
        if condition.adapts:
            subject = _subject(known, condition, home if condition is STANDARD else folder)
        else:
            subject = _subject(standard, STANDARD, home)
        recording = shifted(known.recording, condition.shift_mm, seed)
        motion = track_recording(recording, subject, folder / "motion")
        evaluation = evaluate_motion(motion, subject, recording)
    except BonetrackError as error:
        return {"failed": error.problem}
    return errors_by_kind(evaluation) | {"claimed": evaluation.claimed, "bones": evaluation.bones}


def _subject(known: KnownRecording, condition: Condition, folder: Path) -> Subject:
    """The subject under a condition, adapted if that has not been done yet."""
    path = folder / "subject.npz"
    if not path.is_file():
        save_subject(adapt_recording(known.recording, known.body.anatomy, AdaptOptions(poses=condition.poses)), path)
    return load_subject(path)


def _recorded(
    limb: str, condition: Condition, seed: int, folder: Path, *, calibration: Calibration | None = None
) -> KnownRecording:
    body = random_body(load_anatomy(LIMBS[limb].anatomy), seed)
    performance = perform(body, (LIMBS[limb].motion,), seconds_each=_SECONDS, seed=seed)
    spread, elevations = _RIGS[condition.sensors]
    rig = performance_rig(
        performance, distance_m=condition.distance_m, spread_deg=spread, elevations_deg=elevations, seed=seed
    )
    things = _things(performance, rig, LIMBS[limb], condition)
    noise = CARMINE.scaled(condition.noise)
    out = folder / "recording"
    return record_known(performance, out, noise=noise, rig=rig, things=things, calibration=calibration, seed=seed)


def _things(performance: Performance, rig: SensorRig, limb: Limb, condition: Condition) -> list[Thing]:
    things = []
    if condition.board:
        places = [joint_centres(performance.body, theta)[limb.hidden] for theta in performance.thetas]
        things.append(board(rig.sensors[0], np.mean(places, axis=0), before_m=_BEFORE_M, side_m=_BOARD_M))
    if condition.ball:
        things.append(ball_in_hand(performance.body, radius_m=_BALL_M, gap_m=_PALM_M))
    return things


def shifted(recording: Recording, shift_mm: float, seed: int) -> Recording:
    """The recording with its last sensor believed to stand so far off, in a random direction."""
    if not shift_mm or recording.calibration is None:
        return recording
    direction = np.random.default_rng(seed).normal(size=3)
    name = recording.sensors[-1].name
    sensors = dict(recording.calibration.sensors)
    world_from_sensor = sensors[name].world_from_sensor.copy()
    world_from_sensor[:3, 3] += 1e-3 * shift_mm * direction / np.linalg.norm(direction)
    sensors[name] = replace(sensors[name], world_from_sensor=world_from_sensor)
    return replace(recording, calibration=Calibration(sensors))


def describe(results: Mapping[str, Result], images: Path) -> str:
    """A table for each limb and one chart."""
    groups: dict[str, dict[str, list[Result]]] = {}
    for case, result in results.items():
        limb, condition, _ = case_parts(case)
        groups.setdefault(limb, {}).setdefault(condition.name, []).append(result)
    tables = "\n\n".join(_table(limb, conditions) for limb, conditions in groups.items())
    motions = " or ".join(limb.motion for limb in LIMBS.values())
    name = "sensitivity.png"
    _draw(groups, images / name)
    return f"""One thing at a time is changed about the standard: two Carmine sensors 1.2 m away, or as much
farther as it takes to see the whole limb (so that 160 cm changes nothing for the leg), and 80 degrees apart, six
example poses, all automatic, {_SECONDS:g} s of {motions} at 30 frames a second, random
subjects with soft tissue. The sensors' number, noise and distance and the number of poses change the adaptation as well
as the tracking. A shifted sensor, the board and the ball concern tracking alone here: they use the subject that was
adapted under the standard condition, and say nothing of what they would do to an adaptation. Noise: every error's size
and probability in the sensor's model, in the images of the limb; where the sensors stand is known as well as under the
standard condition (by a box recorded with four times the noise, the program declines to calibrate). Four sensors stand
all round (270 degrees), and do not disturb one another as real ones would. The last sensor's stated position is shifted
in a random direction; the truth is carried along by the mean of the sensors, so half of the shift of one of two sensors
is no error by itself. The board ({100 * _BOARD_M:g} cm square) stands {100 * _BEFORE_M:g} cm before the elbow or knee,
towards the first sensor; the ball ({200 * _BALL_M:g} cm across) lies in the palm. Neither is known to the program.

{tables}

Mean ± SD (maximum) over frames that were tracked, all subjects together. A frame is lost when its pose is given up;
of the bones in the other frames some are not claimed, and those are in no error.
We have no numbers of the paper's to set beside these.

![Errors by condition](images/{name})
"""


def _table(limb: str, conditions: Mapping[str, list[Result]]) -> str:
    bend, turn = LIMBS[limb].bend, LIMBS[limb].turn
    rows = [[limb, "subjects tracked", f"{bend} (deg)", f"{turn} (deg)", "joint centres (mm)", "lost", "bones claimed"]]
    for name, results in conditions.items():
        good = [result for result in results if "failed" not in result]
        problems = {result["failed"] for result in results if "failed" in result}
        row = [name, "; ".join([f"{len(good)} of {len(results)}", *sorted(problems)])]
        if not good:
            rows.append([*row, *["-"] * 5])
            continue
        angles = [summary(np.concatenate([_angles(r, c) for r in good])) for c in (bend, turn)]
        centres = summary(np.concatenate([_centres(r) for r in good]))
        lost, frames = sum(r["lost"] for r in good), sum(r["frames"] for r in good)
        claimed = sum(r["claimed"] for r in good) / sum(r["bones"] for r in good)
        rows.append([*row, *angles, centres, f"{lost} of {frames}", f"{100 * claimed:.0f} %"])
    return markdown_table(rows)


def _angles(result: Result, coordinate: str) -> list[float]:
    """A coordinate's errors (deg) in the frames in which it is known, which may be none."""
    return list(result["errors"].get(f"angle {coordinate}", []))


def _centres(result: Result) -> list[float]:
    """All joints' errors in all frames (mm)."""
    return [value for name, values in result["errors"].items() if name.startswith("centre ") for value in values]


def _draw(groups: Mapping[str, Mapping[str, list[Result]]], path: Path) -> None:
    """A dot for each subject: mean errors, conditions downwards."""
    figure = new_figure(9.0, 4.6)
    angle, centre = figure.subplots(1, 2, sharey=True)
    names = [condition.name for condition in CONDITIONS]
    for k, (limb, conditions) in enumerate(groups.items()):
        for name, results in conditions.items():
            good = [result for result in results if "failed" not in result]
            row = [names.index(name) + 0.2 * k] * len(good)
            label = limb if name == STANDARD.name else None
            known = ([_angles(r, LIMBS[limb].bend) for r in good], [_centres(r) for r in good])
            for axes, errors in zip((angle, centre), known, strict=True):
                means = [np.mean(values) if values else np.nan for values in errors]
                axes.plot(means, row, "o", color=f"C{k}", ms=4, label=label)
    angle.set_yticks(range(len(names)), names, fontsize="small")
    angle.invert_yaxis()
    angle.set(xlabel="elbow or knee flexion, mean error (deg)", xlim=(0.0, None))
    centre.set(xlabel="joint centres, mean error (mm)", xlim=(0.0, None))
    for axes in (angle, centre):
        axes.grid(alpha=0.3)
    centre.legend(fontsize="small")
    save_figure(figure, path)


def _cases() -> tuple[str, ...]:
    """Every condition that makes sense for a limb; a foot holds no ball."""
    return tuple(
        case_name(limb, condition, seed)
        for seed in (1, 2)
        for limb in LIMBS
        for condition in CONDITIONS
        if not (condition.ball and limb == "leg")
    )


EXPERIMENT = Experiment("sensitivity", "What the errors depend on", _cases(), run, describe)
