"""Tables of the comparison with OpenSim: errors pooled over subjects and motions, side by side."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from adapt.anatomy import Floats
from capture.console import stdout
from capture.own import page_of, replaced_if_own

OURS = "bonetrack"
_TABLE_1 = ("OpenSim scaled 1e-05", "OpenSim misplaced 1e-05")


def comparison_rows(results: list[dict[str, Any]]) -> list[list[str]]:
    """A header; then by kind every tool's error, and how far the scaled model at OpenSim's default is from ours.

    Mean ± SD (maximum) over all frames of all subjects that we tracked.
    """
    tools, compared = list(results[0]["errors"]), next(iter(results[0]["apart"]))
    rows = [["", "unit", *tools, f"{compared} - {OURS}"]]
    share = _share([r["frames"] - r["lost"] for r in results])
    for kind, first in results[0]["errors"][OURS].items():
        cells = [_pooled([r["errors"][tool][kind] for r in results], share) for tool in tools]
        rows.append([kind, first["unit"], *cells, _pooled([r["apart"][compared][kind] for r in results], share)])
    for clock in ("wall", "processor"):
        seconds = [np.mean([r["seconds_per_frame"][tool][clock] for r in results]) for tool in tools]
        rows.append([f"time a frame, {clock}", "ms", *[f"{1e3 * value:.1f}" for value in seconds], ""])
    lost, frames = sum(r["lost"] for r in results), sum(r["frames"] for r in results)
    rows.append(["frames lost", "", f"{lost} of {frames}", *[f"0 of {frames}" for _ in tools[1:]], ""])
    return rows


def motion_rows(results: list[dict[str, Any]]) -> list[list[str]]:
    """The paper's table 1: how far both tools' angles are apart, motion by motion, and how far each is from the truth.

    Mean ± SD (maximum) in degrees; OpenSim at its default accuracy, in the laboratories that could be.
    """
    others = [tool for tool in results[0]["apart"] if tool in _TABLE_1]
    columns = [("errors", OURS), *[(what, tool) for tool in others for what in ("errors", "apart")]]
    names = [f"{tool} - {'truth' if what == 'errors' else OURS}" for what, tool in columns]
    rows = [["motion", "angle", *names]]
    for motion in results[0]["by_motion"]:
        parts = [r["by_motion"][motion] for r in results if motion in r["by_motion"]]
        share = _share([part["scored"] for part in parts])
        for kind in (kind for kind in parts[0]["errors"][OURS] if kind.startswith("angle ")):
            cells = [_pooled([part[what][tool][kind] for part in parts], share) for what, tool in columns]
            rows.append([motion, kind.removeprefix("angle "), *cells])
    return rows


def _share(frames: Sequence[int]) -> Floats:
    """Each subject's share of the frames."""
    return np.asarray(np.array(frames, dtype=np.float64) / sum(frames))


def _pooled(summaries: list[dict[str, Any]], share: Floats) -> str:
    """Mean ± SD (maximum) over subjects' frames from each subject's own."""
    means, deviations = (np.array([s[key] for s in summaries]) for key in ("mean", "sd"))
    mean = float(share @ means)
    deviation = float(np.sqrt(max(0.0, share @ (deviations**2 + means**2) - mean**2)))
    return f"{mean:.2f} ± {deviation:.2f} ({max(s['max'] for s in summaries):.1f})"


def show(results: list[dict[str, Any]], markdown: Path) -> None:
    """Print both tables and write them as Markdown."""
    tables = [comparison_rows(results)] + ([motion_rows(results)] if results[0]["by_motion"] else [])
    text = "\n".join("".join(f"| {' | '.join(row)} |\n" for row in _with_rule(rows)) for rows in tables)
    stdout.print(text, markup=False, highlight=False, soft_wrap=True)
    with replaced_if_own(markdown, page_of(text)) as partial:
        partial.write_text(text, encoding="utf-8")


def _with_rule(rows: list[list[str]]) -> list[list[str]]:
    return [rows[0], ["---"] * len(rows[0]), *rows[1:]]
