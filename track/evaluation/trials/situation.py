"""What a situation of the field trials is, and the verdicts on it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

Verdict = Literal[
    "right", "refused", "asked", "said", "shown", "not tried", "overconfident", "WRONG WITHOUT A WORD", "failed"
]
"""How a case came out.

right: the errors are within bounds, and the stated deviations hold; refused: one line, no result; asked: a question
that names what to give; said: a result, and a clear statement that it is doubtful (or deviations that tell it);
shown: a result of a real recording, without a truth, for the eye to judge; not tried: a program is missing;
overconfident: errors within bounds, deviations that do not cover them; WRONG WITHOUT A WORD; failed: an error that
tells nothing, or no end.
"""

SEEDS = {"tuning": (1, 2), "held": (101, 102)}
"""Bounds of the product are set on the variants of the first half only, and the page reports the second."""


SOUND_SEED = 1001
"""The first seed of further sound recordings, of which hardly any may be refused."""


@dataclass(frozen=True)
class Outcome:
    """The verdict on a case, what was said (one line), and the numbers it rests on."""

    verdict: Verdict
    line: str
    numbers: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Situation:
    """One situation: its name, the issue's section, what is tried, what came out before, and how it is run now.

    ``run`` takes a seed and an empty folder. ``controls`` are sound: there only "right" will do.
    """

    name: str
    section: int
    tried: str
    before: str
    run: Callable[[int, Path], Outcome] = field(repr=False)
    control: bool = False

    def good(self, outcome: Outcome) -> bool:
        """Whether an outcome is one that may be."""
        return outcome.verdict in (
            ("right", "said") if self.control else ("right", "refused", "asked", "said", "shown", "not tried")
        )
