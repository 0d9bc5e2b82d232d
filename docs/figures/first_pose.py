"""What the network of the first pose is trained on: simulated windows with joints, and the labels of their pixels.

    python docs/figures/first_pose.py --out docs/images

Writes ``first-pose-windows.png``: persons, and below them crops; the left limbs orange.
"""

from __future__ import annotations

from pathlib import Path

import click
import cv2
import numpy as np
from numpy.typing import NDArray

from adapt.search.figure.names import JOINTS, LINKS
from adapt.search.figure.window import PIXELS
from adapt.template_builder.first_pose.clothes import Wardrobe
from adapt.template_builder.first_pose.make import draw_windows
from adapt.template_builder.first_pose.people import Rig
from adapt.template_builder.first_pose.windows import KINDS, NO_DEPTH
from capture.files import replaced_when_complete
from track.evaluation.first_pose_pictures import LEFT, MIDDLE, RIGHT, part_colours

Image = NDArray[np.uint8]

SIZE = 256  # px of a picture of a window
COLUMNS = 3
SHOWN = (*["person"] * 9, *["crop"] * 6)
SEED = 21


def picture(sample: np.void) -> Image:
    """A window's depth with the true joints, and its labels beside it (SIZE, 2 SIZE, 3)."""
    depth = sample["depth"].astype(np.float64)
    grey = np.where(depth == NO_DEPTH, 0.0, 235.0 - 190.0 * (depth + 1000.0) / 2000.0).astype(np.uint8)
    seen = _enlarged(np.repeat(grey[..., None], 3, axis=2))
    places = sample["joints"][:, :2] * SIZE / PIXELS
    for a, b in LINKS:
        colour = MIDDLE if b < 3 else LEFT if JOINTS[b].endswith("_l") else RIGHT
        ends = [(round(float(x)), round(float(y))) for x, y in places[[a, b]]]
        if np.abs(places[[a, b]]).max() < 4 * SIZE:
            cv2.line(seen, ends[0], ends[1], colour, 1, cv2.LINE_AA)
    labels = _enlarged(part_colours()[sample["parts"]])
    labels[_enlarged(np.repeat(grey[1::2, 1::2, None], 3, axis=2)) == 0] = 0
    return np.concatenate([seen, labels], axis=1)


def _enlarged(image: Image) -> Image:
    return np.ascontiguousarray(cv2.resize(image, (SIZE, SIZE), interpolation=cv2.INTER_NEAREST), dtype=np.uint8)


@click.command()
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Folder for the picture.")
def main(out: Path) -> None:
    """Draw simulated windows."""
    rig = Rig()
    windows = draw_windows(np.random.default_rng(SEED), rig, Wardrobe(rig))
    chosen = [next(w for w in windows if KINDS[w["kind"]] == kind) for kind in SHOWN]
    rows = [chosen[k : k + COLUMNS] for k in range(0, len(chosen), COLUMNS)]
    out.mkdir(parents=True, exist_ok=True)
    with replaced_when_complete(out / "first-pose-windows.png") as partial:
        sheet = np.concatenate([np.concatenate([picture(sample) for sample in row], axis=1) for row in rows], axis=0)
        cv2.imwrite(str(partial), sheet)


if __name__ == "__main__":
    main()
