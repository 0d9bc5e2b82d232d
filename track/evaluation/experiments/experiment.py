"""What an experiment of the evaluation is: cases that are run one by one, and a section of the page made of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

Result = dict[str, Any]
"""Plain JSON."""


@dataclass(frozen=True)
class Experiment:
    """One experiment.

    ``cases`` are names such as "seed 1"; ``run`` takes one, and a folder to work in, and returns plain JSON: each
    is kept in a file of its own, so that a run that was cut short goes on. ``describe`` turns the results by case
    into Markdown below the heading ``title``; the pictures it draws go into the folder it is given, and are named in
    the text relative to ``images``. ``losses`` says in a line each where an aim is missed or a comparison lost.
    """

    name: str
    title: str
    cases: tuple[str, ...]
    run: Callable[[str, Path], Result] = field(repr=False)
    describe: Callable[[Mapping[str, Result], Path], str] = field(repr=False)
    losses: Callable[[Mapping[str, Result]], list[str]] = field(repr=False, default=lambda _: [])


def summary(values: ArrayLike, *, digits: int = 2) -> str:
    """Mean ± SD (maximum) of the finite values, or a dash where there are none."""
    known = np.asarray(values, dtype=np.float64).ravel()
    known = known[np.isfinite(known)]
    if not len(known):
        return "-"
    return f"{known.mean():.{digits}f} ± {known.std():.{digits}f} ({known.max():.{digits}f})"


def markdown_table(rows: list[list[str]]) -> str:
    """A Markdown table; the first row is its header."""
    lines = [rows[0], ["---"] * len(rows[0]), *rows[1:]]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
