"""The picture of a motion's curves: every angle over time with its band, and beside it its cycles and their mean."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from capture.own import PNG, replaced_if_own
from track.curves.cycles import PERCENT
from track.curves.motion_curves import MotionCurves
from track.poses_by_hand import UNITS, as_shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from track.curves.curve import Curve

BLUE, GREY, ORANGE = "#1f5fa8", "#888888", "#b85c00"
_ROW_IN, _DPI = 2.1, 110


def draw_curves(found: MotionCurves, path: Path, *, title: str) -> None:
    """Write the picture as PNG.

    Raises:
        OutputError: something stands there that bonetrack did not write.
    """
    figure = new_figure(len(found.curves), columns=2 if found.cycles else 1, title=title)
    grid = figure.subplots(len(found.curves), 2 if found.cycles else 1, squeeze=False, sharex="col")
    for row, curve in zip(grid, found.curves.values(), strict=True):
        _over_time(row[0], found, curve)
        if found.cycles:
            _over_cycle(row[1], found, curve)
    grid[-1][0].set_xlabel("time (s)")
    if found.cycles:
        grid[-1][1].set_xlabel(f"{found.kind} (%)")
    figure.legend(*grid[0][0].get_legend_handles_labels(), loc="outside lower left", ncols=3, fontsize="small")
    save(figure, path)


def new_figure(rows: int, *, columns: int, title: str) -> Figure:
    """An empty picture for so many charts."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.5 * columns if columns > 1 else 9.0, _ROW_IN * rows + 0.6), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title, fontsize="medium")
    return figure


def save(figure: Figure, path: Path) -> None:
    """Write a picture as PNG, with bonetrack's mark."""
    with replaced_if_own(path, PNG) as partial:
        figure.savefig(partial, format="png", dpi=_DPI, metadata={"Software": "bonetrack"})


def label(axes: Any, curve: Curve) -> None:
    """Say on the y axis what people call the angle, its unit and its own name; zero is drawn where it is near."""
    unit = UNITS[curve.coordinate.unit]
    name = curve.words.label.replace(" (", "\n(")
    axes.set_ylabel(f"{name}\n({unit})", fontsize="small")
    zero = f"; 0 is {curve.words.zero}" if curve.words.zero else ""
    axes.set_title(f"{curve.coordinate.name}{zero}", fontsize="x-small", color=GREY, loc="left")
    axes.grid(color="#e3e3e3", lw=0.6)
    axes.spines[["top", "right"]].set_visible(False)


def _over_time(axes: Any, found: MotionCurves, curve: Curve) -> None:
    factor = as_shown(curve.coordinate, 1.0)
    middle, sd = factor * curve.angle.value, factor * curve.angle.sd
    axes.plot(found.times, factor * curve.raw, ".", color=GREY, ms=2, label="tracked")
    axes.fill_between(found.times, middle - 2.0 * sd, middle + 2.0 * sd, color=BLUE, alpha=0.22, lw=0, label="± 2 SD")
    axes.plot(found.times, middle, color=BLUE, lw=1.3, label="smoothed")
    for cycle in found.cycles:
        axes.axvline(cycle.start, color=ORANGE, lw=0.8)
        axes.axvline(cycle.end, color=ORANGE, lw=0.8, ls=":")
    label(axes, curve)


def _over_cycle(axes: Any, found: MotionCurves, curve: Curve) -> None:
    factor = as_shown(curve.coordinate, 1.0)
    cycles = found.cycle_curves(curve.coordinate.name, "angle")
    axes.plot(PERCENT, factor * cycles.values.T, color=GREY, lw=0.7)
    if len(cycles.kept) > 1:
        middle, sd = factor * cycles.mean, factor * cycles.sd
        axes.fill_between(PERCENT, middle - sd, middle + sd, color=ORANGE, alpha=0.22, lw=0)
        axes.plot(PERCENT, middle, color=ORANGE, lw=1.5)
    for share in [share for number in cycles.kept for _, share in found.cycles[number].marks]:
        axes.axvline(100.0 * share, color=GREY, lw=0.6, ls="--")
    label(axes, curve)
    whole = f"{len(cycles.kept)} whole {found.kind}" + ("s" if len(cycles.kept) != 1 else "")
    whole += "; mean ± 1 SD" if len(cycles.kept) > 1 else ""
    axes.set_title(whole, fontsize="x-small", color=GREY, loc="left")
    axes.set_xlim(0.0, 100.0)
    if not np.isfinite(cycles.values).any():
        axes.text(0.5, 0.5, "none is known as a whole", ha="center", fontsize="small", transform=axes.transAxes)
