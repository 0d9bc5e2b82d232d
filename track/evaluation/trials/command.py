"""The product's commands, run as a user runs them: in a process of their own, judged by what they print."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

_LIMIT_S = 900.0
_PEAK = "most memory, in kB: "
_PROGRAM = f"""import resource, sys
from track.cli import main
try:
    main()
finally:
    print({_PEAK!r} + str(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss), file=sys.stderr)
"""
_DOUBT = ("warning", "cannot tell", "cannot be told", "undecided", "doubtful", "unlikely", "check whether", "not sure")


@dataclass(frozen=True)
class Told:
    """How a command ended (None: not in time), what it printed, and the most memory it took (MB)."""

    code: int | None
    out: str
    err: str
    peak_mb: float = 0.0

    @property
    def refusal(self) -> str:
        """The line in which it refused; empty if it did not."""
        lines = [line.removeprefix("error: ").removeprefix("Error: ") for line in self.err.splitlines() if line.strip()]
        return lines[-1].strip() if self.code and lines else ""

    @property
    def unexplained(self) -> bool:
        """Whether it ended in a way that tells a user nothing."""
        return self.code is None or (self.code != 0 and (not self.refusal or "unexpected " in self.refusal))

    @property
    def doubts(self) -> list[str]:
        """The lines in which a result is called doubtful."""
        lines = (self.out + "\n" + self.err).splitlines()
        return [line.strip() for line in lines if any(word in line.lower() for word in _DOUBT)]


def bonetrack(*arguments: str | Path, limit_s: float = _LIMIT_S) -> Told:
    """Run ``bonetrack ARGUMENTS`` with this Python and this checkout."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(p or os.getcwd() for p in sys.path)}
    command = [sys.executable, "-c", _PROGRAM, *map(str, arguments)]
    try:
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=limit_s, check=False)
    except subprocess.TimeoutExpired:
        return Told(None, "", f"no end after {limit_s:.0f} s")
    lines = done.stderr.splitlines()
    peaks = [float(line.removeprefix(_PEAK)) / 1024.0 for line in lines if line.startswith(_PEAK)]
    err = "\n".join(line for line in lines if not line.startswith(_PEAK))
    return Told(done.returncode, done.stdout, err, max(peaks, default=0.0))
