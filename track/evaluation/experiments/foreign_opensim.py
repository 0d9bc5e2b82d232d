"""OpenSim's inverse kinematics on markers of people that are not of our model's making, beside ours.

The laboratory's markers sit where our marker set has them on the template's skin, carried by the skin that these bodies
share, each on the nearest vertex, and move with it. OpenSim does as its users do: the generic model (our template) is
scaled to a static trial by marker pairs, its markers are placed, inverse kinematics is solved. Nobody knows the bones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from adapt.anatomy import Floats
from adapt.anatomy_file import load_anatomy
from adapt.model.body import make_body
from capture.errors import BonetrackError
from track.evaluation.experiments.bodies import CASES, SECONDS, adapted, motions_of, recorded
from track.evaluation.experiments.bodies import NAME as BODIES
from track.evaluation.experiments.experiment import Experiment, Result, markdown_table
from track.evaluation.foreign_truth import nearest_body, true_thetas
from track.evaluation.limb_ground import limb_ground
from track.evaluation.made_up_motions import FPS
from track.evaluation.markers import MarkerSet, marker_set, markers_at_rest
from track.evaluation.opensim_tools import replayed, scaled_model, solve_kinematics
from track.evaluation.reconstruction import differences, reconstruction_of_poses
from track.evaluation.rigged_limbs import LIMBS, Motions
from track.evaluation.skin_carried import carrying_weights
from track.evaluation.swing import times_and_phase
from track.export.osim import write_osim
from track.motion import load_motion
from track.track_recording import track_recording

NAME, TITLE = "foreign-opensim", "People that are not of our model's making: beside OpenSim's inverse kinematics"
OURS, THEIRS = "bonetrack", "OpenSim scaled"
_NOISE_M, _ACCURACY, _STATIC_FRAMES, _SEED = 0.0005, 1e-5, 30, 1


def run(case: str, folder: Path, *, data: Path) -> Result:
    """Errors of both against the truth: angles (deg) and joint centres (mm), mean and maximum over frames."""
    moving = motions_of(case, data)
    anatomy, kept = load_anatomy(moving.what.anatomy), folder.parents[1] / BODIES / folder.name
    recording, world = recorded(moving, kept)
    try:
        subject = adapted(recording, anatomy, kept)
        if not (kept / "motion" / "motion.npz").is_file():
            track_recording(recording, subject, kept / "motion")
        motion = load_motion(kept / "motion")
    except BonetrackError as error:
        return {"failed": error.problem}
    markers, times = marker_set(anatomy), times_and_phase(SECONDS, FPS)[0]
    trial, static = marker_trials(moving, markers, np.random.default_rng(_SEED))
    template = make_body(anatomy)
    generic = write_osim(template, folder / "generic", markers=markers_at_rest(template, markers))[0]
    model = scaled_model(generic, static, np.arange(_STATIC_FRAMES) / FPS, markers, folder / "scaled")
    solved = solve_kinematics(model, trial, times, markers, _ACCURACY, folder / "ik")
    body = nearest_body(moving)
    truth = reconstruction_of_poses(body, true_thetas(moving, body), np.eye(4))
    truth = replace(truth, centres={joint: moving.carried(joint, place)[0] for joint, place in moving.true.items()})
    said = {
        OURS: reconstruction_of_poses(subject.body, motion.thetas, world),
        THEIRS: replayed(model, solved.motion, template),
    }
    faces = {bone.name: bone.faces for bone in anatomy.bones}
    scored = {
        tool: replace(of, centres={joint: of.centres[joint] for joint in moving.true}) for tool, of in said.items()
    }
    return {"errors": {tool: _summaries(differences(of, truth, faces), motion.tracked) for tool, of in scored.items()}}


def marker_trials(
    moving: Motions, markers: MarkerSet, rng: np.random.Generator
) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """Markers (T, 3) m of the motion, and of a second at rest, on the skin of somebody's limb, with noise."""
    ground = limb_ground(moving.what.anatomy)
    rest = moving.limb.skin(np.tile(np.eye(4), (len(moving.limb.rig.names), 1, 1))).vertices
    weights = carrying_weights(ground.anatomy.skin_vertices[markers.vertices], ground.body.vertices[ground.carriers])
    stuck = cKDTree(rest).query(weights @ moving.body.vertices[ground.carriers])[1]
    seen = np.array([moving.limb.skin(transforms).vertices[stuck] for transforms in moving.transforms])
    still = np.tile(rest[stuck], (_STATIC_FRAMES, 1, 1))
    trials = [there + _NOISE_M * rng.normal(size=there.shape) for there in (seen, still)]
    moved, resting = ({m.name: t[:, k] for k, m in enumerate(markers.markers)} for t in trials)
    return moved, resting


def _summaries(apart: Mapping[tuple[str, str], Floats], tracked: np.ndarray) -> dict[str, dict[str, float]]:
    """Mean and maximum over the frames that we tracked."""
    kinds = {name: values[tracked] for (name, _), values in apart.items() if name.startswith(("angle ", "centre "))}
    return {name: {"mean": float(values.mean()), "max": float(values.max())} for name, values in kinds.items()}


def describe(results: Mapping[str, Result], images: Path) -> str:
    """Errors of both side by side, limb by limb: the mean over bodies and frames, and the worst body's mean."""
    parts = [_limb(name, {c: r for c, r in results.items() if c.split()[0] == name}) for name in LIMBS]
    return f"""The people of the section before. Virtual markers sit where the marker sets have them, carried by the
skin that these bodies share, and move with the rig's skin, with {1e3 * _NOISE_M:g} mm of noise; none is misplaced, as
hands misplace them. OpenSim's generic model is our template, scaled to a static trial by marker pairs, its markers
placed there, as its users do; neither knows the bones. Absolute errors, zero included, in the frames that we tracked:
the mean over bodies (the worst body).

{"".join(parts).strip()}
"""


def _limb(name: str, results: Mapping[str, Result]) -> str:
    good = [result["errors"] for result in results.values() if "failed" not in result]
    if not good:
        return ""
    rows = [["", OURS, THEIRS, "errs less"]]
    for kind in good[0][OURS]:
        means = {tool: [errors[tool][kind]["mean"] for errors in good] for tool in (OURS, THEIRS)}
        less = min(means, key=lambda tool: float(np.mean(means[tool])))
        rows.append([kind, *(f"{np.mean(values):.1f} ({max(values):.1f})" for values in means.values()), less])
    return f"### {name.capitalize()}, {len(good)} bodies\n\n{markdown_table(rows)}\n\n"


def losses(results: Mapping[str, Result]) -> list[str]:
    """The angles and joint centres that OpenSim knows better in the mean over bodies."""
    lines = []
    for name in LIMBS:
        good = [r["errors"] for c, r in results.items() if c.split()[0] == name and "failed" not in r]
        told = []
        for kind in good[0][OURS] if good else ():
            ours, theirs = (float(np.mean([errors[tool][kind]["mean"] for errors in good])) for tool in (OURS, THEIRS))
            told += [f"{kind} ({theirs:.1f}, ours {ours:.1f})"] if theirs < ours else []
        lines += [f"{name}: OpenSim errs less in {', '.join(told)}"] if told else []
    return lines


def experiment(data: Path) -> Experiment:
    """The experiment on people drawn from the population below ``data``; it has no cases where OpenSim is missing."""
    cases = CASES if find_spec("opensim") is not None else ()
    return Experiment(NAME, TITLE, cases, partial(run, data=data), describe, losses)
