"""From the network's numbers to joints: the 3 x 3 cells of most chance say where one is, and their sum how surely."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from adapt.search.figure.names import JOINTS, MIRRORED_JOINTS

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]

CELL = 4  # pixels of the window
CELLS = 32


def chances_of_cells(joints: Floats32) -> tuple[Floats32, Floats32]:
    """Chances (J, 32, 32) of each cell for each joint, which sum to 1, and offsets (3, J, 32, 32), of what the network
    gives for one window (4 J, 32, 32): offsets to the right and down in cells, depth beyond the window's (m).
    """
    numbers = joints.reshape(4, len(JOINTS), CELLS, CELLS)
    scores = np.exp(numbers[0] - numbers[0].max(axis=(1, 2), keepdims=True))
    return scores / scores.sum(axis=(1, 2), keepdims=True), numbers[1:]


def mirrored_back(chances: Floats32, offsets: Floats32) -> tuple[Floats32, Floats32]:
    """The same of a mirrored window as they are in the window itself."""
    order = list(MIRRORED_JOINTS)
    back = offsets[:, order, :, ::-1] * np.array([-1.0, 1.0, 1.0], np.float32)[:, None, None, None]
    return chances[order, :, ::-1], back


def decode_joints(chances: Floats32, offsets: Floats32) -> tuple[Floats, Floats]:
    """Places (J, 3) in the window (pixels from its corner, m beyond its depth) and confidences (J,), 0 to 1.

    >>> chances, offsets = np.zeros((19, 32, 32), np.float32), np.zeros((3, 19, 32, 32), np.float32)
    >>> chances[:, 10, 20], offsets[0], offsets[2] = 1.0, 0.25, 0.1
    >>> places, confidence = decode_joints(chances, offsets)
    >>> places[0].round(3).tolist(), float(confidence[0])  # row 10 and column 20, a quarter of a cell to the right
    ([83.0, 42.0, 0.1], 1.0)
    """
    near = np.stack([cv2.boxFilter(c, -1, (3, 3), normalize=False, borderType=cv2.BORDER_CONSTANT) for c in chances])
    places, confidence = np.zeros((len(chances), 3)), near.max(axis=(1, 2)).astype(np.float64)
    for joint, cell in enumerate(near.reshape(len(near), -1).argmax(axis=1)):
        row, column = divmod(int(cell), CELLS)
        block = slice(max(row - 1, 0), row + 2), slice(max(column - 1, 0), column + 2)
        share = chances[joint][block] / chances[joint][block].sum()
        rows, columns = np.mgrid[block]
        right, down, depth = (offset[joint][block] for offset in offsets)
        places[joint] = (
            CELL * (share * (columns + 0.5 + right)).sum(),
            CELL * (share * (rows + 0.5 + down)).sum(),
            (share * depth).sum(),
        )
    return places, confidence
