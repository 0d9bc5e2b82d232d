"""The images of a recording as a user's own program would have kept them: folders of PNG, named by the time."""

from __future__ import annotations

import csv
import re
import shutil
from dataclasses import dataclass
from pathlib import Path

from adapt.anatomy import Floats
from capture.recording import Recording
from tests.command_line import Ran, bonetrack, inside
from tests.known_limb import KnownLimb
from tests.sources import ROOT

_BEGUN_US = 1_700_000_000_000_000
"""When the first image was taken, in microseconds since 1970."""


def write_raw_files(recording: Recording, folder: Path) -> None:
    """A folder of each sensor, left and right, and one of its images of the box beside it."""
    for sensor, name in zip(recording.sensors, ("left", "right"), strict=True):
        for home, frames in ((folder / name, sensor.frames), (folder / f"{name}-box", sensor.box_frames)):
            home.mkdir(parents=True)
            for frame in frames:
                shutil.copy(frame.path, home / f"{_BEGUN_US + round(1e6 * frame.time_s)}.png")


def write_first_poses(path: Path, names: list[str], frames: list[int], thetas: Floats) -> None:
    """First poses (T, n) of some frames, a little off: adapting need not search."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["frame", *names])
        writer.writerows([frame, *(thetas[frame] + 0.01)] for frame in frames)


FRAMES = (0, 3, 6, 9)
"""What a run on the small recording adapts to."""


@dataclass(frozen=True)
class FinishedRun:
    """A folder with raw images (left, right, left-box, right-box), ``rig.toml`` and results, and what the run said."""

    folder: Path
    said: Ran

    @property
    def results(self) -> Path:
        """The folder of results."""
        return self.folder / "results"

    def copy(self, to: Path) -> Path:
        """The folder of results in a copy of all, which a test may change."""
        return shutil.copytree(self.folder, to) / "results"


RUN = ("run", "left", "right", "--out", "results", "--settings", "rig.toml")


def finish_run(limb: KnownLimb, folder: Path) -> FinishedRun:
    """Write raw images and run all steps on them, with the ``rig.toml`` of docs/walks.md.

    First poses stand in ``bonetrack.toml`` before, so that nothing is searched for: that takes a minute and is tested
    elsewhere.
    """
    write_raw_files(limb.recording, folder)
    names = [coordinate.name for coordinate in limb.subject.anatomy.coordinates]
    write_first_poses(folder / "first.csv", names, list(FRAMES), limb.thetas)
    (folder / "results").mkdir()
    frames = ",".join(map(str, FRAMES))
    quick = f'[adapt]\nposes = 4\nframes = "{frames}"\nfirst-poses = "../first.csv"  # saves a search\n'
    (folder / "results" / "bonetrack.toml").write_text(quick, encoding="utf-8")
    rig = re.search(r"```toml\n(.*?)```", (ROOT / "docs" / "walks.md").read_text(encoding="utf-8"), re.DOTALL)
    assert rig is not None
    (folder / "rig.toml").write_text(rig[1], encoding="utf-8")
    with inside(folder):
        return FinishedRun(folder, bonetrack(*RUN))
