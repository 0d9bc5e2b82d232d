"""Knee and kneecap over flexion: the spline joints over the published tables.

    python docs/figures/knee.py --out docs/images

Prints the largest differences and writes ``knee.png``. With ``--anatomy NAME`` the joints are a template's; without,
they are calibrated here, at the tables' size.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray
from rich.table import Table
from scipy.spatial.transform import Rotation

from adapt.anatomy import Anatomy, Coordinate, load_anatomy
from adapt.build.coupled_joint import CoupledJoint, Guides, joint_frames, spline_joint
from adapt.build.joint_accuracy import Comparison, compare_with_table
from adapt.build.knee import KNEE_KNOTS, PATELLA_KNOTS, PATELLAR_FACETS, PATELLOFEMORAL, PLATEAU, WALKER_KNEE
from capture.console import stdout
from capture.files import replaced_when_complete
from capture.rigid import inverse

Floats = NDArray[np.float64]

REST = np.deg2rad(5.0)


@dataclass(frozen=True)
class Panel:
    """One joint of the figure: its table, and the names of turns (body-fixed, in ``order``) and shifts to draw."""

    joint: str
    title: str
    table: CoupledJoint
    guides: Guides
    order: str
    turns: dict[int, str]
    shifts: dict[int, str]


PANELS = (
    Panel(
        "knee",
        "tibia in femur",
        WALKER_KNEE,
        PLATEAU,
        "XZY",
        {0: "flexion - coordinate", 1: "adduction", 2: "internal rotation"},
        {0: "along the axis of flexion", 1: "upward", 2: "forward"},
    ),
    Panel(
        "patellofemoral",
        "patella in femur",
        PATELLOFEMORAL,
        PATELLAR_FACETS,
        "ZXY",
        {0: "turn about Z"},
        {0: "X (forward)", 1: "Y (upward)"},
    ),
)


def calibrated() -> Anatomy:
    """The joints alone, without bones or skin, in the femur's OpenSim frame."""
    joints, landmarks = [], {"knee": np.zeros(3)}
    for panel, knots in zip(PANELS, (KNEE_KNOTS, PATELLA_KNOTS), strict=True):
        joint, controls = spline_joint(
            panel.table,
            panel.guides,
            lambda points: points,
            knots=knots,
            name=panel.joint,
            parent="femur",
            child=panel.joint,
            coordinate="knee_angle",
            centre=("knee",),
        )
        joints.append(joint)
        landmarks |= controls
    nothing = np.zeros((0, 3))
    return Anatomy(
        name="calibrated joints",
        side="right",
        bones=(),
        joints=tuple(joints),
        coordinates=(Coordinate("knee_angle", "rad", 0.0, KNEE_KNOTS[-1], REST),),
        handles=(),
        deformers=(),
        landmark_names=tuple(landmarks),
        landmarks=np.array(list(landmarks.values())),
        landmark_handle_weights=np.zeros((len(landmarks), 0)),
        skin_vertices=nothing,
        skin_faces=nothing.astype(np.int64),
        skin_handle_weights=nothing,
        deformer_weights=nothing,
        fit_weight=np.zeros(0),
        tetrahedra={},
    )


def curves(panel: Panel, angles: Floats, placed: Floats) -> tuple[Floats, Floats]:
    """Turns (T, 3) in degrees and shifts (T, 3) in mm of the child's joint frame in the parent's."""
    parent, child = joint_frames(panel.table)
    motion = inverse(parent) @ placed @ child
    turns = np.rad2deg(np.unwrap(Rotation.from_matrix(motion[:, :3, :3]).as_euler(panel.order), axis=0))
    if panel.joint == "knee":
        turns[:, 0] -= np.rad2deg(angles)
    return turns, 1e3 * motion[:, :3, 3]


def draw(found: dict[str, Comparison], path: Path) -> None:
    """Left the turns, right the shifts; a row a joint; dots are the tables' knots, lines the spline joints."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(len(PANELS), 2, figsize=(11, 8), layout="constrained")
    for (turns_axis, shifts_axis), panel in zip(axes, PANELS, strict=True):
        compared = found[panel.joint]
        degrees = np.rad2deg(compared.angles)
        ours, table = (curves(panel, compared.angles, placed) for placed in (compared.ours, compared.table))
        knots = np.isin(compared.angles, panel.table.knots)
        for axis, names, part, unit in ((turns_axis, panel.turns, 0, "degrees"), (shifts_axis, panel.shifts, 1, "mm")):
            for k, (column, name) in enumerate(names.items()):
                axis.plot(degrees, ours[part][:, column], color=f"C{k}", label=name)
                axis.plot(degrees[knots], table[part][knots, column], "o", color=f"C{k}", markersize=5, mfc="none")
            axis.set(title=f"{panel.title}: {unit}", xlabel="knee flexion (degrees)", ylabel=unit)
            axis.grid(alpha=0.3)
            axis.legend(title="line: spline joint, o: table", fontsize="small", title_fontsize="small")
    with replaced_when_complete(path) as partial:
        figure.savefig(partial, dpi=110, format="png")
    plt.close(figure)


@click.command()
@click.option("--anatomy", default=None, help="A template; by default the calibrated joints alone.")
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), default=Path("docs/images"))
def main(anatomy: str | None, out: Path) -> None:
    """Compare, print and draw."""
    model = calibrated() if anatomy is None else load_anatomy(anatomy)
    out.mkdir(parents=True, exist_ok=True)
    shown = Table(title=f"{model.name}: largest difference to the table, 0 to 120 degrees")
    for column in ("joint", "origin (mm)", "turn (degrees)"):
        shown.add_column(column)
    found = {}
    for panel in PANELS:
        angles = np.union1d(np.linspace(0.0, panel.table.knots[-1], 481), panel.table.knots)
        compared = compare_with_table(model, model.joint(panel.joint), panel.table, panel.guides, angles)
        found[panel.joint] = compared
        worst = 1e3 * compared.distance.max(), np.rad2deg(compared.turn.max())
        shown.add_row(panel.joint, *(f"{value:.3f}" for value in worst))
    draw(found, out / "knee.png")
    stdout.print(shown)


if __name__ == "__main__":
    main()
