"""``python -m track.evaluation.first_pose [--network FILE ...]``: how right the first-pose network is, as a table.

Everything here is synthetic: see ``track.evaluation.first_pose_frames``.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray

from adapt.search.figure.join import Figure, join_views
from adapt.search.figure.names import JOINTS, LIMBS
from adapt.search.figure.network import SHIPPED, FigureNetwork, Network
from adapt.search.figure.sides import side_of_limb
from adapt.search.figure.view import see_figure
from capture.errors import BonetrackError
from track.evaluation.first_pose_frames import (
    CAMERA,
    EASY,
    HARD,
    Frame,
    SensorImage,
    draw_frames,
    draw_limb_images,
    draw_rooms,
)

Floats = NDArray[np.float64]

JUDGED = [
    JOINTS.index(f"{joint}_{side}")
    for joint in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle", "toe")
    for side in "lr"
]
"""The 14 joints that are asked for."""
FRAMES = (("hard, two sensors", HARD, 2), ("hard, one sensor", HARD, 1), ("easy, two sensors", EASY, 2))
_RIGHT_MM = 150.0
_SEED = 9000


@dataclass(frozen=True)
class JointErrors:
    """Of F frames: errors (F, 14) mm as labelled, and (F, 14) with the answer's sides exchanged."""

    errors: Floats
    exchanged: Floats

    def cells(self) -> list[str]:
        """The table's cells: median, within 100 and 150 mm, frames all right, at most 2 wrong, sides exchanged."""
        wrong = (self.errors > _RIGHT_MM).sum(axis=1)
        swapped = np.median(self.exchanged, axis=1) < np.median(self.errors, axis=1)
        within = [np.mean(self.errors < limit) for limit in (100.0, _RIGHT_MM)]
        shares = [*within, np.mean(wrong == 0), np.mean(wrong <= 2), np.mean(swapped)]
        return [f"{np.median(self.errors):.0f} mm", *(f"{100.0 * share:.0f} %" for share in shares)]


def joint_errors(network: Network, frames: list[Frame], sensors: int) -> JointErrors:
    """What the network says of frames, by one or two of their sensors, against the truth."""
    found, exchanged = [], []
    for frame in frames:
        figure = _figure(network, frame.images[:sensors])
        found.append(_errors_mm(figure, frame.joints))
        exchanged.append(_errors_mm(figure.mirrored(), frame.joints))
    return JointErrors(np.array(found), np.array(exchanged))


def _figure(network: Network, images: tuple[SensorImage, ...]) -> Figure:
    views = [see_figure(network, image.depth, CAMERA, (image.parts > 0) & (image.depth > 0.0)) for image in images]
    return join_views(views, [image.world_from_sensor for image in images])


def _errors_mm(figure: Figure, truth: Floats) -> Floats:
    return np.asarray(1e3 * np.linalg.norm(figure.joints[JUDGED] - truth[JUDGED], axis=1))


def limb_cells(network: Network, limb: str, count: int, seed: int) -> list[str]:
    """Of lone limbs: pixels labelled as this limb, sides said wrongly, sides left undecided, by image."""
    kind, side = limb.split("_")
    pixels, sides = [], []
    for image, own in draw_limb_images(seed, count, limb):
        view = see_figure(network, image.depth, CAMERA, image.depth > 0.0, passes=1)
        pixels.append(np.isin(view.parts(CAMERA)[own], LIMBS[limb]).mean())
        sides.append(side_of_limb(view, "arm" if kind == "arm" else "leg").side)
    said = {"l": "left", "r": "right"}[side]
    shares = [np.mean(pixels), np.mean([s not in (None, said) for s in sides]), np.mean([s is None for s in sides])]
    return [f"{100.0 * share:.0f} %" for share in shares]


def claimed_rooms(network: Network, count: int, seed: int) -> float:
    """The share of images without anybody in which a person is claimed."""
    claims = [
        see_figure(network, image.depth, CAMERA, image.depth > 0.0, passes=1).is_person
        for image in draw_rooms(seed, count)
        if (image.depth > 0.0).sum() > 500
    ]
    return float(np.mean(claims))


def report(networks: list[Path], count: int) -> str:
    """The tables, as Markdown."""
    loaded = {f"{path.parent.name}/{path.name}": FigureNetwork(path) for path in networks}
    joints = ["network", "frames", "median", "within 100 mm", "within 150 mm", "all right", "at most 2 wrong"]
    rows = [[*joints, "sides swapped"]]
    for name, difficulty, sensors in FRAMES:
        frames = list(draw_frames(_SEED, count, difficulty))
        rows += [[file, name, *joint_errors(net, frames, sensors).cells()] for file, net in loaded.items()]
    limbs = [["network", "alone in view", "its pixels right", "side wrong", "side undecided"]]
    for limb in LIMBS:
        limbs += [[file, limb, *limb_cells(net, limb, count // 2, _SEED)] for file, net in loaded.items()]
    rooms = [["network", "rooms without anybody taken for a person"]]
    rooms += [[file, f"{100.0 * claimed_rooms(net, count, _SEED):.0f} %"] for file, net in loaded.items()]
    return "\n\n".join(_table(table) for table in (rows, limbs, rooms))


def _table(rows: list[list[str]]) -> str:
    lines = [f"| {' | '.join(row)} |" for row in rows]
    return "\n".join([lines[0], "|---" * len(rows[0]) + "|", *lines[1:]])


@click.command()
@click.option("--network", "networks", type=click.Path(path_type=Path), multiple=True, help="ONNX files to judge.")
@click.option("--frames", default=60, show_default=True, help="How many frames of each kind.")
def main(networks: tuple[Path, ...], frames: int) -> None:
    """Print how right networks for the first pose are, on synthetic frames of people they were not trained on."""
    try:
        click.echo(report(list(networks) or [SHIPPED], frames))
    except BonetrackError as error:
        click.echo(f"error: {error}", err=True)
        sys.exit(1)


if __name__ == "__main__":
    main()
