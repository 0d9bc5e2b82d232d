"""Real recordings from a folder that is not part of the project: imported as their sources say, nothing else given."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from adapt.subject import load_subject
from capture.cloud.fuse import fuse, region_of_interest
from capture.errors import BonetrackError
from capture.recording import instants, open_recording
from track.evaluation.trials.command import bonetrack
from track.evaluation.trials.fit import refused
from track.evaluation.trials.situation import Outcome, Situation
from track.motion import load_motion
from track.view.pictures import picture_fit

_PICTURES = 4


@dataclass(frozen=True)
class Clip:
    """A clip's folder, what its source says to ``import``, and the limb to ask for."""

    folder: str
    options: tuple[str, ...]
    anatomy: str


CLIPS = {
    "forearm before an SR305, turned": Clip(
        "forearm_sr305/20210326-230536",
        ("--fx", "476.007", "--cx", "313.683", "--cy", "242.755", "--unit-mm", "0.125", "--fps", "1"),
        "upper-limb-right",
    ),
    "forearm before an SR305, upright": Clip(
        "forearm_sr305/20210326-231615",
        ("--fx", "476.007", "--cx", "313.683", "--cy", "242.755", "--unit-mm", "0.125", "--fps", "1"),
        "upper-limb-right",
    ),
    "walking legs, right": Clip("gait_legs_walker/gait_depth", ("--fx", "570"), "lower-limb-right"),
    "walking legs, left": Clip("gait_legs_walker/gait_depth", ("--fx", "570"), "lower-limb-left"),
    "arms before a Kinect": Clip(
        "upperbody_arms_kinect1_skeltrack",
        ("--fx", "585", "--fps", "1", "--format", "raw", "--pattern", "depth-data-*"),
        "upper-limb-right",
    ),
    "person before a D415": Clip(
        "person_d415_single",
        ("--fx", "481.94", "--cx", "315.16", "--cy", "174.97", "--pattern", "0_M11*"),
        "upper-limb-right",
    ),
    "a mug before an Azure Kinect": Clip("k4a_mkv_fixture/recording.mkv", (), "upper-limb-right"),
}


def situations_of(folder: Path | None) -> tuple[list[Situation], str]:
    """A situation for each clip in a folder; none, and why, where there is no such folder."""
    if folder is None:
        return [], "no --real given"
    if not folder.is_dir():
        return [], f"{folder}: no such folder"
    there = {name: clip for name, clip in CLIPS.items() if (folder / clip.folder).exists()}
    missing = sorted(set(CLIPS) - set(there))
    made = [
        Situation(name, 6, f"real: {name}", "not right without a hand", _run(folder, c)) for name, c in there.items()
    ]
    return made, f"not there: {', '.join(missing)}" if missing else ""


def _run(folder: Path, clip: Clip) -> Callable[[int, Path], Outcome]:
    def run(seed: int, work: Path) -> Outcome:
        recording, subject, motion = work / "recording", work / "subject.npz", work / "motion"
        steps: tuple[tuple[str | Path, ...], ...] = (
            ("import", folder / clip.folder, "--out", recording, *clip.options),
            ("adapt", recording, "--anatomy", clip.anatomy, "--out", subject),
            ("track", recording, "--subject", subject, "--out", motion),
        )
        for step in steps:
            told = bonetrack(*step)
            if told.code != 0:
                return refused(told, {"step": str(step[0])})
        pictures = _draw(recording, subject, motion, work)
        found = load_motion(motion)
        line = f"{int(found.tracked.sum())} of {len(found.tracked)} tracked; {pictures} pictures for the eye to judge"
        return Outcome("said" if told.doubts else "shown", line)

    return run


def _draw(recording: Path, subject: Path, motion: Path, work: Path) -> int:
    """Pictures of some tracked frames; how many."""
    opened, found, person = open_recording(recording), load_motion(motion), load_subject(subject)
    moments, tracked = instants(opened), np.flatnonzero(found.tracked)
    some = tracked[np.unique(np.linspace(0, len(tracked) - 1, min(_PICTURES, len(tracked))).astype(int))]
    for number in some:
        try:
            cloud = fuse(opened, moments[number], region=region_of_interest(opened))
        except BonetrackError:
            continue
        to = work / f"fit_{number:04d}.png"
        picture_fit(person.body, found.thetas[number], cloud, to, shown=found.shown[number])
    return len(list(work.glob("fit_*.png")))
