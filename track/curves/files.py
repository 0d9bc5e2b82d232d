"""The curves of a motion as files: tidy tables (CSV), a summary (JSON) and a picture.

Angles are in degrees, lengths of joints that slide in metres; ``unit`` says which. Every row has the coordinate's own
name and what people call it.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from adapt.anatomy import Coordinate, Floats
from capture.own import PNG, Mark, json_of, refuse_any_foreign, replaced_if_own, table_of
from track.about import About
from track.curves.curve import Curve
from track.curves.cycles import PERCENT
from track.curves.figure import draw_curves
from track.curves.motion_curves import CurvesOptions, MotionCurves
from track.curves.norms import norm_of
from track.curves.ranges import Extreme, peak, range_of
from track.export.tables import Table, write_csv
from track.poses_by_hand import UNITS, as_shown

FORMAT = "bonetrack-curves"


def write_curves(found: MotionCurves, options: CurvesOptions, about: About, out: Path, *, title: str) -> list[Path]:
    """Write ``curves``, ``events``, ``cycles`` and ``mean_cycle`` (CSV), ``summary.json`` and ``curves.png``.

    Raises:
        OutputError: something stands in a file's place that bonetrack did not write; nothing is written then.
    """
    tables = {f"{name}.csv": table for name, table in curve_tables(found).items()}
    marks: dict[Path, Mark] = {out / name: table_of(list(table)) for name, table in tables.items()}
    refuse_any_foreign(marks | {out / "summary.json": json_of(FORMAT), out / "curves.png": PNG})
    out.mkdir(parents=True, exist_ok=True)
    written = [write_csv(out / name, table) for name, table in tables.items()]
    with replaced_if_own(out / "summary.json", json_of(FORMAT)) as partial:
        partial.write_text(_text(summary(found, options, about, title=title)), encoding="utf-8")
    draw_curves(found, out / "curves.png", title=title)
    return [*written, out / "summary.json", out / "curves.png"]


def curve_tables(found: MotionCurves) -> dict[str, Table]:
    """The tables by name: a row for every frame, event, percent of a cycle, and percent of the mean cycle."""
    return {
        "curves": _long([_curve_rows(found, curve) for curve in found.curves.values()]),
        "events": {
            "time_s": np.array([event.time for event in found.events], dtype=float),
            "event": np.array([event.name for event in found.events], dtype=object),
        },
        "cycles": _long([_cycle_rows(found, curve) for curve in found.curves.values()]),
        "mean_cycle": _long([_mean_rows(found, curve) for curve in found.curves.values()]),
    }


def summary(found: MotionCurves, options: CurvesOptions, about: About, *, title: str) -> dict[str, Any]:
    """What there is to say of a motion's curves in numbers, by coordinate."""
    durations = np.array([cycle.end - cycle.start for cycle in found.cycles])
    marks = {name for cycle in found.cycles for name, _ in cycle.marks}
    return {
        "format": FORMAT,
        "motion": title,
        "about": asdict(about),
        "anatomy": found.anatomy.name,
        "options": asdict(options),
        "told": list(found.told),
        "cycles": {
            "kind": found.kind,
            "by": found.by,
            "count": len(found.cycles),
            "duration_s": _mean_and_sd(durations),
            "percent_of": {
                mark: _mean_and_sd(100.0 * np.array([dict(cycle.marks)[mark] for cycle in found.cycles]))
                for mark in sorted(marks)
            },
        },
        "coordinates": {name: _coordinate(found, curve) for name, curve in found.curves.items()},
    }


