"""Point clouds of a depth sensor (``.pcd``, ``.ply``), made depth images again; metres, x right, y down, z forward.

The points of an organised cloud stand in the order of the pixels, so its camera can be told from it: u z = fx x + cx z
and v z = fy y + cy z for all of them. Other clouds are projected by a stated camera; where several points fall into
one pixel, the nearest counts.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.camera import Camera
from capture.errors import RecordingError
from capture.importers.axes import sensor_from_axes
from capture.importers.cloud_files import Points, read_points
from capture.importers.images import RAW_SIZE, source_files, source_of
from capture.importers.names import NamedTimes, named_times
from capture.importers.source import (
    LARGEST_READING,
    DepthFrame,
    Frames,
    Source,
    UserCamera,
    check_size,
    fine_unit,
)
from capture.recording import Sensor
from capture.rigid import Floats

_LARGEST_MISFIT_PX = 1.0
_FEWEST_POINTS = 100


def is_clouds(folder: Path) -> bool:
    """Whether a folder holds clouds.

    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     before = is_clouds(Path(folder))
    ...     _ = Path(folder, "0001.pcd").write_text("")
    ...     before, is_clouds(Path(folder))
    (False, True)
    """
    return any(folder.glob("*.pcd")) or any(folder.glob("*.ply"))


def open_clouds(source: Path, stated: UserCamera) -> Source:
    """A cloud, or a folder of them; order and times are what their names tell.

    Raises:
        RecordingError: there is none; the first is damaged, or not in front of the sensor; no camera can be told from
            it and none is stated.
    """
    pattern = stated.pattern or ("*.pcd" if source.is_dir() and any(source.glob("*.pcd")) else "*.ply")
    named = named_times(source_files(source, pattern), stated.fps)
    files = named.files
    metre = 1.0 if stated.depth_unit_m is None else stated.depth_unit_m
    first = _turned(read_points(files[0]), stated.axes)
    _refuse_behind(first, files[0])
    width, height = first.size or stated.size or RAW_SIZE
    check_size(width, height, where=files[0])
    own = None if first.size is None or stated.fx is not None else _fitted(first.xyz * metre, first.size, files[0])
    camera = stated.camera(width, height, own=own, where=source)
    reading_m = fine_unit(stated.depth_range_m[1])
    sensor = Sensor("sensor", camera, reading_m, stated.depth_range_m)
    return source_of(named, sensor, _frames(named, first, camera, metre / reading_m, stated.axes))


def _turned(points: Points, axes: str | None) -> Points:
    """The points in the sensor's own axes; they are in the stated ones, else in those that their header tells."""
    named = axes or points.axes
    return points if named is None else replace(points, xyz=points.xyz @ sensor_from_axes(named).T)


def _refuse_behind(points: Points, file: Path) -> None:
    with np.errstate(invalid="ignore"):
        before, behind = (points.xyz[:, 2] > 0.0).sum(), (points.xyz[:, 2] < 0.0).sum()
    if behind > before:
        raise RecordingError(
            f"has {behind} of {behind + before} points behind the sensor, so its axes are not x-right,y-down,z-forward",
            where=file,
            remedy="say which way they point, as in --axes x-right,y-up,z-back",
        )


def _frames(named: NamedTimes, first: Points, camera: Camera, scale: float, axes: str | None) -> Frames:
    for file, time_s in zip(named.files, named.times_s, strict=True):
        points = _turned(read_points(file), axes or first.axes)
        if points.size != first.size:
            raise RecordingError(
                f"is organised as {points.size}, the first cloud as {first.size}",
                where=file,
                remedy="import clouds of different sizes into recordings of their own",
            )
        depth = _depth(points, camera, scale)
        if not depth.any():
            raise RecordingError(
                "has no points in front of the camera",
                where=file,
                remedy="points must be in metres (or state --unit-mm), x right, y down, z forward (or state --axes)",
            )
        yield DepthFrame(time_s, depth)


def _depth(points: Points, camera: Camera, scale: float) -> NDArray[np.uint16]:
    """The readings (H, W) that a cloud makes, whose coordinates times the scale are readings."""
    with np.errstate(invalid="ignore", over="ignore"):
        xyz = points.xyz * scale
        reading = np.rint(xyz[:, 2])
        seen = np.isfinite(xyz).all(axis=1) & (reading > 0) & (reading <= LARGEST_READING)
    image = np.full(camera.width * camera.height, LARGEST_READING + 1, dtype=np.int64)
    if points.size is not None:
        image[np.flatnonzero(seen)] = reading[seen].astype(np.int64)
    else:
        from capture.projection import project  # compiled loops: only unorganised clouds need them

        pixels, _ = project(camera, xyz[seen])
        with np.errstate(invalid="ignore"):
            u, v = np.rint(pixels).T
            inside = (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
        at = (v[inside] * camera.width + u[inside]).astype(np.int64)
        np.minimum.at(image, at, reading[seen][inside].astype(np.int64))
    image[image > LARGEST_READING] = 0
    return image.reshape(camera.height, camera.width).astype(np.uint16)


def _fitted(xyz: Floats, size: tuple[int, int], file: Path) -> Camera:
    """The pinhole camera whose pixels the points (N, 3) of an organised cloud fall on, least squares.

    Raises:
        RecordingError: too few points, or they fall on no pinhole camera's pixels.
    """
    width, height = size
    with np.errstate(invalid="ignore"):
        seen = np.flatnonzero(np.isfinite(xyz).all(axis=1) & (xyz[:, 2] > 0.0))
    problem = f"has {len(seen)} points in front of the sensor, too few to tell its camera"
    if len(seen) >= _FEWEST_POINTS:
        slopes = xyz[seen, :2] / xyz[seen, 2:]
        v, u = np.divmod(seen.astype(np.float64), width)
        (fx, cx), off_u = _line(slopes[:, 0], u)
        (fy, cy), off_v = _line(slopes[:, 1], v)
        problem = f"is organised, but its points are off any camera's pixels by {max(off_u, off_v):.1f} px"
        if fx > 0.0 and fy > 0.0 and max(off_u, off_v) <= _LARGEST_MISFIT_PX:
            return Camera(width, height, fx, fy, cx, cy)
    raise RecordingError(
        problem,
        where=file,
        remedy="state the camera with --fx (px), and --axes if they are not x-right,y-down,z-forward",
    )


def _line(slope: Floats, pixel: Floats) -> tuple[tuple[float, float], float]:
    """Focal length and principal point along one axis, and the largest misfit (px)."""
    design = np.stack([slope, np.ones_like(slope)], axis=-1)
    found = np.linalg.lstsq(design, pixel, rcond=None)[0]
    return (float(found[0]), float(found[1])), float(np.abs(design @ found - pixel).max())
