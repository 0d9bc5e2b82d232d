"""Knee and kneecap over flexion: the spline joints over the published tables.

    python docs/figures/knee.py --out docs/images

Prints the largest differences and how near the control landmarks lie to the femur, and writes ``knee.png`` and
``knee-bones.png``. With ``--anatomy NAME`` joints and bones are a template's, and bodies of other proportions are
compared, too; without, the joints are calibrated here, at the tables' size, on the source's bones (which needs the
``build`` extra).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray
from rich.table import Table
from scipy.spatial.transform import Rotation

from adapt.anatomy import Anatomy, Bone, Coordinate, Frame
from adapt.anatomy_file import load_anatomy
from adapt.model.derivatives import constant_points
from adapt.model.joints import joint_motion
from adapt.template_builder.coupled_joint import CoupledJoint, Guides, child_in_parent, joint_frames, spline_joint
from adapt.template_builder.joint_accuracy import Comparison, compare_with_table, rest_from_table
from adapt.template_builder.knee import KNEE_KNOTS, PATELLA_KNOTS, PATELLAR_FACETS, PATELLOFEMORAL, PLATEAU, WALKER_KNEE
from adapt.template_builder.sources_myosim import SourceBody
from capture.console import stdout
from capture.files import replaced_when_complete
from capture.rigid import apply, inverse
from track.accuracy.mesh_distance import distance_to_mesh
from track.evaluation.bones import FIGURE_7
from track.view.render import BONE, Layer, framing_camera, look_at, render, save_png

Floats = NDArray[np.float64]

REST = np.deg2rad(5.0)


@dataclass(frozen=True)
class Panel:
    """One joint of the figure: its table, and the names of turns (body-fixed, in ``order``) and shifts to draw."""

    joint: str
    child: str
    title: str
    table: CoupledJoint
    guides: Guides
    order: str
    turns: dict[int, str]
    shifts: dict[int, str]


PANELS = (
    Panel(
        "knee",
        "tibia",
        "tibia in femur",
        WALKER_KNEE,
        PLATEAU,
        "XZY",
        {0: "flexion - coordinate", 1: "adduction", 2: "internal rotation"},
        {0: "along the axis of flexion", 1: "upward", 2: "forward"},
    ),
    Panel(
        "patellofemoral",
        "patella",
        "patella in femur",
        PATELLOFEMORAL,
        PATELLAR_FACETS,
        "ZXY",
        {0: "turn about Z"},
        {0: "X (forward)", 1: "Y (upward)"},
    ),
)


def calibrated() -> Anatomy:
    """The joints and the source's bones, without skin or handles, in the femur's OpenSim frame."""
    from adapt.template_builder.sources_myosim import load_skeleton

    source = load_skeleton(("femur_r", "tibia_r", "patella_r")).bodies
    bones = [_bone("femur", source["femur_r"], np.eye(4))]
    joints, landmarks = [], {"knee": np.zeros(3)}
    for panel, knots in zip(PANELS, (KNEE_KNOTS, PATELLA_KNOTS), strict=True):
        joint, controls = spline_joint(
            panel.table,
            panel.guides,
            lambda points: points,
            knots=knots,
            name=panel.joint,
            parent="femur",
            child=panel.child,
            coordinate="knee_angle",
            centre=("knee",),
        )
        joints.append(joint)
        landmarks |= controls
        bones.append(_bone(panel.child, source[f"{panel.child}_r"], child_in_parent(panel.table, REST)))
    nothing = np.zeros((0, 3))
    return Anatomy(
        name="calibrated joints",
        side="right",
        bones=tuple(bones),
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


def _bone(name: str, body: SourceBody, placed: Floats) -> Bone:
    frame = Frame(("knee",), ("knee",), ("knee",), ("knee",), ("knee",))  # nothing here asks for it
    return Bone(name, frame, apply(placed, body.vertices), body.faces, np.zeros((len(body.vertices), 0)))


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


def bent_bones(model: Anatomy, angle: float) -> list[Layer]:
    """The femur at rest, the other bones carried by their joints with the knee at ``angle`` (rad)."""
    theta = np.full(len(model.coordinates), angle)
    p = constant_points(model.landmarks, len(theta))
    femur = model.bone(str(model.joint(PANELS[0].joint).parent))
    layers = [Layer(femur.vertices, femur.faces, BONE)]
    for panel, colour in zip(PANELS, ((0.80, 0.87, 0.96), (0.96, 0.80, 0.70)), strict=True):
        joint = model.joint(panel.joint)
        child = model.bone(joint.child)
        layers.append(
            Layer(apply(joint_motion(model, joint, theta, p, 0).matrix(), child.vertices), child.faces, colour)
        )
    return layers


def control_points(model: Anatomy, panel: Panel) -> Floats:
    """The control landmarks on the joint's surface: a medial and a lateral one a knot."""
    names = [name for frame in model.joint(panel.joint).frames for name in frame.origin]
    return model.landmarks[[model.landmark_index(name) for name in names]]


