"""Legs seen from a walking frame, through the command line: pictures, angles, how far joints lie from motion capture.

    python docs/figures/walker.py RECORDINGS --work WORK --out docs/images

RECORDINGS holds the folder ``gait_legs_walker`` named in docs/real-data.md, which does not ship. Runs that page's
commands (those whose output stands in WORK already are left out), prints its tables and writes its pictures. Takes
minutes.
"""

from __future__ import annotations

import csv
import shlex
from pathlib import Path

import click
import numpy as np
from rich.table import Table
from walker_leg import BOTH, FLOOR_UP, SOURCE, Leg
from walker_pictures import overlay, picture

from adapt.anatomy import Floats
from adapt.model.body import Body, rest_theta
from adapt.model.body import joint_centres as centres_of
from adapt.subject import load_subject
from capture.cloud.fuse import View, fuse
from capture.commands.region_options import as_region
from capture.console import stdout
from capture.files import replaced_when_complete
from capture.projection import project
from capture.recording import instants, open_recording
from track.cli import bonetrack
from track.motion import load_motion
from track.observed_bones import known_thetas

IMPORTING = "--fx 570 --fps 30"
ALONE = {"right": (-0.19, -0.6, 0.6, 0.015, 0.24, 1.7), "left": (0.005, -0.6, 0.6, 0.19, 0.24, 1.7)}
SIDES = {  # the frames that each leg is adapted to, and where it is tracked; the left is not found beside the right
    "right": ("2,10,15,24,36,50", BOTH),
    "left": ("4,14,24,38,48,56", ALONE["left"]),
}
POINTS = {"lower_leg": "knee", "foot": "ankle", "toe": "ball of the foot"}  # of the motion capture: what they are


def commands(recordings: Path, work: Path) -> list[tuple[Path, str]]:
    """What each command writes, and the command."""
    recording = work / "walker"
    todo = [(recording, f"import '{recordings / SOURCE / 'gait_depth'}' {IMPORTING} --out '{recording}'")]
    for side, (frames, tracked) in SIDES.items():
        subject, motion = work / f"walker-{side}.npz", work / f"walker-{side}.motion"
        adapting = f"--anatomy lower-limb-{side} --poses 4 --frames {frames} --region {_numbers(ALONE[side])}"
        todo += [
            (subject, f"adapt '{recording}' {adapting} --out '{subject}'"),
            (
                motion / "motion.npz",
                f"track '{recording}' --subject '{subject}' --region {_numbers(tracked)} --out '{motion}'",
            ),
        ]
    return todo


def _numbers(region: tuple[float, ...]) -> str:
    return " ".join(f"{x:g}" for x in region)


def captured(recordings: Path) -> dict[str, Floats]:
    """The motion capture's pixels (T, 3, 2) of each side: knee, ankle, toe. Its x runs leftwards, its y upwards."""
    with (recordings / SOURCE / "gait_groundtruth_60frames.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {
        side: np.array(
            [
                [(640.0 - float(row[f"{side}_{p}_x"]), 480.0 - float(row[f"{side}_{p}_y"])) for p in POINTS]
                for row in rows
            ]
        )
        for side in SIDES
    }


def compare(legs: list[Leg], pixels: dict[str, Floats], view: View) -> None:
    """Print how far our joints lie from the motion capture's points in the image."""
    table = Table("side", "point", "frames", "apart (px)", "(cm)", "median offset u, v (px)", "without it (px)", "(cm)")
    for leg in legs:
        for j, name in enumerate(POINTS.values()):
            ours, depth = project(view.camera, leg.joints[:, j])
            off, known = ours - pixels[leg.side][:, j], leg.motion.tracked
            cm = 100.0 * depth / view.camera.fx
            bias = np.median(off[known], axis=0)
            apart, left = np.linalg.norm(off, axis=1), np.linalg.norm(off - bias, axis=1)
            table.add_row(
                leg.side,
                name,
                str(int(known.sum())),
                f"{np.median(apart[known]):.0f}",
                f"{np.median((apart * cm)[known]):.1f}",
                f"{bias[0]:+.0f}, {bias[1]:+.0f}",
                f"{np.median(left[known]):.0f}",
                f"{np.median((left * cm)[known]):.1f}",
            )
    stdout.print(table)


