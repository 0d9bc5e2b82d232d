"""The figure that one depth image shows: window, network, decoding, twice; the second time about the joints found.

A window and its mirror image are both looked at, and the mean is taken: sides come out surer.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from adapt.search.figure.decode import chances_of_cells, decode_joints, mirrored_back
from adapt.search.figure.names import MIRRORED_PARTS
from adapt.search.figure.network import Network
from adapt.search.figure.window import PIXELS, Window, cut_window, features, mirrored, window_about
from capture.camera import Camera, ray_slopes

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]
Bools = NDArray[np.bool_]

LEAST_CONFIDENCE = 0.4
"""A view whose joints have a lower median confidence shows no person, or none that the network can read."""

_WORTH_CENTRING, _LEAST_JOINTS = 0.15, 6
_LARGEST_STEP_M = 0.15


@dataclass(frozen=True, eq=False)
class FigureView:
    """What the network makes of one depth image.

    ``joints`` (19, 3) m in the sensor's frame, hidden ones too; ``confidence`` (19,) 0 to 1; ``chances`` (15, 64, 64)
    of each part for every second pixel of ``window`` (rows and columns 1, 3, 5 ..), which sum to 1; ``seen`` (64, 64)
    whether there is depth.
    """

    joints: Floats = field(repr=False)
    confidence: Floats = field(repr=False)
    chances: Floats32 = field(repr=False)
    seen: Bools = field(repr=False)
    window: Window

    @property
    def is_person(self) -> bool:
        """Whether the network is sure enough that this is a person with these joints."""
        return float(np.median(self.confidence)) >= LEAST_CONFIDENCE

    def part_chances(self, camera: Camera) -> Floats32:
        """The chances (15, H, W) of each part for the sensor's own pixels; nothing outside the window."""
        slopes = ray_slopes(camera)
        columns, rows = (
            (((slopes[..., k] - middle) / self.window.step + PIXELS / 2 - 1.5) / 2.0).astype(np.float32)
            for k, middle in enumerate((self.window.x, self.window.y))
        )
        fills = [1.0, *[0.0] * (len(self.chances) - 1)]
        return np.stack(
            [
                cv2.remap(chance, columns, rows, cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT, borderValue=fill)
                for chance, fill in zip(self.chances, fills, strict=True)
            ]
        )

    def parts(self, camera: Camera) -> NDArray[np.uint8]:
        """The likeliest part (H, W) of the sensor's own pixels, by number in ``PARTS``; 0 is nothing."""
        return np.asarray(self.part_chances(camera).argmax(axis=0), dtype=np.uint8)


def see_figure(
    network: Network, depth_m: NDArray[np.floating], camera: Camera, person: Bools, *, passes: int = 2
) -> FigureView:
    """The figure in a depth image (H, W) m, about a person's pixels (H, W).

    Depth beyond the person's pixels may be left in: the network has learnt to leave rooms and other people out.

    Raises:
        ValueError: no pixel of the person has depth.
    """
    window = window_about(depth_m, camera, person)
    view = _look(network, depth_m, camera, window)
    for _ in range(passes - 1):
        view = _look(network, depth_m, camera, _centred(view))
    return view


def figure_of_window(network: Network, beyond: Floats32, window: Window) -> FigureView:
    """The figure in a window that is cut already (128, 128): depth beyond the window's, NaN where there is none."""
    fed = features(beyond)
    joints, parts = network(np.stack([fed, mirrored(fed)]))
    one, other = chances_of_cells(joints[0]), mirrored_back(*chances_of_cells(joints[1]))
    chances = (one[0] + other[0]) / 2.0
    offsets = (one[0] * one[1] + other[0] * other[1]) / np.maximum(one[0] + other[0], 1e-9)
    places, confidence = decode_joints(chances, offsets)
    back = parts[1][list(MIRRORED_PARTS)][:, :, ::-1]
    seen = np.isfinite(beyond[1::2, 1::2])
    return FigureView(window.points(places), confidence, (_softmax(parts[0]) + _softmax(back)) / 2.0, seen, window)


def _look(network: Network, depth_m: NDArray[np.floating], camera: Camera, window: Window) -> FigureView:
    return figure_of_window(network, cut_window(depth_m, camera, window), window)


def _centred(view: FigureView) -> Window:
    """The window about the joints that a view is fairly sure of."""
    sure = view.confidence > _WORTH_CENTRING
    if sure.sum() <= _LEAST_JOINTS:
        return view.window
    places = view.window.place(view.joints[sure])
    low, high = places[:, :2].min(axis=0), places[:, :2].max(axis=0)
    right, down = (float(middle) - PIXELS / 2 for middle in (low + high) / 2.0)
    nearer = float(np.clip(np.median(places[:, 2]), -_LARGEST_STEP_M, _LARGEST_STEP_M)) / 2.0
    window, step = view.window, view.window.step
    return replace(window, depth=window.depth + nearer, x=window.x + right * step, y=window.y + down * step)


def _softmax(scores: Floats32) -> Floats32:
    raised = np.exp(scores - scores.max(axis=0, keepdims=True))
    return np.asarray(raised / raised.sum(axis=0, keepdims=True), dtype=np.float32)
