"""Depth images made trustworthy: which pixels to believe, and which of them lie on the scan's boundary.

What counts as a jump in depth follows from the sensor: on a surface seen at 80 degrees, depth changes by about six
times the size of a pixel from one pixel to the next; a structured-light sensor reads in steps of
``DEPTH_STEP * z**2`` on top. A larger change means two surfaces.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from capture.camera import Camera
from capture.compiled import compiled
from capture.rigid import Floats

Image = NDArray[np.float32]
Mask = NDArray[np.bool_]

DEPTH_STEP = 0.0029
"""Step between neighbouring readings of a structured-light sensor at 1 m (1 / m); it grows as depth squared."""

_STEEPEST_SLOPE = 6.0  # tan(80 degrees)
_SMALLEST_PATCH_M2 = 4e-4  # a patch below 4 cm2 with jumps all around is noise, not a limb
_FAR = np.float32(1e6)
_SQUARE_3 = np.ones((3, 3), dtype=np.uint8)
_SQUARE_5 = np.ones((5, 5), dtype=np.uint8)


def depth_jump(depth: Image, camera: Camera) -> Image:
    """The change of depth (m) between neighbouring pixels beyond which they belong to two surfaces.

    >>> camera = Camera(640, 480, 580.0, 580.0, 320.0, 240.0)
    >>> jump = depth_jump(np.array([[0.5, 1.0, 2.0]], dtype=np.float32), camera)
    >>> (1000.0 * jump.astype(float)).round(1).tolist()  # mm, at 0.5, 1 and 2 m
    [[6.6, 16.1, 43.9]]
    """
    jump = (2.0 * DEPTH_STEP) * depth
    jump += _STEEPEST_SLOPE / camera.fx
    jump *= depth
    return np.asarray(jump)


def pixel_area(depth: NDArray[np.floating], camera: Camera) -> NDArray[np.floating]:
    """The area (m^2) that a pixel covers of a surface facing the sensor at each depth (m).

    >>> camera = Camera(640, 480, 500.0, 500.0, 320.0, 240.0)
    >>> (1e6 * pixel_area(np.array([1.0, 2.0]), camera)).round(3).tolist()  # mm^2: twice as far, four times the area
    [4.0, 16.0]
    """
    return np.asarray(depth**2 / (camera.fx * camera.fy))


def jump_mask(depth: Image, camera: Camera) -> Mask:
    """Pixels (H, W) with a reading that have a jump in depth to one of their eight neighbours with a reading.

    >>> depth = np.array([[1.0, 1.0, 1.0, 2.0, 0.0]], dtype=np.float32)
    >>> jump_mask(depth, Camera(5, 1, 500.0, 500.0, 2.0, 0.0)).tolist()  # a hole is no jump
    [[False, False, True, True, False]]
    """
    nearest = cv2.erode(np.where(depth > 0.0, depth, _FAR), _SQUARE_3, borderType=cv2.BORDER_REPLICATE)
    farthest = cv2.dilate(depth, _SQUARE_3, borderType=cv2.BORDER_REPLICATE)
    largest_change = np.maximum(farthest - depth, depth - nearest)
    return np.asarray((depth > 0.0) & (largest_change > depth_jump(depth, camera)))


def valid_window(depth: Image) -> tuple[slice, slice]:
    """Rows and columns of the smallest window of an image (H, W) that holds all its readings.

    >>> depth = np.zeros((480, 640), dtype=np.float32)
    >>> depth[100, 200] = depth[110, 230] = 1.0
    >>> valid_window(depth)
    (slice(100, 111, None), slice(200, 231, None))
    """
    x, y, width, height = cv2.boundingRect((depth > 0.0).view(np.uint8))
    return slice(y, y + height), slice(x, x + width)


def clean_depth(depth: Image, camera: Camera) -> Image:
    """A depth image (H, W) (m) without flying pixels and specks; what is left keeps its depth exactly.

    A pixel stays if it touches (or is) a pixel without jumps around it, in a patch that is not tiny. A flying
    pixel hangs between two surfaces: both it and its neighbours have jumps, so nothing vouches for it.
    """
    cleaned = np.zeros_like(depth)
    rows, columns = valid_window(depth)
    seen = depth[rows, columns]
    if seen.size == 0:
        return cleaned
    core = (seen > 0.0) & ~jump_mask(seen, camera)
    label_count, labels = cv2.connectedComponents(core.view(np.uint8), connectivity=4)
    pixels, total_depth = np.zeros(label_count, dtype=np.int64), np.zeros(label_count)
    _add_up(labels, seen, pixels, total_depth)
    mean_depth = total_depth / np.maximum(pixels, 1)
    large = pixels * pixel_area(mean_depth, camera) >= _SMALLEST_PATCH_M2
    large[0] = False
    kept = cv2.dilate(large[labels].view(np.uint8), _SQUARE_3) > 0
    np.copyto(cleaned[rows, columns], seen, where=kept)
    return cleaned


@compiled
def _add_up(labels: NDArray[np.int32], depth: Image, pixels: NDArray[np.int64], total_depth: Floats) -> None:
    """How many pixels (L,) have each of L labels (H, W), and their depths' sum (L,); 0 is no label."""
    for row in range(labels.shape[0]):
        for column in range(labels.shape[1]):
            label = labels[row, column]
            if label > 0:
                pixels[label] += 1
                total_depth[label] += depth[row, column]


def boundary(depth: Image, camera: Camera, *, inside: Mask | None = None) -> Mask:
    """Pixels (H, W) with a reading that lie on the scan's boundary.

    These are within two pixels of a hole, a jump in depth or the image's edge. ``inside`` says which pixels count
    as scanned (default: all with a reading), so that a region's cut is a boundary too. A hole one or two pixels
    wide is not one: the surface plainly goes on behind it.

    >>> depth = np.zeros((9, 9), dtype=np.float32)
    >>> depth[1:8, 1:8] = 1.0
    >>> print(boundary(depth, Camera(9, 9, 500.0, 500.0, 4.0, 4.0)).astype(int))
    [[0 0 0 0 0 0 0 0 0]
     [0 1 1 1 1 1 1 1 0]
     [0 1 1 1 1 1 1 1 0]
     [0 1 1 0 0 0 1 1 0]
     [0 1 1 0 0 0 1 1 0]
     [0 1 1 0 0 0 1 1 0]
     [0 1 1 1 1 1 1 1 0]
     [0 1 1 1 1 1 1 1 0]
     [0 0 0 0 0 0 0 0 0]]
    """
    on_boundary = np.zeros(depth.shape, dtype=bool)
    scanned = (depth > 0.0) if inside is None else (depth > 0.0) & inside
    x, y, width, height = cv2.boundingRect(scanned.view(np.uint8))
    if width == 0:
        return on_boundary
    # One pixel more than the scan on each side, so that its surroundings count as missing.
    padded = np.zeros((height + 4, width + 4), dtype=np.uint8)
    padded[2:-2, 2:-2] = scanned[y : y + height, x : x + width]
    closed = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, _SQUARE_3)
    near = cv2.dilate(1 - closed, _SQUARE_5)[2:-2, 2:-2]
    window = depth[y : y + height, x : x + width]
    near |= cv2.dilate(jump_mask(window, camera).view(np.uint8), _SQUARE_3)
    on_boundary[y : y + height, x : x + width] = near > 0
    return np.asarray(on_boundary & scanned)
