"""The stages of an adaptation, and how far it has come by each: what share of the whole each usually takes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

Progress = Callable[[str, float], None]
"""Told in words what is being done, and what share of the whole is done."""


@dataclass(frozen=True)
class Stage:
    """A stage from one share of the whole to another.

    >>> Stage(0.2, 0.6).at(1, 4)
    0.3
    """

    begin: float
    end: float

    def at(self, done: int, total: int) -> float:
        """The share of the whole that is done where so many parts of this stage are."""
        return self.begin + (self.end - self.begin) * done / max(total, 1)


# Measured on the samples of both limbs, roughly, for machines differ.
SEARCH, FIRST_POSES, CHOICE = Stage(0.03, 0.17), Stage(0.17, 0.55), Stage(0.55, 0.65)
SIDE, ROUNDS, FINAL_POSES, CERTAINTY = Stage(0.65, 0.80), Stage(0.80, 0.98), Stage(0.98, 0.99), Stage(0.99, 1.0)
