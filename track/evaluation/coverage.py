"""Do stated standard deviations cover the true errors as often as they claim? Pooled over the runs of the protocol.

    python -m track.evaluation.coverage DIR/carmine-* --picture coverage.png --table coverage.md

Each folder is one subject as ``track.evaluation.protocol`` leaves it: ``recording/`` with its truth, and ``motion/``.
Every coordinate's error in every tracked frame is divided by the deviation stated for it. Were these z-scores standard
normal, 38, 68, 87, 95, 98.8 and 99.7 % would be within 0.5 to 3. Errors hardly change within a subject, so it is the
number of subjects that counts: each weighs the same, and intervals come from drawing subjects anew (a bootstrap).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import click
import numpy as np
from scipy.stats import norm

from adapt.anatomy import Anatomy, Floats
from adapt.model.pose_space import free_coordinates, moved_rigidly
from capture.console import stdout
from capture.errors import BonetrackError
from capture.files import replaced_when_complete
from capture.own import page_of, replaced_if_own
from capture.recording import Recording, open_recording
from capture.rigid import inverse
from track.accuracy.truth import read_truth, world_from_common
from track.motion import Motion, MotionError, load_motion
from track.observed_bones import coordinates_known

WITHIN = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
_DRAWS = 2000
_MORE = np.linspace(0.0, 3.0, 61)


@dataclass(frozen=True, eq=False)
class Scores:
    """T frames of one subject, tracked with nothing guessed: errors (T, n) and what is stated for them, rad or m."""

    anatomy: Anatomy
    errors: Floats = field(repr=False)
    stated: Floats = field(repr=False)

    @property
    def z(self) -> Floats:
        """Errors in stated standard deviations (T, n)."""
        return np.asarray(self.errors / self.stated)


@dataclass(frozen=True)
class Coverage:
    """One coordinate, or all: root mean squares of error and stated deviation in ``unit``, z-scores, shares WITHIN.

    ``spread`` is the z-scores' root mean square (1 where the deviations are right), ``interval`` its 95 % interval by
    subjects, ``lasting`` the share of the squared error that a subject's mean error makes up.
    """

    name: str
    unit: str
    error: float
    stated: float
    spread: float
    interval: tuple[float, float]
    within: tuple[float, ...]
    lasting: float


def score_motion(motion: Motion, recording: Recording) -> Scores:
    """A motion's errors beside what it states, frame by frame.

    Raises:
        MotionError: no truth, or another anatomy's, or no frame in which every coordinate is known.
    """
    truth = read_truth(recording)
    anatomy = truth.body.anatomy
    if motion.anatomy != anatomy.name:
        raise MotionError(
            f"a motion of {motion.anatomy}, truth of {anatomy.name}",
            where=recording.path,
            remedy="give the recording that was tracked",
        )
    frames = np.flatnonzero(motion.tracked & coordinates_known(anatomy, motion.shown).all(axis=1))
    if not len(frames):
        raise MotionError(
            "no frame was tracked with every coordinate known", where=recording.path, remedy="leave this subject out"
        )
    at = np.abs(truth.times[None] - motion.times[frames, None]).argmin(axis=1)
    common_from_world = inverse(world_from_common(recording, truth))
    true = np.array([moved_rigidly(anatomy, theta, common_from_world) for theta in truth.thetas[at]])
    errors = np.array([coordinate_errors(anatomy, *pair) for pair in zip(motion.thetas[frames], true, strict=True)])
    return Scores(anatomy, errors, motion.deviations[frames])


def coverages(subjects: list[Scores]) -> list[Coverage]:
    """One row per coordinate, then one over all of them."""
    anatomy = subjects[0].anatomy
    columns = [np.array([i]) for i in range(len(anatomy.coordinates))]
    rows = [
        _coverage(coordinate.name, *_unit(coordinate.unit), subjects, column)
        for coordinate, column in zip(anatomy.coordinates, columns, strict=True)
    ]
    return [*rows, _coverage("all", "", np.nan, subjects, np.arange(len(columns)))]


def _coverage(name: str, unit: str, scale: float, subjects: list[Scores], columns: np.ndarray) -> Coverage:
    squared = np.array([(s.z[:, columns] ** 2).mean() for s in subjects])
    drawn = np.random.default_rng(0).integers(len(subjects), size=(_DRAWS, len(subjects)))
    low, high = np.quantile(np.sqrt(squared[drawn].mean(axis=1)), [0.025, 0.975])
    lasting = np.array([(s.z[:, columns].mean(axis=0) ** 2).mean() for s in subjects])
    return Coverage(
        name,
        unit,
        scale * _rms([s.errors[:, columns] for s in subjects]),
        scale * _rms([s.stated[:, columns] for s in subjects]),
        float(np.sqrt(squared.mean())),
        (float(low), float(high)),
        tuple(float(share) for share in shares_within(subjects, columns, WITHIN)),
        float(lasting.sum() / squared.sum()),
    )


def shares_within(subjects: list[Scores], columns: np.ndarray, limits: tuple[float, ...] | Floats) -> Floats:
    """The share of errors within so many stated deviations (L,): the subjects' mean."""
    each = [[(np.abs(s.z[:, columns]) <= limit).mean() for limit in limits] for s in subjects]
    return np.asarray(np.mean(each, axis=0))


