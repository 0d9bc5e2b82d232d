"""Options that say which frames show the calibration box: ``--box`` and ``--box-seconds``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from capture.commands.region_options import Command

if TYPE_CHECKING:
    from capture.importers import ShownBox


def box_options(command: Command) -> Command:
    """Add the options ``--box`` and ``--box-seconds``: which frames show the calibration box."""
    sides = click.option(
        "--box",
        type=click.FloatRange(0, min_open=True),
        nargs=3,
        default=None,
        help="Sides of the calibration box (m).",
    )
    when = click.option(
        "--box-seconds", type=float, nargs=2, default=None, help="From when to when the box, and nobody, is shown (s)."
    )
    return sides(when(command))


def shown_box(
    sides: tuple[float, float, float] | None, seconds: tuple[float, float] | None, sources: tuple[Path, ...] = ()
) -> ShownBox | None:
    """What the options say of the box.

    Raises:
        click.BadParameter: the box is shown, but its sides are not stated; or the time is none.
    """
    from capture.importers import ShownBox

    if sides is None:
        if seconds is not None or sources:
            raise click.BadParameter("its sides are needed where it is said to be shown", param_hint="--box")
        return None
    return ShownBox(sides, time_span(seconds, "--box-seconds"), sources)


def time_span(seconds: tuple[float, float] | None, option: str) -> tuple[float, float] | None:
    """From when to when (s), as an option states it.

    Raises:
        click.BadParameter: the first is not before the second.

    >>> time_span((2.5, 0.0), "--box-seconds")
    Traceback (most recent call last):
        ...
    click.exceptions.BadParameter: the first must be before the second
    """
    if seconds is not None and not seconds[0] < seconds[1]:
        raise click.BadParameter("the first must be before the second", param_hint=option)
    return seconds
