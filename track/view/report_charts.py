"""The charts of a report: joint angles with their uncertainty, quality over time, errors where the truth is known."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Floats
from adapt.plain_words import plain_words
from track.poses_by_hand import UNITS, as_shown
from track.view.scene import Scene, joint_coordinates, runs

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

    from track.accuracy.errors import Evaluation

BLUE, TRUTH, LOST = "#1f5fa8", "#00795a", "#c0392b"
_ROW_PX, _FONT = 170, "system-ui, sans-serif"


def angle_chart(scene: Scene) -> Figure:
    """One row for each joint angle: bands of one and two SD, the truth, and what is not known on red ground."""
    coordinates = [] if scene.anatomy is None else joint_coordinates(scene.anatomy)
    figure = _rows([coordinate.name for _, coordinate in coordinates])
    angles = scene.angles
    for row, (i, coordinate) in enumerate(coordinates, start=1):
        unit = UNITS[coordinate.unit]
        factor = as_shown(coordinate, 1.0)
        angle = factor * angles[:, i]
        spread = np.zeros(len(angle)) if scene.motion is None else factor * scene.motion.deviations[:, i]
        for sds, opacity in ((2, 0.16), (1, 0.30)):
            band = _band(scene.times, angle, sds * spread)
            colour = f"rgba(31,95,168,{opacity})"
            area: dict[str, Any] = {"fill": "toself", "fillcolor": colour, "line": {"width": 0}, "hoverinfo": "skip"}
            _add(figure, row, *band, f"± {sds} SD", **area)
        if scene.truth is not None:
            truth = factor * scene.truth.thetas[:, i]
            _add(figure, row, scene.times, truth, "truth", line={"color": TRUTH, "width": 1.6, "dash": "dash"})
        _add(figure, row, scene.times, angle, "tracked", line={"color": BLUE, "width": 1.6})
        _mark_unknown(figure, row, scene.times, ~np.isfinite(angle))
        told = plain_words(coordinate.name).label.replace(" (", "<br>(")
        figure.update_yaxes(title_text=f"{told}<br>({unit})", row=row, col=1)
    return figure


def quality_chart(scene: Scene) -> Figure:
    """Distance of skin and cloud (mm) and share of the visible skin that was found (%), over time."""
    figure = _rows(["distance", "coverage"])
    if scene.motion is not None:
        line = {"color": BLUE, "width": 1.6}
        _add(figure, 1, scene.times, 1e3 * scene.motion.residuals, "skin to points (median)", line=line)
        _add(figure, 2, scene.times, 100.0 * scene.motion.coverage, "visible skin found", line=line)
        for row in (1, 2):
            _mark_unknown(figure, row, scene.times, ~scene.motion.tracked)
    figure.update_yaxes(title_text="skin to points<br>(mm)", rangemode="tozero", row=1, col=1)
    figure.update_yaxes(title_text="visible skin<br>found (%)", range=[0, 104], row=2, col=1)
    figure.update_layout(showlegend=False)
    return figure


def error_chart(scene: Scene, evaluation: Evaluation) -> Figure:
    """Errors of joint centres (mm) and of joint angles (deg) against the truth, over time."""
    figure = _rows(["centres", "angles"])
    for row, kind in ((1, "centre "), (2, "angle ")):
        names = [name for name in evaluation.errors if name.startswith(kind)]
        for number, name in enumerate(names):
            line = {"color": _COLOURS[number % len(_COLOURS)], "width": 1.5, "dash": _DASHES[row]}
            _add(figure, row, scene.times, evaluation.errors[name], name, once=False, line=line)
    figure.update_yaxes(title_text="joint centres<br>(mm)", rangemode="tozero", row=1, col=1)
    figure.update_yaxes(title_text="joint angles<br>(deg, absolute)", rangemode="tozero", row=2, col=1)
    figure.update_layout(height=_ROW_PX * 2 + 150, legend={"y": -0.18, "yanchor": "top"})
    return figure


_COLOURS = ("#1f5fa8", "#b85c00", "#00795a", "#8e44ad", "#7f6a00", "#c0392b", "#555555")
_DASHES = {1: "solid", 2: "dot"}


def _rows(names: list[str]) -> Figure:
    from plotly.subplots import make_subplots

    count = max(1, len(names))
    figure = make_subplots(rows=count, cols=1, shared_xaxes=True, vertical_spacing=min(0.06, 0.3 / count))
    figure.update_layout(
        height=_ROW_PX * count + 80,
        margin={"l": 80, "r": 12, "t": 36, "b": 44},
        template="plotly_white",
        font={"family": _FONT, "size": 12, "color": "#222222"},
        legend={"orientation": "h", "x": 0, "y": 1.0, "yanchor": "bottom"},
        hovermode="x unified",
    )
    figure.update_xaxes(showgrid=False, ticks="outside", hoverformat=".3f")
    figure.update_yaxes(hoverformat=".2f", gridcolor="#e3e3e3")
    figure.update_xaxes(title_text="time (s)", row=count, col=1)
    return figure


def _add(figure: Figure, row: int, x: Floats, y: Floats, name: str, *, once: bool = True, **look: Any) -> None:
    """A line or area; ``once``: the legend tells of it only for the first row."""
    from plotly.graph_objects import Scatter

    look = {"mode": "lines"} | look
    trace = Scatter(x=x, y=y, name=name, legendgroup=name, showlegend=row == 1 or not once, **look)
    figure.add_trace(trace, row=row, col=1)


def _band(times: Floats, middle: Floats, half: Floats) -> tuple[Floats, Floats]:
    """The border of middle +- half: a closed line for each run of known values, with NaN between them."""
    x: list[Floats] = []
    y: list[Floats] = []
    gap = np.array([np.nan])
    for run in runs(np.isfinite(middle) & np.isfinite(half)):
        upper, lower = middle[run] + half[run], middle[run] - half[run]
        x += [times[run], times[run][::-1], gap]
        y += [upper, lower[::-1], gap]
    return (np.concatenate(x), np.concatenate(y)) if x else (np.zeros(0), np.zeros(0))


def _mark_unknown(figure: Figure, row: int, times: Floats, unknown: NDArray[np.bool_]) -> None:
    half = 0.5 * float(np.median(np.diff(times))) if len(times) > 1 else 0.5
    for run in runs(unknown):
        ends = {"x0": times[run][0] - half, "x1": times[run][-1] + half}
        figure.add_vrect(**ends, fillcolor=LOST, opacity=0.18, line_width=0, row=row, col=1)