def _coordinate(found: MotionCurves, curve: Curve) -> dict[str, Any]:
    coordinate, words, norm = curve.coordinate, curve.words, norm_of(curve.coordinate.name)
    factor = as_shown(coordinate, 1.0)
    span = range_of(curve, found.times)
    spans = np.ptp(found.cycle_curves(coordinate.name, "angle").extremes, axis=1)
    told: dict[str, Any] = {
        "name": words.name,
        "positive": words.positive,
        "zero": words.zero,
        "unit": UNITS[coordinate.unit],
        "cutoff_hz": curve.cutoff_hz,
        "cutoff_from": curve.chosen,
        "noise_of_a_frame": factor * curve.noise,
        "spans_s": [[float(found.times[s.start]), float(found.times[s.stop - 1])] for s in curve.spans],
        "range_in_cycles": _mean_and_sd(factor * spans),
        "healthy": None if norm is None else asdict(norm),
    }
    if span is not None:
        told |= {"least": _extreme(span.low, factor), "largest": _extreme(span.high, factor)}
        told |= {"range": {"value": factor * span.span, "sd": factor * span.span_sd}}
    for name, quantity in (("peak_velocity", curve.velocity), ("peak_acceleration", curve.acceleration)):
        top = peak(quantity, found.times)
        told[name] = None if top is None else _extreme(top, factor)
    return told


def _extreme(at: Extreme, factor: float) -> dict[str, float]:
    return {"value": factor * at.value, "sd": factor * at.sd, "time_s": at.time}


def _mean_and_sd(values: Floats) -> dict[str, float | int | None]:
    """Mean, standard deviation between them and count; None where there are too few."""
    count = len(values)
    sd = float(np.std(values, ddof=1)) if count > 1 else None
    return {"mean": float(np.mean(values)) if count else None, "sd": sd, "count": count}


def _curve_rows(found: MotionCurves, curve: Curve) -> Table:
    factor = as_shown(curve.coordinate, 1.0)
    angle, velocity, acceleration = curve.angle, curve.velocity, curve.acceleration
    return {
        "time_s": found.times,
        **_named(curve.coordinate, curve, len(found.times)),
        "tracked": factor * curve.raw,
        "value": factor * angle.value,
        "value_sd": factor * angle.sd,
        "value_lasting_sd": factor * angle.lasting,
        "velocity_per_s": factor * velocity.value,
        "velocity_sd_per_s": factor * velocity.sd,
        "acceleration_per_s2": factor * acceleration.value,
        "acceleration_sd_per_s2": factor * acceleration.sd,
    }


def _cycle_rows(found: MotionCurves, curve: Curve) -> Table:
    factor, name = as_shown(curve.coordinate, 1.0), curve.coordinate.name
    cycles = found.cycle_curves(name, "angle")
    count = len(PERCENT) * len(cycles.kept)
    starts = [found.cycles[number].start for number in cycles.kept]
    return {
        "cycle": np.repeat(np.array([number + 1 for number in cycles.kept], dtype=int), len(PERCENT)),
        "start_s": np.repeat(np.array(starts, dtype=float), len(PERCENT)),
        "percent": np.tile(PERCENT, len(cycles.kept)),
        **_named(curve.coordinate, curve, count),
        "value": factor * cycles.values.ravel(),
    }


def _mean_rows(found: MotionCurves, curve: Curve) -> Table:
    factor, name = as_shown(curve.coordinate, 1.0), curve.coordinate.name
    cycles = found.cycle_curves(name, "angle")
    return {
        "percent": PERCENT,
        **_named(curve.coordinate, curve, len(PERCENT)),
        "cycles": np.full(len(PERCENT), len(cycles.kept)),
        "mean": factor * cycles.mean,
        "sd_between_cycles": factor * cycles.sd,
        "lasting_sd": factor * found.lasting_cycle(name),
    }


def _named(coordinate: Coordinate, curve: Curve, count: int) -> Table:
    words = {"coordinate": coordinate.name, "name": curve.words.label, "unit": UNITS[coordinate.unit]}
    return {column: np.full(count, word, dtype=object) for column, word in words.items()}


def _long(parts: list[Table]) -> Table:
    return {column: np.concatenate([part[column] for part in parts]) for column in parts[0]}


def _text(told: dict[str, Any]) -> str:
    return json.dumps(told, indent=1, allow_nan=False) + "\n"
