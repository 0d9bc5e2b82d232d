"""A comparison as files: numbers and differences (CSV), a summary (JSON) and a picture."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from capture.own import PNG, Mark, json_of, refuse_any_foreign, replaced_if_own, table_of
from track.curves.comparison import Compared, Comparison
from track.curves.cycles import PERCENT
from track.curves.figure import GREY, new_figure, save
from track.export.tables import Table, write_csv

if TYPE_CHECKING:
    from track.curves.parametric_mapping import Mapping1D

FORMAT = "bonetrack-comparison"
Mapped = Mapping[tuple[str, str], "Mapping1D"]
"""What parametric mapping says, by the angle's key and the group that is compared with the first."""
_COLOURS = ("#1f5fa8", "#b85c00", "#00795a", "#8e44ad", "#7f6a00", "#c0392b", "#555555")


def write_comparison(found: Comparison, mapped: Mapped, out: Path) -> list[Path]:
    """Write ``numbers``, ``differences`` and ``mean_cycles`` (CSV), ``comparison.json`` and ``comparison.png``.

    Raises:
        OutputError: something stands in a file's place that bonetrack did not write; nothing is written then.
    """
    tables = {f"{name}.csv": table for name, table in comparison_tables(found).items()}
    marks: dict[Path, Mark] = {out / name: table_of(list(table)) for name, table in tables.items()}
    refuse_any_foreign(marks | {out / "comparison.json": json_of(FORMAT), out / "comparison.png": PNG})
    out.mkdir(parents=True, exist_ok=True)
    written = [write_csv(out / name, table) for name, table in tables.items()]
    with replaced_if_own(out / "comparison.json", json_of(FORMAT)) as partial:
        partial.write_text(json.dumps(_summary(found, mapped), indent=1, allow_nan=False) + "\n", encoding="utf-8")
    _draw(found, mapped, out / "comparison.png")
    return [*written, out / "comparison.json", out / "comparison.png"]


def comparison_tables(found: Comparison) -> dict[str, Table]:
    """A row for every number, for every percent of every difference, and for every percent of every mean cycle."""
    pairs = [(angle, k) for angle in found.angles for k in range(len(found.labels) - 1)]
    numbers = [(angle, k, number) for angle, k in pairs for number in angle.numbers[k]]
    return {
        "numbers": {
            **_named([angle for angle, _, _ in numbers], [found.labels[k + 1] for _, k, _ in numbers], found.labels[0]),
            "number": np.array([number.name for *_, number in numbers], dtype=object),
            "first_value": np.array([number.first for *_, number in numbers]),
            "value": np.array([number.other for *_, number in numbers]),
            "difference": np.array([number.difference for *_, number in numbers]),
            "low_95": np.array([number.low for *_, number in numbers]),
            "high_95": np.array([number.high for *_, number in numbers]),
            "symmetry_percent": np.array([np.nan if n.symmetry is None else n.symmetry for *_, n in numbers]),
        },
        "differences": {
            **_named(*_repeated(pairs, found), found.labels[0]),
            "percent": np.tile(PERCENT, len(pairs)),
            "difference": np.concatenate([angle.differences[k].value for angle, k in pairs]),
            "low_95": np.concatenate([angle.differences[k].low for angle, k in pairs]),
            "high_95": np.concatenate([angle.differences[k].high for angle, k in pairs]),
        },
        "mean_cycles": _means(found),
    }


def _repeated(pairs: list[tuple[Compared, int]], found: Comparison) -> tuple[list[Compared], list[str]]:
    """The angle and the group of every row of the differences."""
    rows = [pair for pair in pairs for _ in PERCENT]
    return [angle for angle, _ in rows], [found.labels[k + 1] for _, k in rows]


