"""Table 1 with the truth known: OpenSim on markers and this tracker on depth, on the same performances."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from adapt.anatomy_file import load_anatomy
from track.evaluation.experiments.experiment import Experiment, Result, markdown_table
from track.evaluation.opensim_ik import ACCURACIES, compare_subject
from track.evaluation.opensim_ik_tables import OURS, comparison_rows, motion_rows

NAME, TITLE = "table-1-opensim", "Table 1: beside OpenSim's inverse kinematics"
LIMBS = {"arm": "upper-limb-right", "leg": "lower-limb-right"}
SEEDS = range(1, 9)
TABLES = {"arm": (), "leg": ("gait_walk_rajagopal.csv", "squats_opencap_s4.csv")}
"""Recorded joint angles that are performed, by name in the folder of motions; the arm's motions are made up."""
_NOISE, _SECONDS = "carmine", 2.0
_COMPARED = ("angle ", "centre ")  # kinds of error that losses tell of


def what_is_missing(motions: Path | None) -> str:
    """What has to be there for this experiment and is not, in words; empty if nothing is missing."""
    if find_spec("opensim") is None:
        return "OpenSim is not installed: pip install 'bonetrack[opensim]'"
    wanted = [name for names in TABLES.values() for name in names]
    if motions is None or not all((motions / name).is_file() for name in wanted):
        return f"no --motions given with {' and '.join(wanted)}"
    return ""


def run(case: str, folder: Path, *, motions: Path) -> Result:
    """Both on one random subject."""
    limb, seed = case.split()[0], int(case.split()[-1])
    tables = [motions / name for name in TABLES[limb]]
    return compare_subject(load_anatomy(LIMBS[limb]), seed, _NOISE, _SECONDS, folder, tables=tables)


def describe(results: Mapping[str, Result], images: Path) -> str:
    """Tables for each limb."""
    return f"""Random subjects with soft tissue, two Carmine sensors, everything automatic on our side; OpenSim 4.6 on
virtual markers of the same moving skin, with 0.5 mm of noise, in three laboratories: *scaled* by a static trial with
markers exactly in place, *misplaced* the same with markers stuck on 5 mm off, *true* with the true body's own model.
The arm's motions are made up, {_SECONDS:g} s each; the leg walks and squats as recorded ({", ".join(TABLES["leg"])}).
Errors are against the truth, mean ± SD (maximum) over the frames that we tracked of all subjects; the last column is
how far the two tools are apart, as in the paper. What is fair and what is not is said in [OpenSim](opensim.md).

{"".join(_limb(name, [r for c, r in results.items() if c.split()[0] == name]) for name in LIMBS).strip()}
"""


def _limb(name: str, results: list[Result]) -> str:
    if not results:
        return ""
    seeds = ", ".join(str(result["seed"]) for result in results)
    by_motion = f"{markdown_table(motion_rows(results))}\n\n" if results[0]["by_motion"] else ""
    return f"### {name.capitalize()}, seeds {seeds}\n\n{markdown_table(comparison_rows(results))}\n\n{by_motion}"


def losses(results: Mapping[str, Result]) -> list[str]:
    """The angles and joint centres that OpenSim, at its default accuracy, knows better in the mean."""
    lines = []
    for limb in LIMBS:
        of_limb = [result for case, result in results.items() if case.split()[0] == limb]
        tools = [tool for tool in of_limb[0]["errors"] if tool.endswith(f"{ACCURACIES[0]:g}")] if of_limb else []
        for tool in tools:
            better = [kind for kind in of_limb[0]["errors"][OURS] if kind.startswith(_COMPARED)]
            better = [kind for kind in better if _mean(of_limb, tool, kind) < _mean(of_limb, OURS, kind)]
            told = [
                f"{kind} ({_mean(of_limb, tool, kind):.2f}, ours {_mean(of_limb, OURS, kind):.2f})" for kind in better
            ]
            lines += [f"{limb}, {tool} errs less in {', '.join(told)}"] if told else []
    return lines


def _mean(results: list[Result], tool: str, kind: str) -> float:
    """Over all frames of all subjects."""
    means = [result["errors"][tool][kind]["mean"] for result in results]
    return float(np.average(means, weights=[result["frames"] - result["lost"] for result in results]))


def experiment(motions: Path) -> Experiment:
    """The experiment with recorded motions from a folder."""
    cases = tuple(f"{limb} seed {seed}" for seed in SEEDS for limb in LIMBS)
    return Experiment(NAME, TITLE, cases, partial(run, motions=motions), describe, losses)
