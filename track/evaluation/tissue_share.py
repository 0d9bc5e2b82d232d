"""How much of its depth soft tissue varies by between people: what tapes around 6,068 people say, and scans of two.

    python -m track.evaluation.tissue_share POPULATION --scan NAME FOLDER HEIGHT_M ...

A person's handles say how long the bones are and how thick the limb is at either end (``adapt.model.handles``); tissue
is what skin does besides. So a girth is looked at between people who are alike in lengths, bony breadths and the girths
next to it: s is its conditional standard deviation in a normal distribution with the population's correlations. A tape
goes once around the limb, so the mean distance of its skin from the bones varies by s / (2 pi). ``adapt.tissue`` says
that skin strays by SHARE times the depth of tissue, as a smooth field, whose mean around the limb varies less than
that; the share at which this mean varies by s / (2 pi) is the one that people ask for.

POPULATION holds ``ansur2_limb_summary.csv`` (means and deviations by sex, mm) and ``ansur2_limb_correlation_SEX.csv``.
A scan is a folder with ``skin.ply`` and ``bones/*.ply`` in metres, y up, cut at a height.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import click
import numpy as np
from scipy.spatial import ConvexHull, cKDTree

from adapt.anatomy import Anatomy, Floats, Ints
from adapt.anatomy_file import load_anatomy
from adapt.model.derivatives import constant_points
from adapt.model.frames import landmark_mean
from adapt.tissue import tissue_depth, tissue_deviation, tissue_field
from capture.console import stdout
from track.evaluation.experiments.experiment import markdown_table

_ARM = ("stature", "acromionradialelength", "radialestylionlength", "handlength")
_LEG = ("stature", "trochanterionheight", "tibialheight", "footlength", "bimalleolarbreadth", "lateralmalleolusheight")
_RING_M, _WIDEST_M = 0.008, 0.14  # half a ring's width; nothing of the limb's own is farther from its axis
_POINTS = 20000  # on each bone's surface


@dataclass(frozen=True)
class Girth:
    """A girth of the survey, where it is on the template, and what the handles know of a person besides.

    ``place`` is the bone and how far down it the tape lies.
    """

    measure: str
    anatomy: str
    place: tuple[str, float]
    given: tuple[str, ...]


_BICEPS, _FOREARM, _WRIST = "bicepscircumferenceflexed", "forearmcircumferenceflexed", "wristcircumference"
_THIGH, _KNEE = "thighcircumference", "lowerthighcircumference"
_CALF, _ANKLE = "calfcircumference", "anklecircumference"
GIRTHS = (
    Girth(_BICEPS, "upper-limb-right", ("humerus", 0.5), (*_ARM, _FOREARM, _WRIST)),
    Girth(_FOREARM, "upper-limb-right", ("ulna", 0.25), (*_ARM, _BICEPS, _WRIST)),
    Girth(_WRIST, "upper-limb-right", ("ulna", 0.95), (*_ARM, _FOREARM)),
    Girth(_THIGH, "lower-limb-right", ("femur", 0.2), (*_LEG, _KNEE)),
    Girth(_KNEE, "lower-limb-right", ("femur", 0.8), (*_LEG, _THIGH, _CALF)),
    Girth(_CALF, "lower-limb-right", ("tibia", 0.3), (*_LEG, _KNEE, _ANKLE)),
    Girth(_ANKLE, "lower-limb-right", ("tibia", 0.9), (*_LEG, _CALF)),
)


@dataclass(frozen=True)
class Population:
    """K measures of people of one sex: deviations (K,) in mm and correlations (K, K)."""

    names: tuple[str, ...]
    deviations: Floats = field(repr=False)
    correlations: Floats = field(repr=False)

    def given(self, measure: str, known: Sequence[str]) -> float:
        """Deviation (mm) of a measure between people who are alike in what is ``known``.

        >>> two = Population(("length", "girth"), np.array([10.0, 20.0]), np.array([[1.0, 0.6], [0.6, 1.0]]))
        >>> two.given("girth", ["length"])
        16.0
        """
        of, by = self.names.index(measure), [self.names.index(name) for name in known]
        across = self.correlations[of, by]
        explained = across @ np.linalg.solve(self.correlations[np.ix_(by, by)], across)
        return float(round(self.deviations[of] * np.sqrt(1.0 - explained), 6))


def read_population(folder: Path, sex: str) -> Population:
    """The survey's people of one sex."""
    _, *rows = _table(folder / f"ansur2_limb_correlation_{sex}.csv")
    deviations = {(row[0], row[1]): float(row[4]) for row in _table(folder / "ansur2_limb_summary.csv")[1:]}
    names = tuple(row[0] for row in rows)
    correlations = np.array([row[1:] for row in rows], dtype=np.float64)
    return Population(names, np.array([deviations[sex, name] for name in names]), correlations)


