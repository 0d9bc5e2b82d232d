"""An angle that swings, for motions of limbs that are not our model's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adapt.anatomy import Floats


@dataclass(frozen=True)
class Swing:
    """Degrees: ``middle`` + ``swing`` sin(2 pi (cycles u + phase)) while u runs from 0 to 1."""

    middle: float
    swing: float
    cycles: float
    phase: float = 0.0

    def degrees(self, u: Floats) -> Floats:
        """(T,) for u (T,)."""
        return np.asarray(self.middle + self.swing * np.sin(2.0 * np.pi * (self.cycles * u + self.phase)))


def times_and_phase(seconds: float, fps: float) -> tuple[Floats, Floats]:
    """Times (T,) in seconds, and u (T,) that runs from 0 to 1 meanwhile."""
    count = round(seconds * fps)
    return np.arange(count) / fps, np.arange(count) / count
