"""What the options of ``bonetrack import`` say of the cameras and of the files that tell nothing of theirs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import click

if TYPE_CHECKING:
    from capture.importers import UserCamera

T = TypeVar("T")


@dataclass(frozen=True)
class CameraOptions:
    """The options as the command line has them, under their names.

    Tuples, but for ``depth_range``, hold nothing, one value for all sources, or one for each.
    """

    pattern: str | None
    width: int
    height: int
    fx: tuple[float, ...]
    fy: tuple[float, ...]
    cx: tuple[float, ...]
    cy: tuple[float, ...]
    distortion: tuple[str, ...]
    unit_mm: tuple[float, ...]
    fps: float | None
    depth_range: tuple[float, float]
    kinect_disparity: bool
    axes: str | None
    mirrored: bool

    def of_sources(self, count: int) -> list[UserCamera]:
        """What is stated of each of so many sources.

        Raises:
            click.BadParameter: options that do not go together, as many values as there are no sources, or no value.
        """
        from capture.importers import UserCamera

        if not self.fx and (self.fy or self.cx or self.cy or self.distortion):
            raise click.BadParameter("is needed where another part of the camera is stated", param_hint="--fx")
        numbers = {name: _for_each(getattr(self, name), count, f"--{name}") for name in ("fx", "fy", "cx", "cy")}
        distortions = _for_each(self.distortion, count, "--distortion")
        units = _for_each(self.unit_mm, count, "--unit-mm")
        axes, depth_range = _axes(self.axes), _depth_range(self.depth_range)
        stated = [
            UserCamera(
                **{name: values[k] for name, values in numbers.items()},
                distortion=_distortion(distortions[k] or ""),
                size=(self.width, self.height),
                depth_unit_m=None if (unit := units[k]) is None else unit / 1000.0,
                fps=self.fps,
                pattern=self.pattern,
                mirrored=self.mirrored,
                axes=axes,
                disparity=self.kinect_disparity,
                depth_range_m=depth_range,
            )
            for k in range(count)
        ]
        if self.kinect_disparity and self.unit_mm:
            raise click.BadParameter("is not a unit of raw disparities; leave it out", param_hint="--unit-mm")
        return stated


def _for_each(values: tuple[T, ...], count: int, option: str) -> Sequence[T | None]:
    """One value for each of the sources: the only one that was given, or one each, or None."""
    if len(values) > 1 and len(values) != count:
        raise click.BadParameter(f"give it once, or once for each of {count} sources", param_hint=option)
    return values if len(values) > 1 else [values[0] if values else None] * count


def _axes(text: str | None) -> str | None:
    from capture.importers.axes import sensor_from_axes

    if text is not None:
        try:
            sensor_from_axes(text)
        except ValueError as error:
            raise click.BadParameter(str(error), param_hint="--axes") from None
    return text


def _depth_range(values: tuple[float, float]) -> tuple[float, float]:
    if not values[0] < values[1] < math.inf:
        raise click.BadParameter("the first must be nearer than the second", param_hint="--depth-range")
    return values


def _distortion(text: str) -> tuple[float, ...]:
    from capture.camera import DISTORTION_LENGTHS

    try:
        values = tuple(float(part) for part in text.split(",") if part.strip())
    except ValueError:
        raise click.BadParameter(f"{text!r} is not a list of numbers", param_hint="--distortion") from None
    if len(values) not in DISTORTION_LENGTHS:
        raise click.BadParameter(f"expected 4, 5, 8, 12 or 14 numbers, got {len(values)}", param_hint="--distortion")
    return values
