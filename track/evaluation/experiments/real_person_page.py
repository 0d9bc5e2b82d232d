"""What the page says of a real man's limbs in one pose."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from track.evaluation.experiments.experiment import Result, markdown_table, summary
from track.evaluation.experiments.real_limbs import CREDIT, LIMBS, START_DEG, START_M, STARTS

AIM_LENGTH_PERCENT, AIM_AXIS_DEG, AIM_CENTRE_MM, AIM_DEPTH_FREE_MM = 3.0, 3.0, 8.0, 5.0


def describe(results: Mapping[str, Result], images: Path) -> str:
    """A table and a picture for each limb."""
    parts = []
    for name in LIMBS:
        of_limb = {case: result for case, result in results.items() if case.split()[0] == name}
        if of_limb:
            parts.append(f"### {name.capitalize()}\n\n{_table(of_limb)}\n{_figure(name, of_limb, images)}")
    return f"""One man (n = 1: one person, one pose; he stands with a hanging arm and a straight knee): his skin, bones
and landmarks from BodyParts3D. Two Carmine sensors in front of him see his skin for one instant; part of his chest, or
of his hip, belongs to the surface, and flat pieces close its cut. Our template is adapted to that single instant, once
from a size and pose as a hand would give them (the template's landmarks laid on his, the pose then off by up to
{START_DEG:g} degrees and {100 * START_M:g} cm), once from a pose found by search.

His superficial bones lie 10 to 20 mm too deep (his kneecap's front lies 26 mm under his skin), so an error forward or
backward there is as much his as ours: "without depth" leaves that direction out. Landmarks of his bones are good to 2
or 3 mm. Bone surfaces are compared where they lie and after the rigid move that fits best. Aims: lengths within
{AIM_LENGTH_PERCENT:g} %, shafts within {AIM_AXIS_DEG:g} degrees, joint centres within {AIM_CENTRE_MM:g} mm, without
depth {AIM_DEPTH_FREE_MM:g} mm; **bold** where the mean misses them. Numbers are mean ± SD (maximum) over seeds of noise
and of the given pose's error; surfaces and skin are mean / 95 % / maximum.

{chr(10).join(parts)}
"""


def _table(results: Mapping[str, Result]) -> str:
    scores = [result["ways"] for result in results.values()]
    ways = list(scores[0])
    rows = [[f"error ({', '.join(case.split(maxsplit=1)[1] for case in results)})", *ways]]
    measured = {way: [_measures(score[way]) for score in scores] for way in ways}
    for title, (_, aim) in measured[ways[0]][0].items():
        values = [np.array([measures[title][0] for measures in measured[way]]) for way in ways]
        rows.append([title, *(_marked(summary(all_of, digits=1), missed=all_of.mean() > aim) for all_of in values)])
    rows.append(["our skin to his (mm)", *(_joined([score[way]["skin_mm"] for score in scores]) for way in ways)])
    for name, kinds in scores[0][ways[0]]["surfaces"].items():
        for kind in kinds:
            cells = [_joined([score[way]["surfaces"][name][kind] for score in scores]) for way in ways]
            rows.append([f"surface of the {name}, {kind} (mm)", *cells])
    return markdown_table(rows)


def losses(results: Mapping[str, Result]) -> list[str]:
    """The aims that the mean over seeds misses, limb by limb, and by how much."""
    lines = []
    for name in LIMBS:
        scores = [result["ways"] for case, result in results.items() if case.split()[0] == name]
        for way in (f"adapted, {start}" for start in STARTS if scores):
            missed = missed_aims([_measures(score[way]) for score in scores])
            lines += [f"{name}, {way}: {missed}"] if missed else []
    return lines


def missed_aims(measured: Sequence[Mapping[str, tuple[float, float]]]) -> str:
    """In words, which means over several measurements of (value, aim) by title are beyond the aim."""
    means = {title: (float(np.mean([m[title][0] for m in measured])), aim) for title, (_, aim) in measured[0].items()}
    return ", ".join(f"{title} {mean:.1f} (aim {aim:g})" for title, (mean, aim) in means.items() if mean > aim)


def _joined(rows: list[list[float]]) -> str:
    return " / ".join(f"{value:.1f}" for value in np.mean(rows, axis=0))


def _measures(score: Result) -> dict[str, tuple[float, float]]:
    """What was measured, and the aim for it, by title."""
    measures: dict[str, tuple[float, float]] = {}
    for joint, offset in score["centres_mm"].items():
        measures[f"{joint} centre (mm)"] = _size(offset), AIM_CENTRE_MM
        measures[f"{joint} centre without depth (mm)"] = _size(offset[1:]), AIM_DEPTH_FREE_MM
    for name, lengths in score["distances_m"].items():
        measures[f"{name} (%)"] = _percent(*lengths), AIM_LENGTH_PERCENT
    for name, lengths in score["lengths_m"].items():
        measures[f"length of the {name} (%)"] = _percent(*lengths), AIM_LENGTH_PERCENT
        measures[f"shaft of the {name} (deg)"] = score["axes_deg"][name], AIM_AXIS_DEG
    return measures


def _size(offset: Sequence[float]) -> float:
    return float(np.linalg.norm(offset))


def _percent(ours: float, his: float) -> float:
    return 100.0 * abs(ours / his - 1.0)


def _marked(cell: str, *, missed: bool | np.bool_) -> str:
    return f"**{cell}**" if missed else cell


def _figure(name: str, results: Mapping[str, Result], images: Path) -> str:
    drawn = Path(next(iter(results.values()))["picture"])
    if not drawn.is_file():
        return ""
    images.mkdir(parents=True, exist_ok=True)
    shutil.copy(drawn, images / f"real-{name}.png")
    return f"""
![His bones and ours inside his skin](images/real-{name}.png)

His bones (green) and ours (bone) inside his skin, adapted from the given start; from the front, from the right.
{CREDIT}
"""
