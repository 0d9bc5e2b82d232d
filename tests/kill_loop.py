"""Kill import, adapt and track at random moments, many times, and compare what the same commands end with.

    python -m tests.kill_loop --work DIR --kills 20

Not part of the suite: it takes minutes. Each command is first run undisturbed. Then it is started and killed (SIGKILL)
after a random time, started again in the same place, and so on until it has ended by itself; its files must be the
undisturbed ones, and no others. That is repeated until the command has been killed as often as asked for; then it may
end.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np

from adapt.anatomy_file import load_anatomy
from adapt.subject import save_subject
from capture.console import stdout
from tests.known_limb import ANATOMY, record
from tests.test_cli import write_first_poses
from tests.test_disk import images

FRAMES = (0, 3, 6, 9)
_LONGEST_S = 900.0


@dataclass(frozen=True)
class Command:
    """A command of the program without its ``--out``, and the name of what it makes."""

    name: str
    arguments: tuple[str, ...]
    made: str

    def run(self, folder: Path, *, kill_after_s: float = _LONGEST_S) -> bool:
        """Run it into a folder; whether it ended by itself."""
        program = [sys.executable, "-c", "from track.cli import main; main()", *self.arguments]
        process = subprocess.Popen([*program, "--out", str(folder / self.made)], stdout=subprocess.DEVNULL)
        try:
            code = process.wait(timeout=kill_after_s)
        except subprocess.TimeoutExpired:
            os.kill(process.pid, signal.SIGKILL)
            process.wait()
            return False
        if code and not (folder / self.made / "recording.json").is_file():  # killed when all was done but to end
            raise SystemExit(f"{self.name} failed")
        return True


def commands(work: Path) -> list[Command]:
    """The three commands on a toy: 60 images, and a simulated arm in 12 frames."""
    recording, subject, poses = work / "recording", work / "known.npz", work / "first-poses.csv"
    if not subject.is_file():
        shutil.rmtree(work / "source", ignore_errors=True)
        shutil.rmtree(recording, ignore_errors=True)
        images(work / "source")
        limb = record(load_anatomy(ANATOMY), recording)
        write_first_poses(poses, recording, limb.subject.anatomy, FRAMES)
        save_subject(limb.subject, subject)
    chosen = ("--frames", ",".join(map(str, FRAMES)), "--first-poses", str(poses), "--poses", str(len(FRAMES)))
    return [
        Command("import", ("import", str(work / "source"), "--fx", "300"), "rec"),
        Command("track", ("track", str(recording), "--subject", str(subject)), "motion"),
        Command("adapt", ("adapt", str(recording), "--anatomy", ANATOMY, *chosen), "subject.npz"),
    ]


def difference(one: Path, other: Path) -> str:
    """What differs between two folders, or nothing."""
    names = [{str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()} for folder in (one, other)]
    if names[0] != names[1]:
        return f"files {sorted(names[0] ^ names[1])}"
    for name in sorted(names[0]):
        if name.endswith(".npz"):
            with np.load(one / name) as a, np.load(other / name) as b:
                same = a.files == b.files and all(np.array_equal(a[key], b[key], equal_nan=_real(a[key])) for key in a)
        else:
            same = (one / name).read_bytes() == (other / name).read_bytes()
        if not same:
            return f"contents of {name}"
    return ""


def _real(array: np.ndarray) -> bool:
    return np.issubdtype(array.dtype, np.floating)


@click.command()
@click.option("--work", required=True, type=click.Path(path_type=Path), help="Where everything goes.")
@click.option("--kills", default=20, show_default=True, help="How often to kill each command.")
@click.option("--only", type=click.Choice(["import", "track", "adapt"]), help="One command.")
@click.option("--seed", default=0, show_default=True)
def main(work: Path, kills: int, only: str | None, seed: int) -> None:
    """Kill the commands and say how it went."""
    work.mkdir(parents=True, exist_ok=True)
    rng, failed = np.random.default_rng(seed), False
    for command in commands(work):
        if only not in (None, command.name):
            continue
        undisturbed, disturbed = work / f"{command.name}-undisturbed", work / f"{command.name}-killed"
        shutil.rmtree(undisturbed, ignore_errors=True)
        undisturbed.mkdir()
        began = time.monotonic()
        command.run(undisturbed)
        took_s = time.monotonic() - began
        count = ended = 0
        while count < kills:
            shutil.rmtree(disturbed, ignore_errors=True)
            disturbed.mkdir()
            done = False
            while count < kills and not done:
                done = command.run(disturbed, kill_after_s=took_s * rng.uniform(0.1, 1.1))
                count += not done
            if not done:
                command.run(disturbed)
            ended += 1
            if wrong := difference(undisturbed, disturbed):
                stdout.print(f"{command.name}: after {count} kills the {wrong} differ", highlight=False)
                failed = True
        stdout.print(
            f"{command.name}: killed {count} times in {took_s:.0f} s of work, ended {ended} times, each time "
            f"{'NOT ' if failed else ''}with the undisturbed result",
            highlight=False,
        )
    sys.exit(int(failed))


if __name__ == "__main__":
    main()
