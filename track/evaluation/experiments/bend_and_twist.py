"""Figure 14: an arm that bends and twists, where its elbow and wrist go and how its angles run, against the truth."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from adapt.adapt_recording import adapt_recording
from adapt.anatomy import Anatomy, Floats
from adapt.anatomy_file import load_anatomy
from adapt.options import AdaptOptions
from capture.simulation.sensor import NoiseModel
from track.accuracy.errors import Evaluation, evaluate_motion
from track.accuracy.truth import read_truth, world_from_common
from track.evaluation.experiments.drawing import new_figure, save_figure
from track.evaluation.experiments.experiment import Experiment, Result, markdown_table, summary
from track.evaluation.known import CARMINE, record_known
from track.evaluation.made_up_motions import perform
from track.evaluation.random_bodies import random_body
from track.evaluation.reconstruction import reconstruction_of_poses
from track.observed_bones import known_thetas
from track.options import TrackOptions
from track.track_recording import track_recording

ANATOMY = "upper-limb-right"
NOISES = {"Carmine": CARMINE, "no noise": NoiseModel()}
SEEDS = (1, 2, 3)
_SECONDS = 3.0
_CENTRES = ("elbow", "wrist")
_ANGLES = {"flexion": "elbow_flexion", "rotation": "pro_sup"}
_PAPER = {"angle elbow_flexion": "4.1 ± 3.7", "angle pro_sup": "6.2 ± 4.5"}  # against OpenSim and Vicon


def run(case: str, folder: Path) -> Result:
    """Simulate, calibrate, adapt and track one subject with one kind of noise, all automatic."""
    noise, _, seed = case.partition(" seed ")
    body = random_body(load_anatomy(ANATOMY), int(seed))
    moving = perform(body, ("bend-and-twist",), seconds_each=_SECONDS, seed=int(seed))
    known = record_known(moving, folder / "recording", noise=NOISES[noise], seed=int(seed))
    subject = adapt_recording(known.recording, body.anatomy, AdaptOptions(region=known.region))
    motion = track_recording(known.recording, subject, folder / "motion", TrackOptions(region=known.region))
    truth = read_truth(known.recording)
    common = world_from_common(known.recording, truth)
    thetas = known_thetas(body.anatomy, motion.thetas, motion.shown)
    tracked = {name: motion.centres[name] @ common[:3, :3].T + common[:3, 3] for name in _CENTRES}
    true = reconstruction_of_poses(truth.body, truth.thetas, np.eye(4)).centres
    errors = errors_by_kind(evaluate_motion(motion, subject, known.recording))
    curves = {"tracked": _curves(body.anatomy, tracked, thetas), "true": _curves(body.anatomy, true, truth.thetas)}
    return errors | {"times_s": motion.times.tolist()} | curves


def errors_by_kind(evaluation: Evaluation) -> Result:
    """All errors of a motion, frame by frame where they are known, their units, and how many frames were lost."""
    errors = {name: values[np.isfinite(values)].round(4).tolist() for name, values in evaluation.errors.items()}
    return {"errors": errors, "units": evaluation.units, "lost": evaluation.lost, "frames": evaluation.frames}


def _curves(anatomy: Anatomy, centres: Mapping[str, Floats], thetas: Floats) -> Result:
    """Frontal plane positions (T, 2) mm (to the right, up) and angles (T,) deg; None where not known."""
    angles = {name: np.rad2deg(thetas[:, anatomy.coordinate_index(c)]) for name, c in _ANGLES.items()}
    return {
        "centres": {name: _listed(1e3 * centres[name][:, [2, 1]]) for name in _CENTRES},
        "angles": {name: _listed(values) for name, values in angles.items()},
    }


def _listed(values: Floats) -> list[object]:
    rounded = values.round(3).astype(object)
    rounded[~np.isfinite(values)] = None
    return list(rounded.tolist())


def describe(results: Mapping[str, Result], images: Path) -> str:
    """The table over all subjects, and a picture of the first."""
    columns = {noise: [r for case, r in results.items() if case.startswith(f"{noise} ")] for noise in NOISES}
    columns = {noise: found for noise, found in columns.items() if found}
    first = next(iter(results.values()))
    rows = [["error, mean ± SD (maximum)", *columns, "the paper"]]
    for name in first["errors"]:
        cells = [summary(np.concatenate([r["errors"][name] for r in found])) for found in columns.values()]
        rows.append([f"{name} ({first['units'][name]})", *cells, _PAPER.get(name, "")])
    lost = [f"{sum(r['lost'] for r in found)} of {sum(r['frames'] for r in found)}" for found in columns.values()]
    rows.append(["frames lost", *lost, ""])
    shown = {noise: found[0] for noise, found in columns.items()}
    _draw(shown, images / "figure-14-bend-and-twist.png")
    return f"""Cases: {", ".join(results)}. Random subjects (bone lengths within 8 %, scales within 6 %, soft tissue)
bend and twist the arm for {_SECONDS:g} s at 30 frames a second, before two sensors. All is automatic: calibration
by the box, six example poses, tracking. The same seed is the same subject and motion with and without noise.

{markdown_table(rows)}

The paper's own numbers are differences from OpenSim's inverse kinematics of Vicon markers on a real person, which has
errors of its own; ours are errors against the truth of a simulation, whose joints move as the model's do. The two
columns are therefore not a comparison of methods: what a simulation cannot show (skin that slides, an elbow that is
no perfect hinge) is missing from ours.

![Elbow and wrist in the frontal plane, flexion and rotation over time](images/figure-14-bend-and-twist.png)

Above: the joint centres in the frontal plane of the world in which the subject was simulated; below: the angles. Lines
are the truth, dots what was tracked.
"""


def _draw(results: Mapping[str, Result], path: Path) -> None:
    """A column per kind of noise: trajectories above, angles below."""
    figure = new_figure(5.0 * len(results), 7.4)
    panels = figure.subplots(2, len(results), squeeze=False)
    for column, (noise, result) in enumerate(results.items()):
        plane, angles = panels[:, column]
        for k, name in enumerate(_CENTRES):
            true, tracked = (np.array(result[kind]["centres"][name], dtype=float) for kind in ("true", "tracked"))
            plane.plot(*true.T, color=f"C{k}", lw=1.0, label=f"{name}, true")
            plane.plot(*tracked.T, ".", color=f"C{k}", ms=4, label=f"{name}, tracked")
        for k, name in enumerate(_ANGLES):
            true, tracked = (np.array(result[kind]["angles"][name], dtype=float) for kind in ("true", "tracked"))
            angles.plot(result["times_s"], true, color=f"C{k + 2}", lw=1.0, label=f"{name}, true")
            angles.plot(result["times_s"], tracked, ".", color=f"C{k + 2}", ms=4, label=f"{name}, tracked")
        plane.set(title=noise, xlabel="to the right (mm)", ylabel="up (mm)", aspect="equal")
        angles.set(xlabel="time (s)", ylabel="angle (deg)")
        for axes in (plane, angles):
            axes.grid(alpha=0.3)
            axes.legend(fontsize="small")
    save_figure(figure, path)


EXPERIMENT = Experiment(
    "figure-14-bend-and-twist",
    "Figure 14: bend and twist, with and without noise",
    tuple(f"{noise} seed {seed}" for seed in SEEDS for noise in NOISES),
    run,
    describe,
)
