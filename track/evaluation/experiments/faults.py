"""What becomes of tracking when the recording is faulty: frames missing, a sensor dead, the limb hidden, clocks apart.

One arm and one leg. The body is adapted once, to the recording without a fault; each fault is then made of that
recording, or recorded again, and tracked by itself. All options are the program's own, the region of interest too.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from adapt.adapt_recording import adapt_recording
from adapt.subject import Subject, load_subject, save_subject
from capture.errors import BonetrackError
from track.accuracy.errors import Evaluation, evaluate_motion
from track.evaluation.experiments.experiment import Experiment, Result, markdown_table, summary
from track.evaluation.experiments.faulty_recordings import _SECONDS, FAULTS, HIDDEN_S, LIMBS, Limb, Scene, make_scene
from track.motion import Motion
from track.track_recording import track_recording

_WRONG_DEG = 5.0


def _subject(scene: Scene, file: Path) -> Subject:
    if not file.is_file():
        save_subject(adapt_recording(scene.known.recording, scene.known.body.anatomy), file)
    return load_subject(file)


def run(case: str, folder: Path) -> Result:
    """Track one limb with one fault."""
    name, fault = case.split(" ", 1)
    limb = LIMBS[name]
    scene = make_scene(limb, folder.parent / f"{name}-scene")
    subject = _subject(scene, folder.parent / f"{name}-subject.npz")
    try:
        recording = FAULTS[fault](scene, folder)
        motion = track_recording(recording, subject, folder / "motion")
    except BonetrackError as error:
        return {"refused": error.problem}
    return _scored(limb, motion, evaluate_motion(motion, subject, recording))


def _scored(limb: Limb, motion: Motion, evaluation: Evaluation) -> Result:
    flexion = evaluation.errors[f"angle {limb.flexion}"]
    covered = (motion.times > HIDDEN_S[0]) & (motion.times < HIDDEN_S[1])
    after = motion.times[(motion.times >= HIDDEN_S[1]) & motion.tracked]
    return {
        "frames": evaluation.frames,
        "lost": evaluation.lost,
        "flexion_deg": flexion[np.isfinite(flexion)].tolist(),
        "centre_mm": (centre := evaluation.errors[f"centre {limb.centre}"])[np.isfinite(centre)].tolist(),
        "how": {how: motion.how.count(how) for how in sorted(set(motion.how) - {""})},
        "claimed_while_hidden": int((motion.tracked & covered).sum()),
        "found_after_s": float(after[0] - HIDDEN_S[1]) if len(after) else None,
    }


def describe(results: Mapping[str, Result], images: Path) -> str:
    """One table for each limb."""
    tables = "\n\n".join(_table(name, results) for name in LIMBS if any(c.startswith(name) for c in results))
    return f"""One arm (elbow flexion, elbow centre) and one leg (knee), random bodies with soft tissue, two Carmine
sensors, {_SECONDS:g} s at 30 frames a second. The body is adapted to the recording without a fault. Errors are of the
frames in which the motion claims to know the joint; *wrong* are those among them that err by more than
{_WRONG_DEG:g} degrees. *Backward* frames were tracked back in time from a later one.

Dropped frames are dropped of each sensor by itself, so that some instants have one sensor only. Swapped frames stand in
the list in the wrong order; images swapped unnoticed, of one sensor, have each other's times, 0.2 s apart. Hidden: a
screen slides before the limb, one for each sensor. Salt: a tenth of all pixels read any depth from 0.5 to 4 m. Clocks
apart: the second sensor sees the limb so much later than its time says. Sensors that disturb each other leave holes in
a fifth of each image, blotches elsewhere every time, and depths wrong by 2 % around them. Depths too large: of the box,
too, by which the sensors are calibrated again. Somebody, made of ellipsoids, walks past 15 cm behind.

{tables}
"""


def _table(name: str, results: Mapping[str, Result]) -> str:
    rows = [[name, "frames", "lost", "flexion (deg)", "wrong", "joint centre (mm)", "found by search", "backward"]]
    for case, result in results.items():
        limb, fault = case.split(" ", 1)
        if limb != name:
            continue
        if "refused" in result:
            rows.append([fault, "-", f"refused: {result['refused']}", *["-"] * 5])
            continue
        flexion, how = np.array(result["flexion_deg"]), result["how"]
        told = [summary(flexion), str(int((flexion > _WRONG_DEG).sum())), summary(result["centre_mm"])]
        counts = [str(how.get(way, 0)) for way in ("found", "backward")]
        rows.append([fault, str(result["frames"]), str(result["lost"]), *told, *counts])
    return markdown_table(rows) + _of_hiding(results.get(f"{name} hidden for 2 s"))


def _of_hiding(result: Result | None) -> str:
    if result is None:
        return ""
    found = result["found_after_s"]
    again = "is not found again" if found is None else f"is tracked again {found:.2f} s after the screens begin to go"
    return f"\n\nWhile it is hidden whole, {result['claimed_while_hidden']} frames are claimed; the limb {again}."


EXPERIMENT = Experiment(
    "faults", "Faulty recordings", tuple(f"{limb} {fault}" for limb in LIMBS for fault in FAULTS), run, describe
)
