"""Every simulated recording of the field trials by name: ``make(situation, seed, folder)``."""

from __future__ import annotations

from pathlib import Path

from track.evaluation.trials import people, scenes, sensors
from track.evaluation.trials.recorded import Made

MAKERS = people.MAKERS | scenes.MAKERS | sensors.MAKERS


def make(situation: str, seed: int, folder: Path) -> Made:
    """Simulate a situation, a name of ``MAKERS``, into ``folder``: who moves, how and in what noise hangs on the seed.

    The recording is not calibrated. Give sound people, of whom at most 1 in 50 may be refused, by
    ``people.sound(anatomy)(seed, folder)``.
    """
    return MAKERS[situation](seed, folder)
