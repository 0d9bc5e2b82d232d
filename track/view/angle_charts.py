"""Joint angles over time beside the scene: bands of one and two SD, what is not known marked, and where we are.

Each chart is a small SVG drawing; what does not change from frame to frame is drawn once.
"""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Coordinate, Floats
from adapt.plain_words import plain_words
from track.poses_by_hand import UNITS, as_shown
from track.view.scene import Scene, joint_coordinates, runs

if TYPE_CHECKING:
    import viser

_MOST_SAMPLES = 300  # drawn of a long motion: a chart is sent anew when the frame changes
_WIDTH, _HEIGHT, _LEFT, _RIGHT, _TOP, _BOTTOM = 320.0, 104.0, 34.0, 6.0, 6.0, 16.0
BLUE, TRUTH, LOST, NOW = "#1f5fa8", "#00795a", "#c0392b", "#b85c00"
_INK, _GRID = "#444444", "#e3e3e3"


class AngleCharts:
    """One chart for each joint angle of a scene's poses, in the GUI's current place; ``show`` marks a frame."""

    def __init__(self, server: viser.ViserServer, scene: Scene) -> None:
        self._scene = scene
        coordinates = [] if scene.anatomy is None else joint_coordinates(scene.anatomy)
        self._charts = [(i, c, _chart(scene, i), server.gui.add_html("")) for i, c in coordinates]

    def show(self, k: int, theta: Floats | None, *, by_hand: bool) -> None:
        """Mark frame k, whose pose is theta (n,) if it is known."""
        for i, coordinate, chart, handle in self._charts:
            value = np.nan if theta is None else float(theta[i])
            heading = _heading(self._scene, coordinate, i, k, value, by_hand=by_hand)
            handle.content = f"<div style='padding:0 0.6rem'>{heading}{chart.at(k, as_shown(coordinate, value))}</div>"


@dataclass(frozen=True, eq=False)
class _Chart:
    """The drawing without its end, and what places a moment in it."""

    drawing: str
    times: Floats
    low: float
    high: float

    def at(self, k: int, value: float) -> str:
        """The whole drawing with frame k marked, and its value (deg) if it is known."""
        x = _across(self.times[k], self.times)
        mark = f"<line x1='{x:.1f}' x2='{x:.1f}' y1='{_TOP}' y2='{_HEIGHT - _BOTTOM}' stroke='{NOW}'/>"
        if np.isfinite(value):
            mark += f"<circle cx='{x:.1f}' cy='{_down(value, self.low, self.high):.1f}' r='3.5' fill='{NOW}'/>"
        return f"{self.drawing}{mark}</svg>"


def _chart(scene: Scene, i: int) -> _Chart:
    coordinate = scene.anatomy.coordinates[i] if scene.anatomy is not None else None
    drawn = np.unique(np.linspace(0, len(scene.times) - 1, _MOST_SAMPLES).round().astype(int))
    times = scene.times[drawn]
    angle = np.full(len(drawn), np.nan) if scene.thetas is None else np.rad2deg(scene.angles[drawn, i])
    spread = np.zeros(len(drawn)) if scene.motion is None else np.rad2deg(scene.motion.deviations[drawn, i])
    truth = np.full(len(drawn), np.nan) if scene.truth is None else np.rad2deg(scene.truth.thetas[drawn, i])
    low, high = _limits(np.concatenate([angle - 2.0 * spread, angle + 2.0 * spread, truth]))
    name = "" if coordinate is None else plain_words(coordinate.name).label
    parts = [_axes(times, low, high)]
    if scene.motion is not None:
        parts += _unknown(times, ~np.isfinite(angle))
    for span in runs(np.isfinite(angle)):
        for factor, opacity in ((2.0, 0.15), (1.0, 0.25)):
            parts.append(_band(times[span], angle[span], factor * spread[span], opacity, times, low, high))
    parts += [_line(times[s], truth[s], TRUTH, times, low, high, dash="4 3") for s in runs(np.isfinite(truth))]
    parts += [_line(times[s], angle[s], BLUE, times, low, high) for s in runs(np.isfinite(angle))]
    about = f"{escape(name)} over time, in degrees over seconds"
    start = f"<svg viewBox='0 0 {_WIDTH:.0f} {_HEIGHT:.0f}' width='100%' role='img' aria-label='{about}'>"
    return _Chart(start + "".join(parts), scene.times, low, high)