def describe(legs: list[Leg]) -> None:
    """Print sizes, what was tracked, which bones showed, and the angles' ranges where they are known."""
    table = Table("what", *(leg.side for leg in legs))
    for joint in legs[0].subject.report["scales"]:
        sizes = [leg.subject.report["scales"][joint] for leg in legs]
        table.add_row(f"scale at the {joint}", *(f"{size['scale']:.2f} ± {size['sd']:.2f}" for size in sizes))
    for first, second in (("hip", "knee"), ("knee", "ankle")):
        table.add_row(f"{first} to {second} (mm)", *(f"{_apart(leg.body, first, second):.0f}" for leg in legs))
    table.add_row("frames tracked", *(f"{leg.motion.tracked.sum()} of {len(leg.motion.times)}" for leg in legs))
    table.add_row("skin to cloud, median (mm)", *(f"{1e3 * np.nanmedian(leg.motion.residuals):.1f}" for leg in legs))
    for bone, _ in enumerate(legs[0].motion.transforms):
        name = list(legs[0].motion.transforms)[bone]
        table.add_row(f"{name} shows in frames", *(str(int(leg.motion.shown[:, bone].sum())) for leg in legs))
    for stem in ("knee_angle", "ankle_angle"):
        cells = []
        for leg in legs:
            angle = _angles(leg, stem)[0]
            few = np.isfinite(angle).sum() < 2
            cells.append("-" if few else f"{np.nanmin(angle):.0f} to {np.nanmax(angle):.0f}")
        table.add_row(f"{stem} where known (deg)", *cells)
    stdout.print(table)


def _apart(body: Body, first: str, second: str) -> float:
    centres = centres_of(body, rest_theta(body))
    return 1e3 * float(np.linalg.norm(centres[first] - centres[second]))


def _angles(leg: Leg, stem: str) -> tuple[Floats, Floats]:
    """A coordinate (T,) in degrees where it is known, and the same with what is guessed."""
    anatomy = leg.body.anatomy
    index = anatomy.coordinate_index(f"{stem}_{leg.side[0]}")
    known = known_thetas(anatomy, leg.motion.thetas, leg.motion.shown)
    return np.rad2deg(known[:, index]), np.rad2deg(leg.motion.thetas[:, index])


def inclination(leg: Leg) -> Floats:
    """The angle (T,) in degrees of the shank with the floor's normal, positive with the knee in front of the ankle."""
    shank = leg.joints[:, 0] - leg.joints[:, 1]
    up, forward = FLOOR_UP, np.cross(FLOOR_UP, np.array([1.0, 0.0, 0.0]))
    forward *= np.sign(forward @ np.array([0.0, 0.0, -1.0]))  # the person walks towards the sensor
    return np.asarray(np.rad2deg(np.arctan2(shank @ forward, shank @ up)))


def plot(legs: list[Leg], path: Path) -> None:
    """Knee, ankle and the shank's inclination over time; what is guessed is dotted."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(3, sharex=True)
    for leg, colour in zip(legs, ("tab:red", "tab:blue"), strict=True):
        times = leg.motion.times
        for panel, stem in zip(axes, ("knee_angle", "ankle_angle"), strict=False):
            known, guessed = _angles(leg, stem)
            panel.plot(times, guessed, ":", color=colour, lw=1.0)
            panel.plot(times, known, color=colour, lw=1.8, label=leg.side)
        axes[2].plot(times, inclination(leg), color=colour, lw=1.8)
    axes[0].set_ylabel("knee flexion (deg)")
    axes[1].set_ylabel("ankle dorsiflexion (deg)")
    axes[2].set_ylabel("shank forward (deg)")
    axes[2].set_xlabel("time at an assumed 30 Hz (s); dotted where a bone of the joint does not show")
    axes[0].legend(loc="upper right", fontsize="small")
    with replaced_when_complete(path) as partial:
        figure.savefig(partial, dpi=80)


@click.command()
@click.argument("recordings", type=click.Path(path_type=Path, exists=True))
@click.option("--work", required=True, type=click.Path(path_type=Path), help="Where recordings and results go.")
@click.option("--out", required=True, type=click.Path(path_type=Path), help="Where pictures go.")
def main(recordings: Path, work: Path, out: Path) -> None:
    """Run the commands, print the tables, write the pictures."""
    work.mkdir(parents=True, exist_ok=True)
    out.mkdir(parents=True, exist_ok=True)
    for result, command in commands(recordings, work):
        stdout.print(f"bonetrack {command}", highlight=False, soft_wrap=True)
        if not result.exists():
            bonetrack.main(shlex.split(command), standalone_mode=False)
    recording = open_recording(work / "walker")
    legs = [
        Leg(side, load_subject(work / f"walker-{side}.npz"), load_motion(work / f"walker-{side}.motion"))
        for side in SIDES
    ]
    pixels = captured(recordings)
    describe(legs)
    compare(legs, pixels, fuse(recording, instants(recording)[0], region=as_region(BOTH)).views[0])
    plot(legs, out / "real-walker-angles.png")
    picture(legs, recording, out / "real-walker.png")
    overlay(legs, pixels, recording, out / "real-walker-joints.png")


if __name__ == "__main__":
    main()