def _rms(parts: list[Floats]) -> float:
    return float(np.sqrt(np.mean([(part**2).mean() for part in parts])))


def _unit(unit: str) -> tuple[str, float]:
    """The unit for people, and what makes it from the coordinate's."""
    return ("deg", 180.0 / np.pi) if unit == "rad" else ("mm", 1e3)


def coordinate_errors(anatomy: Anatomy, theta: Floats, true: Floats) -> Floats:
    """theta - true (n,), with the true rotation vectors taken as near the tracked ones as turns allow."""
    nearest = true.copy()
    for index in free_coordinates(anatomy):
        vector = true[index[:3]]
        angle = max(float(np.linalg.norm(vector)), 1e-9)
        turns = [vector * (1.0 + 2.0 * np.pi * k / angle) for k in (-1, 0, 1)]
        nearest[index[:3]] = min(turns, key=lambda turn: float(np.linalg.norm(turn - theta[index[:3]])))
    return np.asarray(theta - nearest)


def table_lines(rows: list[Coverage], subjects: int) -> list[str]:
    """The rows as a Markdown table."""
    header = ["coordinate", "unit", "error (RMS)", "stated SD", f"z, RMS of {subjects} subjects (95 %)", "lasting"]
    header += [f"in {limit:g}" for limit in WITHIN]
    lines = [header, ["---"] * len(header)]
    normal = [f"{100 * (2 * norm.cdf(limit) - 1):.0f}" for limit in WITHIN]
    lines.append(["*if all were right*", "", "", "", "1", "", *normal])
    for row in rows:
        sizes = ["", ""] if row.name == "all" else [f"{row.error:.2f}", f"{row.stated:.2f}"]
        spread = f"{row.spread:.2f} ({row.interval[0]:.2f} to {row.interval[1]:.2f})"
        shares = [f"{100 * share:.0f}" for share in row.within]
        lines.append([row.name, row.unit, *sizes, spread, f"{100 * row.lasting:.0f} %", *shares])
    return [f"| {' | '.join(line)} |" for line in lines]


def plot_coverage(groups: dict[str, list[Scores]], path: Path) -> None:
    """A panel per group of subjects: the share of errors within k stated deviations, beside the normal's."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.6 * len(groups), 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, len(groups), sharey=True, squeeze=False)[0]
    for axes, (title, subjects) in zip(panels, groups.items(), strict=True):
        coordinates = subjects[0].anatomy.coordinates
        for i, coordinate in enumerate(coordinates):
            axes.plot(_MORE, 100 * shares_within(subjects, np.array([i]), _MORE), lw=0.9, label=coordinate.name)
        everything = shares_within(subjects, np.arange(len(coordinates)), _MORE)
        axes.plot(_MORE, 100 * everything, color="black", lw=2.2, label="all coordinates")
        axes.plot(_MORE, 100 * (2 * norm.cdf(_MORE) - 1), color="black", ls="--", label="as claimed (normal)")
        axes.set(title=f"{title}, {len(subjects)} subjects", xlabel="stated standard deviations", xlim=(0, 3))
        axes.grid(alpha=0.3)
        axes.legend(fontsize="x-small", loc="lower right")
    panels[0].set(ylabel="errors within (%)", ylim=(0, 101))
    with replaced_when_complete(path) as partial:
        figure.savefig(partial, dpi=100)


@click.command()
@click.argument("folders", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--picture", type=click.Path(path_type=Path), help="Draw the shares into this PNG, a panel per anatomy.")
@click.option("--table", type=click.Path(path_type=Path), help="Write the tables to this Markdown file, too.")
def main(folders: tuple[Path, ...], picture: Path | None, table: Path | None) -> None:
    """Pool the protocol's FOLDERS and tell how often the stated deviations cover the errors."""
    groups: dict[str, list[Scores]] = {}
    try:
        with stdout.status("reading") as status:
            for folder in folders:
                status.update(f"reading {folder}")
                scores = score_motion(load_motion(folder / "motion"), open_recording(folder / "recording"))
                groups.setdefault(scores.anatomy.name, []).append(scores)
    except BonetrackError as error:
        raise click.ClickException(str(error)) from error
    lines = []
    for name, subjects in groups.items():
        lines += [f"### {name}", "", *table_lines(coverages(subjects), len(subjects)), ""]
    stdout.print("\n".join(lines), highlight=False, soft_wrap=True)
    if table is not None:
        text = "\n".join(lines)
        with replaced_if_own(table, page_of(text)) as partial:
            partial.write_text(text, encoding="utf-8")
    if picture is not None:
        plot_coverage(groups, picture)


if __name__ == "__main__":
    main()
