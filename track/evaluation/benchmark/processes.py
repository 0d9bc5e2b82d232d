"""Whole commands as a user calls them: how long they take, and the most memory they hold.

Each runs in a process of its own, which tells its memory when it ends. What the system tells the parent (``wait4``)
will not do: on Linux it starts from what the parent held when it made the child.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory, TemporaryFile

from capture.calibration.calibrate import write_calibration
from capture.errors import BonetrackError
from capture.recording import Recording

_COMMAND = """\
import atexit, resource, sys
from pathlib import Path
peak, status = Path(sys.argv.pop(1)), Path("/proc/self/status")
def kib():
    if status.is_file():
        return next(line.split()[1] for line in status.read_text().splitlines() if line.startswith("VmHWM"))
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1024 if sys.platform == "darwin" else 1)
atexit.register(lambda: peak.write_text(str(kib())))
from track.cli import main
main()
"""


class CommandFailed(BonetrackError):
    """A command that was to be measured failed."""


@dataclass(frozen=True)
class Process:
    """A command, the seconds it took from start to end, and the most memory (MiB) that it held."""

    command: str
    seconds: float
    peak_mib: float


def whole_commands(recording: Recording, anatomy: str, *, repeat: int) -> list[Process]:
    """``--help``, ``adapt`` and ``track`` on the recording, and ``demo``: each as a process of its own.

    Raises:
        CommandFailed: one of them did.
    """
    helps = [measured("--help", []) for _ in range(repeat)]
    processes = [sorted(helps, key=lambda process: process.seconds)[repeat // 2]]
    with TemporaryDirectory() as folder:
        copy, subject = Path(folder) / "recording", Path(folder) / "subject.npz"
        shutil.copytree(recording.path, copy)
        if recording.calibration is not None:
            write_calibration(replace(recording, path=copy), recording.calibration)
        processes.append(measured("adapt", [str(copy), "--anatomy", anatomy, "--out", str(subject)]))
        motion = Path(folder) / "motion"
        processes.append(measured("track", [str(copy), "--subject", str(subject), "--out", str(motion)]))
        processes.append(measured("demo", ["--anatomy", anatomy, "--out", str(Path(folder) / "demo")]))
    return processes


def measured(command: str, arguments: Sequence[str]) -> Process:
    """Run ``bonetrack COMMAND ARGUMENTS`` in a process of its own.

    Raises:
        CommandFailed: it ended with an error, whose last line is told.
    """
    with TemporaryDirectory() as folder, TemporaryFile() as said:
        peak = Path(folder) / "peak"
        start = time.perf_counter()
        child = [sys.executable, "-c", _COMMAND, str(peak), command, *arguments]
        failed = subprocess.run(child, stdout=said, stderr=said, check=False).returncode
        seconds = time.perf_counter() - start
        if failed:
            said.seek(0)
            lines = said.read().decode(errors="replace").strip().splitlines()
            raise CommandFailed(f"`bonetrack {command}` failed: {lines[-1] if lines else 'it said nothing'}")
        return Process(command, seconds, float(peak.read_text()) / 2**10)
