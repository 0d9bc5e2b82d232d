"""Options that say where in space to look: ``--region`` and ``--near``."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from capture.recording import Recording, Region


Command = TypeVar("Command", bound=Callable[..., Any])


def region_option(command: Command) -> Command:
    """Add the option ``--region``; ``as_region`` turns its value into a Region."""
    option = click.option(
        "--region",
        nargs=6,
        type=float,
        default=None,
        metavar="X0 Y0 Z0 X1 Y1 Z1",
        help="Use only what is inside this box of the common frame (m), not the recording's or an automatic box.",
    )
    return option(command)


def as_region(values: tuple[float, ...] | None) -> Region | None:
    """The region of six numbers: smallest x, y, z, then largest (m).

    Raises:
        click.BadParameter: a smallest coordinate is not below its largest.

    >>> region = as_region((-0.5, -0.5, 0.8, 0.5, 0.5, 1.6))
    >>> region.minimum.tolist(), region.maximum.tolist()
    ([-0.5, -0.5, 0.8], [0.5, 0.5, 1.6])
    """
    if values is None:
        return None
    import numpy as np

    from capture.recording import Region

    minimum, maximum = np.array(values[:3]), np.array(values[3:])
    if not (minimum < maximum).all():
        raise click.BadParameter("the first three numbers must be below the last three", param_hint="--region")
    return Region(minimum, maximum)


def near_option(command: Command) -> Command:
    """Add the option ``--near``; ``region_near`` turns it and ``--region`` into a Region."""
    option = click.option(
        "--near",
        nargs=3,
        type=float,
        default=None,
        metavar="X Y Z",
        help="Of several people in view, keep the one nearest to this point of the common frame (m).",
    )
    return option(command)


def region_near(
    recording: Recording, region: tuple[float, ...] | None, near: tuple[float, ...] | None
) -> Region | None:
    """The region that the options ``--region`` and ``--near`` state; None where neither is given.

    Raises:
        click.BadParameter: both are given, a point is not finite, or see ``as_region``.
        CloudError: see ``automatic_region``.
    """
    if near is None:
        return as_region(region)
    if region is not None:
        raise click.BadParameter("give either a region or a point, not both", param_hint="--near")
    if not all(math.isfinite(value) for value in near):
        raise click.BadParameter("needs three finite numbers", param_hint="--near")
    import numpy as np

    from capture.cloud.region import automatic_region

    return automatic_region(recording, near=np.array(near))
