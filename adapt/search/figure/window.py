"""The network's window: 2.24 m of a depth image at the person's distance, 128 pixels across, and what it is fed.

A window stands at a depth z0 (m) about a ray of slopes (x, y) = (X / Z, Y / Z). Its pixel (row i, column j) looks along
the slopes (x + (j + 1/2 - 64) s, y + (i + 1/2 - 64) s) with s = 2.24 m / 128 / z0, so that a pixel is 17.5 mm at z0.
A place in the window is (u, v, d): column and row counted from its corner, and depth beyond z0 (m).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from capture.camera import Camera, ray_slopes
from capture.compiled import compiled
from capture.projection import project

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]
Bools = NDArray[np.bool_]

PIXELS = 128
SPAN_M = 2.24
PIXEL_M = SPAN_M / PIXELS
REACH_M = 1.0  # depth farther than this from the window's is left out
NEAREST_M = 0.25
NOTHING_M = 1.2  # what stands for no depth
STEEPEST = 2.0  # slopes are clipped here
JUMP_M = 0.12  # no slope is taken over a step in depth larger than this
_OUTERMOST = 0.5  # percent of the person's pixels that may lie out of its box


@dataclass(frozen=True)
class Window:
    """Where a window stands: depth z0 (m) and the slopes of its middle ray."""

    depth: float
    x: float
    y: float

    @property
    def step(self) -> float:
        """Slope from one pixel to the next."""
        return PIXEL_M / self.depth

    def place(self, points: Floats) -> Floats:
        """Places (N, 3) in the window of points (N, 3) (m, sensor frame); what is not in front of it is far outside.

        >>> Window(2.0, 0.0, 0.0).place(np.array([[0.175, 0.0, 2.0]])).round(6).tolist()
        [[74.0, 64.0, 0.0]]
        """
        z = np.where(points[:, 2] > 0.05, points[:, 2], np.nan)
        u = (points[:, 0] / z - self.x) / self.step + PIXELS / 2
        v = (points[:, 1] / z - self.y) / self.step + PIXELS / 2
        return np.nan_to_num(np.column_stack([u, v, points[:, 2] - self.depth]), nan=-1e4)

    def points(self, places: Floats) -> Floats:
        """The points (N, 3) (m, sensor frame) at places (N, 3): the inverse of ``place``."""
        z = self.depth + places[:, 2]
        slopes = np.array([self.x, self.y]) + (places[:, :2] - PIXELS / 2) * self.step
        return np.column_stack([slopes * z[:, None], z])


def window_about(depth_m: NDArray[np.floating], camera: Camera, person: Bools) -> Window:
    """The window about a person's pixels (H, W): at their median depth, centred on the box that holds nearly all.

    Raises:
        ValueError: no pixel of the person has depth.
    """
    seen = person & (depth_m > NEAREST_M)
    if not seen.any():
        raise ValueError("no pixel of the person has depth")
    slopes = ray_slopes(camera)[seen]
    low, high = np.percentile(slopes, [_OUTERMOST, 100.0 - _OUTERMOST], axis=0)
    x, y = (low + high) / 2.0
    return Window(float(np.median(depth_m[seen])), float(x), float(y))


def cut_window(depth_m: NDArray[np.floating], camera: Camera, window: Window) -> Floats32:
    """Depth beyond the window's (128, 128) m, NaN where there is none within reach; nearest pixels of medians."""
    depth = np.nan_to_num(depth_m).astype(np.float32)
    pixels = camera.fx * window.step
    if pixels > 2.0:
        depth = cv2.medianBlur(depth, 5 if pixels > 4.0 else 3)
    grid = (np.arange(PIXELS) + 0.5 - PIXELS / 2) * window.step
    rays = np.ones((PIXELS, PIXELS, 3))
    rays[..., 0], rays[..., 1] = window.x + grid, window.y + grid[:, None]
    at = np.nan_to_num(project(camera, rays.reshape(-1, 3))[0], nan=-10.0).astype(np.float32)
    columns, rows = (at[:, k].reshape(PIXELS, PIXELS) for k in (0, 1))
    taken = cv2.remap(depth, columns, rows, cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT, borderValue=0.0)
    beyond = taken - np.float32(window.depth)
    kept = (taken > NEAREST_M) & (np.abs(beyond) < REACH_M)
    return np.where(kept, beyond, np.float32(np.nan)).astype(np.float32)


def features(beyond: Floats32) -> Floats32:
    """What the network is fed (4, 128, 128): depth (m), whether there is any, and its slopes along x and y.

    ``beyond`` (128, 128) is depth beyond the window's, NaN where there is none. A slope is that of the mean over
    3 x 3 pixels, none over jumps and holes. Without slopes front and back are hardly told apart.
    """
    fed = np.zeros((4, *beyond.shape), np.float32)
    _fill_features(np.ascontiguousarray(beyond), fed)
    return fed


def mirrored(fed: Floats32) -> Floats32:
    """What the network would be fed of the mirror image."""
    turned = np.ascontiguousarray(fed[:, :, ::-1])
    turned[2] *= -1.0
    return turned


@compiled
def _fill_features(beyond: Floats32, fed: Floats32) -> None:
    rows, columns = beyond.shape
    smooth = np.zeros((rows, columns), np.float32)
    for i in range(rows):
        for j in range(columns):
            z = beyond[i, j]
            if z != z:
                fed[0, i, j] = NOTHING_M
                continue
            fed[0, i, j], fed[1, i, j] = z, 1.0
            total, count = 0.0, 0
            for k in range(max(i - 1, 0), min(i + 2, rows)):
                for m in range(max(j - 1, 0), min(j + 2, columns)):
                    if beyond[k, m] == beyond[k, m]:
                        total += beyond[k, m]
                        count += 1
            smooth[i, j] = total / count
    for i in range(rows):
        for j in range(columns):
            if fed[1, i, j] == 0.0:
                continue
            if 0 < j < columns - 1 and fed[1, i, j - 1] > 0.0 and fed[1, i, j + 1] > 0.0:
                rise = smooth[i, j + 1] - smooth[i, j - 1]
                if abs(rise) < JUMP_M:
                    fed[2, i, j] = min(max(rise / (2.0 * PIXEL_M), -STEEPEST), STEEPEST)
            if 0 < i < rows - 1 and fed[1, i - 1, j] > 0.0 and fed[1, i + 1, j] > 0.0:
                rise = smooth[i + 1, j] - smooth[i - 1, j]
                if abs(rise) < JUMP_M:
                    fed[3, i, j] = min(max(rise / (2.0 * PIXEL_M), -STEEPEST), STEEPEST)
