"""What a situation is: something that people bring, made synthetic, and what is asked of the program with it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from capture.recording import Recording

SEEDS = {"tuning": (1, 2), "held": (11, 12)}
"""Bounds were set on the first half of the situations' variants; the page reports the other."""


@dataclass(frozen=True, eq=False)
class Trial:
    """One variant: a recording, the anatomy that the user asks for, and the recording that holds the truth, if any."""

    recording: Recording
    ask: str
    truth: Recording | None


@dataclass(frozen=True)
class Situation:
    """``before`` says what came out at commit b072a01; ``make`` makes the variant of a seed in a folder."""

    name: str
    before: str
    make: Callable[[int, Path], Trial] = field(repr=False)