def _table(path: Path) -> list[list[str]]:
    with path.open(encoding="utf-8") as file:
        return [row for row in csv.reader(file) if not row[0].startswith("#")]


def ring(anatomy: Anatomy, place: tuple[str, float]) -> Ints:
    """The skin's vertices around a bone, some way down it."""
    name, share = place
    bone = next(bone for bone in anatomy.bones if bone.name == name)
    p = constant_points(anatomy.landmarks, 0)
    (top, _), (bottom, _) = (landmark_mean(anatomy, p, ends) for ends in (bone.frame.y_to, bone.frame.y_from))
    length = np.linalg.norm(bottom - top)
    axis = (bottom - top) / length
    height = (anatomy.skin_vertices - top) @ axis
    across = np.linalg.norm(anatomy.skin_vertices - top - np.outer(height, axis), axis=1)
    return np.flatnonzero((np.abs(height - share * length) < _RING_M) & (across < _WIDEST_M))


def varies_around(anatomy: Anatomy, around: Ints) -> float:
    """By how much (m) the mean distance of a ring of skin varies where skin strays by all of its depth."""
    field, depth = tissue_field(anatomy), tissue_depth(anatomy)[around]
    unit = field.modes[around] / tissue_deviation(anatomy)[around, None]
    return float(np.linalg.norm((depth[:, None] * unit).mean(axis=0)))


def shares(populations: dict[str, Population]) -> list[list[str]]:
    """A header, then for each girth what people vary by, and the share at which the field lets it vary by as much."""
    rows = [["girth", "mean depth (mm)", "SD / 2 pi (mm)", "of the depth", "share"]]
    for girth in GIRTHS:
        anatomy = load_anatomy(girth.anatomy)
        around = ring(anatomy, girth.place)
        depth_m, all_of_it_m = float(tissue_depth(anatomy)[around].mean()), varies_around(anatomy, around)
        seen_m = [1e-3 * of.given(girth.measure, girth.given) / (2.0 * np.pi) for of in populations.values()]
        columns = [[1e3 * value, value / depth_m, value / all_of_it_m] for value in seen_m]
        cells = [" and ".join(f"{value:.2f}" for value in column) for column in zip(*columns, strict=True)]
        rows.append([girth.measure, f"{1e3 * depth_m:.0f}", *cells])
    return rows


def scanned(name: str, folder: Path, height_m: float) -> list[str]:
    """What a scan's section shows: its girth (mm), and the mean and the least depth (mm) of tissue around it."""
    import trimesh

    skin = np.asarray(trimesh.load(folder / "skin.ply", process=False).vertices)
    meshes = [trimesh.load(path, process=False) for path in sorted((folder / "bones").glob("*.ply"))]
    bones = np.concatenate([trimesh.sample.sample_surface(mesh, _POINTS, seed=0)[0] for mesh in meshes])
    section = skin[np.abs(skin[:, 1] - height_m) < _RING_M]
    depth = 1e3 * cKDTree(bones).query(section)[0]
    tape = 1e3 * ConvexHull(section[:, [0, 2]]).area
    return [name, f"{height_m:.3f}", f"{tape:.0f}", f"{depth.mean():.0f}", f"{depth.min():.1f}"]


@click.command()
@click.argument("population", type=click.Path(path_type=Path, exists=True))
@click.option(
    "--scan",
    "scans",
    multiple=True,
    type=(str, click.Path(path_type=Path, exists=True), float),
    help="A name, a scan's folder, and a height in m; may be given several times.",
)
def main(population: Path, scans: Sequence[tuple[str, Path, float]]) -> None:
    """Print the share of their depth that tissues vary by."""
    stdout.print(markdown_table(shares({sex: read_population(population, sex) for sex in ("female", "male")})))
    if scans:
        header = ["scan", "height (m)", "girth (mm)", "mean depth (mm)", "least depth (mm)"]
        stdout.print(markdown_table([header, *(scanned(*scan) for scan in scans)]))


if __name__ == "__main__":
    main()