def picture_bones(model: Anatomy, path: Path) -> None:
    """The knee from its outer side at five flexions, with the control points in blue."""
    marks = np.concatenate([control_points(model, panel) for panel in PANELS])
    middle = marks.mean(axis=0)
    around = middle + np.array([[x, y, 0.0] for x in (-0.09, 0.09) for y in (-0.10, 0.10)])
    eye = look_at(around, np.array([0.15, 0.1, 1.0]), np.array([0.0, 1.0, 0.0]))
    camera = framing_camera(eye, around, width=300, height=330)
    views = []
    for angle in np.deg2rad([0.0, 30.0, 60.0, 90.0, 120.0]):
        layers = [replace(layer, opacity=0.75) for layer in bent_bones(model, angle)]
        views.append(render(layers, eye, camera, points=marks))
    save_png(np.concatenate(views, axis=1), path)


def bodies(model: Anatomy) -> dict[str, Anatomy]:
    """The template and, where it has handles, its landmarks in bodies of other proportions."""
    if not model.handles:
        return {model.name: model}
    others = {kind.name: replace(model, landmarks=kind.body(model).p.value) for kind in FIGURE_7}
    return {model.name: model} | others


def angles_of(panel: Panel) -> Floats:
    """Flexions (T,) in rad from 0 to 120 degrees: every quarter of a degree and the table's knots."""
    return np.union1d(np.linspace(0.0, panel.table.knots[-1], 481), panel.table.knots)


def difference_table(model: Anatomy) -> Table:
    """Largest differences to the tables over flexion, each body at its own size."""
    shown = Table("joint", "body", "size", "origin (mm)", "turn (degrees)", title="Largest difference to the table")
    for panel in PANELS:
        for name, body in bodies(model).items():
            joint = body.joint(panel.joint)
            size = rest_from_table(body, joint, panel.table, panel.guides).scale
            compared = compare_with_table(body, joint, panel.table, panel.guides, angles_of(panel))
            worst = 1e3 * compared.distance.max(), np.rad2deg(compared.turn.max())
            shown.add_row(panel.joint, name, f"{size:.3f}", *(f"{value:.3f}" for value in worst))
    return shown


def distance_table(model: Anatomy) -> Table:
    """How far from the femur's surface the control landmarks lie, at most."""
    shown = Table("joint", "medial points (mm)", "lateral points (mm)", title="Largest distance to the femur")
    for panel in PANELS:
        femur = model.bone(str(model.joint(panel.joint).parent))
        off = 1e3 * distance_to_mesh(control_points(model, panel), femur.vertices, femur.faces)
        shown.add_row(panel.joint, *(f"{value:.1f}" for value in off.reshape(-1, 2).max(axis=0)))
    return shown


@click.command()
@click.option("--anatomy", default=None, help="A template; by default the calibrated joints alone.")
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), default=Path("docs/images"))
def main(anatomy: str | None, out: Path) -> None:
    """Compare, print and draw."""
    model = calibrated() if anatomy is None else load_anatomy(anatomy)
    out.mkdir(parents=True, exist_ok=True)
    found = {
        panel.joint: compare_with_table(model, model.joint(panel.joint), panel.table, panel.guides, angles_of(panel))
        for panel in PANELS
    }
    draw(found, out / "knee.png")
    picture_bones(model, out / "knee-bones.png")
    stdout.print(difference_table(model))
    stdout.print(distance_table(model))


if __name__ == "__main__":
    main()
