"""The network itself: an ONNX file that OpenCV runs, a few milliseconds a window; nothing else is needed.

It was trained on simulated depth images of MakeHuman's people alone (``adapt.template_builder.first_pose``).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from adapt.search.figure.decode import CELLS
from adapt.search.figure.names import JOINTS, PARTS
from adapt.search.figure.window import PIXELS
from capture.errors import BonetrackError

Floats32 = NDArray[np.float32]
Network = Callable[[Floats32], tuple[Floats32, Floats32]]
"""What gives numbers of joints (N, 76, 32, 32) and scores of parts (N, 15, 64, 64) for windows (N, 4, 128, 128)."""

SHIPPED = Path(__file__).resolve().parents[2] / "templates" / "first-pose.onnx"
_BY_HAND = "give a first pose by hand, or train it as docs/first-pose.md says"


class FigureNetwork:
    """The network of a file, by default the one that ships.

    Raises:
        BonetrackError: the file is not there, or is not such a network.
    """

    def __init__(self, path: Path | None = None) -> None:
        self.path = SHIPPED if path is None else path
        if not self.path.is_file():
            raise BonetrackError("there is no network for the first pose", where=self.path, remedy=_BY_HAND)
        try:
            self._net = cv2.dnn.readNetFromONNX(str(self.path))
            joints, parts = self(np.zeros((1, 4, PIXELS, PIXELS), np.float32))
        except (cv2.error, ValueError) as error:
            raise BonetrackError("not a network for the first pose", where=self.path, remedy=_BY_HAND) from error
        if joints.shape[1:] != (4 * len(JOINTS), CELLS, CELLS) or parts.shape[1:] != (len(PARTS), *[PIXELS // 2] * 2):
            raise BonetrackError("not a network for the first pose", where=self.path, remedy=_BY_HAND)

    def __call__(self, fed: Floats32) -> tuple[Floats32, Floats32]:
        """As ``Network``."""
        self._net.setInput(np.ascontiguousarray(fed))
        joints, parts = self._net.forward(("joints", "parts"))
        return joints, parts