def _heading(scene: Scene, coordinate: Coordinate, i: int, k: int, value: float, *, by_hand: bool) -> str:
    """The coordinate's name, its value in frame k, one standard deviation, and the truth."""
    unit = "°" if UNITS[coordinate.unit] == "deg" else " m"
    text = "not known"
    if np.isfinite(value):
        text = f"{as_shown(coordinate, value):.1f}{unit}"
        spread = np.nan if scene.motion is None or by_hand else scene.motion.deviations[k, i]
        if np.isfinite(spread):
            text += f" ± {as_shown(coordinate, float(spread)):.1f}{unit}"
    true = np.nan if scene.truth is None else scene.truth.thetas[k, i]
    if np.isfinite(true):
        known = f"truth {as_shown(coordinate, float(true)):.1f}{unit}"
        text += f" <span style='color:{TRUTH}'>{known}</span>"
    return (
        "<div style='display:flex;justify-content:space-between;font-size:0.8rem'>"
        f"<b title='{escape(coordinate.name)}'>{escape(plain_words(coordinate.name).label)}</b>"
        f"<span class='angle' data-coordinate='{escape(coordinate.name)}'>{text}</span>"
        "</div>"
    )


def _limits(values: Floats) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    if not len(known):
        return -1.0, 1.0
    margin = max(1.0, 0.06 * float(np.ptp(known)))
    return float(known.min()) - margin, float(known.max()) + margin


def _across(time: Any, times: Floats) -> Any:
    duration = max(float(times[-1] - times[0]), 1e-9)
    return _LEFT + (_WIDTH - _LEFT - _RIGHT) * (time - times[0]) / duration


def _down(value: Any, low: float, high: float) -> Any:
    return _TOP + (_HEIGHT - _TOP - _BOTTOM) * (high - value) / (high - low)


def _axes(times: Floats, low: float, high: float) -> str:
    parts = []
    for value in _ticks(low, high, 4):
        y = _down(value, low, high)
        parts.append(f"<line x1='{_LEFT}' x2='{_WIDTH - _RIGHT}' y1='{y:.1f}' y2='{y:.1f}' stroke='{_GRID}'/>")
        parts.append(f"<text x='{_LEFT - 4}' y='{y + 3:.1f}' text-anchor='end'>{value:g}°</text>")
    for value in _ticks(float(times[0]), float(times[-1]), 5):
        x = _across(value, times)
        parts.append(f"<text x='{x:.1f}' y='{_HEIGHT - 4:.1f}' text-anchor='middle'>{value:g} s</text>")
    return f"<g font-size='9' fill='{_INK}' font-family='sans-serif'>{''.join(parts)}</g>"


def _ticks(low: float, high: float, about: int) -> list[float]:
    """Round numbers in [low, high], ``about`` so many of them."""
    if high <= low:
        return [low]
    raw = (high - low) / about
    unit = 10.0 ** np.floor(np.log10(raw))
    step = unit * next(m for m in (1.0, 2.0, 2.5, 5.0, 10.0) if m * unit >= raw)
    return [float(v) for v in np.round(np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step, 9) + 0.0]


def _unknown(times: Floats, unknown: NDArray[np.bool_]) -> list[str]:
    """Red ground where an angle is not known."""
    half = 0.5 * float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    parts = []
    for span in runs(unknown):
        left, right = _across(times[span][0] - half, times), _across(times[span][-1] + half, times)
        left, right = max(left, _LEFT), min(right, _WIDTH - _RIGHT)
        box = f"x='{left:.1f}' y='{_TOP}' width='{max(right - left, 1.0):.1f}' height='{_HEIGHT - _TOP - _BOTTOM}'"
        parts.append(f"<rect {box} fill='{LOST}' opacity='0.22'/>")
    return parts


def _band(
    times: Floats, middle: Floats, half: Floats, opacity: float, all_times: Floats, low: float, high: float
) -> str:
    x, y = np.concatenate([times, times[::-1]]), np.concatenate([middle + half, (middle - half)[::-1]])
    corners = _points(_across(x, all_times), _down(y, low, high))
    return f"<polygon points='{corners}' fill='{BLUE}' opacity='{opacity}'/>"


def _line(
    times: Floats, values: Floats, colour: str, all_times: Floats, low: float, high: float, *, dash: str = ""
) -> str:
    points = _points(_across(times, all_times), _down(values, low, high))
    dashed = f" stroke-dasharray='{dash}'" if dash else ""
    return f"<polyline points='{points}' fill='none' stroke='{colour}' stroke-width='1.4'{dashed}/>"


def _points(x: Floats, y: Floats) -> str:
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))


LEGEND = (
    "<div style='font-size:0.72rem;line-height:1.5;padding:0 0.6rem'>"
    f"<b style='color:{BLUE}'>&#9473;</b>&nbsp;angle, bands ±&nbsp;1 and ±&nbsp;2&nbsp;SD "
    f"<b style='color:{TRUTH}'>&#9476;</b>&nbsp;truth <b style='color:{LOST};opacity:0.5'>&#9608;</b>&nbsp;not known "
    f"<b style='color:{NOW}'>&#9679;</b>&nbsp;this frame</div>"
)
