"""People drawn from a population: stature, limb lengths and girths that go together as they do in ANSUR II.

A folder (not part of the project) holds the means, standard deviations and correlations that were computed from the US
Army's survey of 2012 (public; 4,082 men, 1,986 women; soldiers, measured over the skin). Lengths are in metres here.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from capture.errors import BonetrackError

FOLDER = "population"
_SEED = 15
_WITHIN = 2.5  # standard deviations: who is farther off in any measure is drawn again


class PopulationError(BonetrackError):
    """The population's tables are missing or not what is expected."""


@dataclass(frozen=True, eq=False)
class Measured:
    """Somebody's sex ("male", "female") and measures (m) by ANSUR's names."""

    name: str
    sex: str
    measures: dict[str, float]


def people(data: Path, names: tuple[str, ...]) -> dict[str, Measured]:
    """Those of ``names``, such as "mean man", "woman 1", "woman 2": a sex's mean, or its draw of that number."""
    return {name: _somebody(data, name) for name in names}


def _somebody(data: Path, name: str) -> Measured:
    which, _, number = name.partition(" ")
    sex = {"man": "male", "woman": "female"}[number if which == "mean" else which]
    measures, mean, sd, correlation = _table(data, sex)
    values = mean
    if which != "mean":
        rng = np.random.default_rng([_SEED, sex == "male", int(number)])
        root = np.linalg.cholesky(correlation + 1e-6 * np.eye(len(mean)))
        z = root @ rng.normal(size=len(mean))
        while np.abs(z).max() > _WITHIN:
            z = root @ rng.normal(size=len(mean))
        values = mean + sd * z
    return Measured(name, sex, {m: 1e-3 * float(v) for m, v in zip(measures, values, strict=True)})


def _table(data: Path, sex: str) -> tuple[list[str], np.ndarray, np.ndarray, np.ndarray]:
    """Measures, their means and standard deviations (mm), and their correlations."""
    folder = data / FOLDER
    try:
        text = (folder / "ansur2_limb_summary.csv").read_text(encoding="utf-8")
        rows = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
        of = {row["measure"]: (float(row["mean"]), float(row["sd"])) for row in rows if row["sex"] == sex}
        table = folder / f"ansur2_limb_correlation_{sex}.csv"
        header, *lines = csv.reader(table.read_text(encoding="utf-8").splitlines())
        together = np.array([[float(value) for value in line[1:]] for line in lines])
    except (OSError, ValueError, KeyError) as error:
        raise PopulationError("has no tables of ANSUR II", where=folder, remedy="name the folder above it") from error
    known = [i for i, name in enumerate(header[1:]) if name != "weightkg"]
    measures = [header[1:][i] for i in known]
    mean, sd = np.array([of[name] for name in measures]).T
    return measures, mean, sd, together[np.ix_(known, known)]