def _means(found: Comparison) -> Table:
    rows = [(angle, sample) for angle in found.angles for sample in angle.samples]
    spread = [(angle, sample) for angle, sample in rows for _ in PERCENT]
    return {
        "group": np.array([sample.label for _, sample in spread], dtype=object),
        "coordinate": np.array([angle.key for angle, _ in spread], dtype=object),
        "name": np.array([angle.words.label for angle, _ in spread], dtype=object),
        "unit": np.array([angle.unit for angle, _ in spread], dtype=object),
        "percent": np.tile(PERCENT, len(rows)),
        "cycles": np.array([len(sample.values) for _, sample in spread]),
        "mean": np.concatenate([sample.mean for _, sample in rows]),
        "sd": np.concatenate([sample.sd for _, sample in rows]),
    }


def _named(angles: list[Compared], groups: list[str], first: str) -> Table:
    return {
        "group": np.array(groups, dtype=object),
        "against": np.full(len(groups), first, dtype=object),
        "coordinate": np.array([angle.key for angle in angles], dtype=object),
        "name": np.array([angle.words.label for angle in angles], dtype=object),
        "unit": np.array([angle.unit for angle in angles], dtype=object),
    }


def _summary(found: Comparison, mapped: Mapped) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "groups": {
            label: {angle.key: len(angle.samples[k].values) for angle in found.angles}
            for k, label in enumerate(found.labels)
        },
        "cycles": found.kind,
        "told": list(found.told),
        "parametric_mapping": [
            {
                "coordinate": key,
                "group": group,
                "threshold_t": one.threshold,
                "differs": [{"from_percent": a, "to_percent": b, "p": p} for a, b, p in one.clusters],
            }
            for (key, group), one in mapped.items()
        ],
    }


def _draw(found: Comparison, mapped: Mapped, path: Path) -> None:
    figure = new_figure(len(found.angles), columns=2, title=f"{' / '.join(found.labels)}, by {found.kind}")
    grid = figure.subplots(len(found.angles), 2, squeeze=False, sharex=True)
    for (left, right), angle in zip(grid, found.angles, strict=True):
        for colour, sample in zip(_colours(found), angle.samples, strict=True):
            left.plot(PERCENT, sample.mean, color=colour, lw=1.4, label=f"{sample.label} ({len(sample.values)})")
            left.fill_between(PERCENT, sample.mean - sample.sd, sample.mean + sample.sd, color=colour, alpha=0.2, lw=0)
        right.axhline(0.0, color=GREY, lw=0.8)
        for colour, label, one in zip(_colours(found)[1:], found.labels[1:], angle.differences, strict=True):
            right.plot(PERCENT, one.value, color=colour, lw=1.4)
            right.fill_between(PERCENT, one.low, one.high, color=colour, alpha=0.2, lw=0)
            for start, end, _ in mapped[angle.key, label].clusters if (angle.key, label) in mapped else ():
                right.axvspan(start, end, color=colour, alpha=0.15, lw=0)
        _label(left, right, angle, found.labels[0])
    for axes in grid[-1]:
        axes.set_xlabel(f"{found.kind} (%)")
        axes.set_xlim(0.0, 100.0)
    figure.legend(*grid[0][0].get_legend_handles_labels(), loc="outside lower left", ncols=4, fontsize="small")
    save(figure, path)


def _colours(found: Comparison) -> list[str]:
    return [_COLOURS[k % len(_COLOURS)] for k in range(len(found.labels))]


def _label(left: Any, right: Any, angle: Compared, first: str) -> None:
    wrapped = angle.words.label.replace(" (", "\n(")
    left.set_ylabel(f"{wrapped}\n({angle.unit})", fontsize="small")
    left.set_title(f"{angle.key}; mean ± 1 SD", fontsize="x-small", color=GREY, loc="left")
    right.set_title(f"difference from {first}, with its 95 % interval", fontsize="x-small", color=GREY, loc="left")
    for axes in (left, right):
        axes.grid(color="#e3e3e3", lw=0.6)
        axes.spines[["top", "right"]].set_visible(False)
