"""One instant's point cloud: what all sensors saw, cleaned, culled, with normals and boundary, in one frame."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.camera import Camera, ray_slopes
from capture.cloud.background import backgrounds, planes_in, without_planes
from capture.cloud.normals import surface_at
from capture.cloud.patches import Pixels
from capture.cloud.preprocess import Image, Mask, boundary, clean_depth
from capture.cloud.region import Found, automatic_region, find_region
from capture.compiled import compiled
from capture.errors import CloudError
from capture.own import WRITTEN, replaced_if_own, words
from capture.recording import Instant, Recording, Region, read_depth, world_from_sensor
from capture.rigid import Floats, apply

__all__ = ["Cloud", "Region", "View", "automatic_region", "fuse", "write_ply"]

SPACING_M = 0.0075
"""Gives an arm that two sensors see about 3,500 points."""


@dataclass(frozen=True, eq=False)
class View:
    """What one sensor saw but for floor and walls: its depth image (H, W) (m, 0 = none), where it stands (4, 4).

    ``late_s`` is how long after the instant it looked.
    """

    sensor: str
    camera: Camera
    world_from_sensor: Floats
    depth: Image
    late_s: float = 0.0


@dataclass(frozen=True, eq=False)
class Cloud:
    """Points of a surface in the common frame.

    Attributes:
        points: (N, 3), metres.
        normals: (N, 3), unit, on the side of the sensor that saw the point.
        boundary: (N,), true where the scan ends nearby: the surface goes on, but nobody saw it.
        sensor: (N,), index into ``views`` of the sensor that saw the point.
        views: what the sensors saw.
    """

    points: Floats
    normals: Floats
    boundary: Mask
    sensor: NDArray[np.int64]
    views: tuple[View, ...]


def fuse(
    recording: Recording, instant: Instant, *, region: Region | None = None, spacing_m: float = SPACING_M
) -> Cloud:
    """The point cloud of one instant, about one point per ``spacing_m`` and sensor.

    Only what is inside the region counts: the given one, else the recording's, else an automatic one. Floor and walls
    do not.

    Raises:
        RecordingError: an image cannot be read.
        CalibrationError: where a sensor stands is not known.
        CloudError: nothing is left inside the region.
    """
    if region is None:
        region = region_of_interest(recording)
    views = tuple(_view(recording, instant, name) for name in instant.frames)
    parts = [view_points(view, region, spacing_m=spacing_m) for view in views]
    if not sum(len(points) for points, _, _ in parts):
        raise CloudError(
            f"no sensor saw anything inside the region at {instant.time_s:.3f} s",
            where=recording.path,
            remedy="check the region and the calibration",
        )
    return Cloud(
        points=np.concatenate([points for points, _, _ in parts]),
        normals=np.concatenate([normals for _, normals, _ in parts]),
        boundary=np.concatenate([on_boundary for _, _, on_boundary in parts]),
        sensor=np.repeat(np.arange(len(parts)), [len(points) for points, _, _ in parts]),
        views=views,
    )


def region_of_interest(recording: Recording) -> Region:
    """The region that the recording states, else an automatic one."""
    return recording.region or found_region(recording).region


@lru_cache(maxsize=8)
def found_region(recording: Recording) -> Found:
    """The automatic region of a recording, worked out once."""
    return find_region(recording)


def view_points(view: View, region: Region, *, spacing_m: float) -> tuple[Floats, Floats, Mask]:
    """Points (N, 3), normals (N, 3) and boundary flags (N,) of what one view shows inside the region."""
    pixels, points, scanned = pixels_inside(view, region)
    chosen = pixels[spread(points, spacing_m=spacing_m)]
    on_boundary = boundary(view.depth, view.camera, inside=scanned)[chosen[:, 0], chosen[:, 1]]
    points, normals = surface_at(view.depth, view.camera, chosen)
    return apply(view.world_from_sensor, points), normals @ view.world_from_sensor[:3, :3].T, on_boundary


def spread(points: Floats, *, spacing_m: float) -> NDArray[np.intp]:
    """Indices of well-spread points of (N, 3): of each cube of that size the point nearest to its centre.

    >>> points = np.array([[0.001, 0.001, 1.001], [0.004, 0.005, 1.006], [0.501, 0.001, 1.001]])
    >>> spread(points, spacing_m=0.01).tolist()  # the first two share a cube
    [1, 2]
    """
    if not len(points):
        return np.zeros(0, dtype=np.intp)
    size = 1 << int(4 * len(points) - 1).bit_length()  # a table that stays three quarters empty
    kept = _keep_central(points / spacing_m, np.full(size, -1), np.zeros(len(points), dtype=np.bool_))
    return np.flatnonzero(kept)


@compiled
def _keep_central(scaled: Floats, table: NDArray[np.intp], kept: Mask) -> Mask:
    """Marks of each unit cube the one of the points (N, 3) that is nearest to its centre.

    ``table`` is a hash table, -1 where empty, of the best point of each cube so far.
    """
    last = len(table) - 1
    for m in range(len(scaled)):
        x, y, z = np.floor(scaled[m, 0]), np.floor(scaled[m, 1]), np.floor(scaled[m, 2])
        slot = (int(x) * 73856093 ^ int(y) * 19349663 ^ int(z) * 83492791) & last
        while table[slot] >= 0:
            other = scaled[table[slot]]
            if np.floor(other[0]) == x and np.floor(other[1]) == y and np.floor(other[2]) == z:
                break
            slot = (slot + 1) & last
        if table[slot] >= 0:
            rival = table[slot]
            a, b, c = scaled[m, 0] - x - 0.5, scaled[m, 1] - y - 0.5, scaled[m, 2] - z - 0.5
            d, e, f = scaled[rival, 0] - x - 0.5, scaled[rival, 1] - y - 0.5, scaled[rival, 2] - z - 0.5
            if a * a + b * b + c * c >= d * d + e * e + f * f:
                continue
            kept[rival] = False
        table[slot], kept[m] = m, True
    return kept


def write_ply(cloud: Cloud, path: Path) -> None:
    """Write a cloud as binary PLY: position, normal, and per point ``boundary`` (0, 1) and ``sensor`` (index).

    Raises:
        OutputError: something stands there that bonetrack did not write.
    """
    rows = np.zeros(len(cloud.points), dtype=[("p", "<f4", 3), ("n", "<f4", 3), ("boundary", "u1"), ("sensor", "u1")])
    rows["p"], rows["n"] = cloud.points, cloud.normals
    rows["boundary"], rows["sensor"] = cloud.boundary, cloud.sensor
    names = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
    names += "".join(f"property uchar {name}\n" for name in ("boundary", "sensor"))
    sensors = "".join(f"comment sensor {i} is {view.sensor}\n" for i, view in enumerate(cloud.views))
    begin = f"ply\nformat binary_little_endian 1.0\ncomment {WRITTEN}\n{sensors}"
    header = f"{begin}element vertex {len(rows)}\n{names}end_header\n"
    with replaced_if_own(path, words(WRITTEN)) as partial:
        partial.write_bytes(header.encode("ascii") + rows.tobytes())


def _view(recording: Recording, instant: Instant, name: str) -> View:
    sensor = recording.sensor(name)
    depth = clean_depth(read_depth(sensor, instant.frames[name]), sensor.camera)
    depth = without_planes(depth, sensor.camera, planes_in(depth, sensor.camera, backgrounds(recording)[name]))
    late_s = instant.frames[name].time_s - instant.time_s
    return View(name, sensor.camera, world_from_sensor(recording, name), depth, late_s)


def pixels_inside(view: View, region: Region) -> tuple[Pixels, Floats, Mask]:
    """Pixels (N, 2) (row, column) with a reading inside the region, their points (N, 3) in the sensor frame; a mask.

    The mask (H, W) marks the same pixels.
    """
    marked, most = np.zeros(view.depth.shape, dtype=np.bool_), np.count_nonzero(view.depth)
    pixels, points = np.empty((most, 2), dtype=np.intp), np.empty((most, 3))
    t, slopes = view.world_from_sensor, ray_slopes(view.camera)
    count = _inside(view.depth, slopes, t, region.minimum, region.maximum, marked, pixels, points)
    return pixels[:count], points[:count], marked


@compiled
def _inside(
    depth: Image,
    slopes: Image,
    t: Floats,
    minimum: Floats,
    maximum: Floats,
    marked: Mask,
    pixels: Pixels,
    points: Floats,
) -> int:
    """Marks and lists the pixels whose points the region holds, and counts them; ``t`` is where the sensor stands."""
    count = 0
    for row in range(depth.shape[0]):
        for column in range(depth.shape[1]):
            z = depth[row, column]
            if not z > 0.0:
                continue
            x, y = slopes[row, column, 0] * z, slopes[row, column, 1] * z
            within = True
            for i in range(3):
                world = t[i, 0] * x + t[i, 1] * y + t[i, 2] * z + t[i, 3]
                within = within and minimum[i] <= world <= maximum[i]
            if within:
                marked[row, column] = True
                pixels[count, 0], pixels[count, 1] = row, column
                points[count, 0], points[count, 1], points[count, 2] = x, y, z
                count += 1
    return count
