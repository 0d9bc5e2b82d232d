"""``python -m track.evaluation.first_pose_pictures RECORDINGS OUT``: the network's answers drawn on real depth stills.

Nobody knows the truth of these; the pictures are for looking at. RECORDINGS holds ``upperbody_arms_kinect1_skeltrack``
and ``person_d415_single``; neither ships, and no picture of them may.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import click
import cv2
import numpy as np
from numpy.typing import NDArray

from adapt.search.figure.names import JOINTS, LINKS, PARTS
from adapt.search.figure.network import SHIPPED, FigureNetwork
from adapt.search.figure.view import FigureView, see_figure
from capture.camera import Camera
from capture.errors import BonetrackError
from capture.projection import project

Image = NDArray[np.uint8]

KINECT = Camera(640, 480, 585.0, 585.0, 319.5, 239.5)  # nominal
D415 = Camera(640, 360, 481.94, 481.94, 315.16, 174.97)
LEFT, RIGHT, MIDDLE = (0, 80, 255), (255, 160, 0), (255, 255, 255)  # blue, green, red
_SURE = 0.4
_FADED = 0.55
_MARGIN = 40  # px about the person


def draw_view(view: FigureView, depth_m: NDArray[np.floating], camera: Camera) -> Image:
    """The depth image with the figure (H, W, 3), and beside it the parts (together H, 2 W, 3).

    The person's left is orange, the right blue; joints that the network is unsure of are joined by thin lines.
    """
    near, far = view.window.depth - 0.6, view.window.depth + 0.6
    grey = np.where(depth_m > 0.0, 240.0 - 190.0 * (depth_m - near) / (far - near), 0.0).clip(0, 255).astype(np.uint8)
    figure: Image = np.ascontiguousarray(np.repeat(grey[..., None], 3, axis=2))
    pixels, _ = project(camera, view.joints)
    for a, b in LINKS:
        colour = MIDDLE if b < 3 else LEFT if JOINTS[b].endswith("_l") else RIGHT
        ends = [tuple(round(float(c)) for c in pixels[k]) for k in (a, b) if np.isfinite(pixels[k]).all()]
        if len(ends) == 2:
            width = 3 if min(view.confidence[[a, b]]) > _SURE else 1
            cv2.line(figure, ends[0], ends[1], colour, width, cv2.LINE_AA)
    parts = part_colours()[view.parts(camera)].astype(np.float64)
    shaded = np.where((depth_m > 0.0)[..., None], parts * (_FADED + (1.0 - _FADED) * grey[..., None] / 255.0), 0.0)
    both: Image = np.concatenate([figure, shaded.astype(np.uint8)], axis=1)
    words = f"{view.window.depth:.2f} m, median confidence {np.median(view.confidence):.2f}"
    cv2.putText(both, words, (6, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (0, 255, 255), 1, cv2.LINE_AA)
    return both


def biggest(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The largest connected part of a mask (H, W)."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    return np.asarray(labels == 1 + np.argmax(stats[1:, cv2.CC_STAT_AREA])) if count > 1 else mask


def stills(recordings: Path) -> Iterator[tuple[str, NDArray[np.float64], Camera]]:
    """The real stills: name, depth (H, W) m within 2.4 m, camera.

    Raises:
        BonetrackError: there are none, or one cannot be read.
    """
    kinect = sorted((recordings / "upperbody_arms_kinect1_skeltrack").glob("depth-data-*"))
    single = sorted((recordings / "person_d415_single").glob("*_depth_*.png"))
    if not kinect + single:
        raise BonetrackError("no still of the two sets there", where=recordings)
    for path in kinect:
        yield path.name, np.fromfile(path, "<u2").reshape(480, 640) / 1000.0, KINECT
    for path in single:
        depth = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        if depth is None:
            raise BonetrackError("not an image", where=path)
        yield path.stem, depth.astype(np.float64) / 1000.0, D415


def part_colours() -> NDArray[np.uint8]:
    """A colour (15, 3), blue, green, red, for each part: the left's are warm, the right's cold."""
    hues = np.zeros((1, len(PARTS), 3), np.uint8)
    for k, name in enumerate(PARTS):
        hues[0, k] = (0, 0, 90 + 60 * k) if k < 3 else ((0 if name.endswith("_l") else 90) + 7 * (k - 3) // 2, 220, 255)
    return np.asarray(cv2.cvtColor(hues, cv2.COLOR_HSV2BGR)[0])


@click.command()
@click.argument("recordings", type=click.Path(path_type=Path))
@click.argument("out", type=click.Path(path_type=Path))
@click.option("--network", type=click.Path(path_type=Path), default=SHIPPED, help="ONNX file.")
def main(recordings: Path, out: Path, network: Path) -> None:
    """Draw what the network makes of the real stills in RECORDINGS into the folder OUT."""
    try:
        net = FigureNetwork(network)
        out.mkdir(parents=True, exist_ok=True)
        for name, depth, camera in stills(recordings):
            person = biggest((depth > 0.3) & (depth < 2.4))
            view = see_figure(net, depth, camera, person)
            rows, columns = (np.flatnonzero(person.any(axis=axis)) for axis in (1, 0))
            top, left = max(rows[0] - _MARGIN, 0), max(columns[0] - _MARGIN, 0)
            picture = draw_view(view, depth, camera)
            halves = np.split(picture, 2, axis=1)
            cut = [half[top : rows[-1] + _MARGIN, left : columns[-1] + _MARGIN] for half in halves]
            cv2.imwrite(str(out / f"{name}.png"), np.concatenate(cut, axis=1))
            click.echo(f"{name}: median confidence {np.median(view.confidence):.2f}")
    except BonetrackError as error:
        click.echo(f"error: {error}", err=True)
        sys.exit(1)


if __name__ == "__main__":
    main()
