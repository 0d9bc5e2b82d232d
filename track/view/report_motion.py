"""Sections of a report about the motion: angles, ranges, quality, what was lost, errors against the truth."""

from __future__ import annotations

import numpy as np

from adapt.plain_words import plain_words
from adapt.subject import Subject
from track.accuracy.errors import Evaluation
from track.motion import Motion
from track.poses_by_hand import UNITS, as_shown
from track.view.page import chart, paragraph, table
from track.view.report_charts import angle_chart, error_chart, quality_chart
from track.view.scene import Scene, joint_coordinates, runs

_NEAR_LIMIT_DEG = 1.0
_NEAR_LIMIT = float(np.deg2rad(_NEAR_LIMIT_DEG))


def angles_section(scene: Scene) -> str:
    """Joint angles over time, drawn with their uncertainty."""
    names = ", ".join(plain_words(c.name).name for _, c in joint_coordinates(subject_of(scene).anatomy))
    words = "Dark band: ± 1 standard deviation; light band: ± 2. Red ground: not known."
    if scene.truth is not None:
        words += " Dashed: the known truth of the simulated recording."
    return paragraph(words) + chart(angle_chart(scene), f"Joint angles over time with their uncertainty: {names}")


def ranges_section(scene: Scene) -> str:
    """Least and largest value of every joint angle, and how near the model's limits they came."""
    motion, angles = motion_of(scene), scene.angles
    rows = []
    for i, coordinate in joint_coordinates(subject_of(scene).anatomy):
        values, unit = angles[:, i], UNITS[coordinate.unit]
        if not np.isfinite(values).any():
            rows.append([f"{plain_words(coordinate.name).label} ({unit})", coordinate.name, *["–"] * 7])
            continue
        low, high = int(np.nanargmin(values)), int(np.nanargmax(values))
        factor = as_shown(coordinate, 1.0)
        cells = []
        for k in (low, high):
            cells += [f"{factor * values[k]:.1f} ± {factor * motion.deviations[k, i]:.1f}", f"{scene.times[k]:.2f}"]
        near = (values - coordinate.low < _NEAR_LIMIT) | (coordinate.high - values < _NEAR_LIMIT)
        cells += [
            f"{factor * (values[high] - values[low]):.1f}",
            f"{factor * coordinate.low:.0f} to {factor * coordinate.high:.0f}",
            f"{100.0 * near.sum() / np.isfinite(values).sum():.0f}",
        ]
        rows.append([f"{plain_words(coordinate.name).label} ({unit})", coordinate.name, *cells])
    head = [
        "joint angle",
        "in files",
        "least ± 1 SD",
        "at (s)",
        "largest ± 1 SD",
        "at (s)",
        "range",
        "model's limits",
        "at a limit (%)",
    ]
    return table("Least and largest value of the frames in which the angle is known", head, rows) + paragraph(
        f"“At a limit” is the share of frames within {_NEAR_LIMIT_DEG:.0f} degree of what the model allows: there the "
        "angle may be larger in truth."
    )


def quality_section(scene: Scene) -> str:
    """How well skin and points agree over time, drawn."""
    words = "How far the skin is from the points, and how much of the skin that should be seen was found there."
    return paragraph(words) + chart(quality_chart(scene), "Distance of skin and points, and coverage, over time")


def lost_section(scene: Scene) -> str:
    """Which frames were not tracked and why, and which bones were out of sight in others."""
    motion = motion_of(scene)
    rows = []
    for run in runs(~motion.tracked):
        reasons = list(dict.fromkeys(motion.lost[run]))
        why = reasons[0] if len(reasons) == 1 else f"{reasons[0]} (and {len(reasons) - 1} like reasons)"
        rows.append([f"{scene.times[run][0]:.3f} to {scene.times[run][-1]:.3f}", str(run.stop - run.start), why])
    parts = [paragraph("Every frame was tracked.")]
    if rows:
        parts = [table("Frames that were not tracked; their poses are not known", ["time (s)", "frames", "why"], rows)]
    hidden = _hidden(scene)
    if hidden:
        head = ["bone", "frames", "times (s)"]
        parts.append(table("Bones out of sight while the rest was tracked: their angles are not known", head, hidden))
    return "\n".join(parts)


def _hidden(scene: Scene) -> list[list[str]]:
    motion = motion_of(scene)
    rows = []
    for name, shows in zip(motion.transforms, motion.shown.T, strict=True):
        unknown = motion.tracked & ~shows
        spans = [f"{scene.times[run][0]:.2f} to {scene.times[run][-1]:.2f}" for run in runs(unknown)]
        if spans:
            rows.append([name, str(int(unknown.sum())), ", ".join(spans)])
    return rows


def errors_section(scene: Scene, evaluation: Evaluation) -> str:
    """Errors against the known truth of a simulated recording, drawn and summed up."""
    rows = []
    for row in evaluation.summaries():
        covered = "" if row.covered is None else f"{100.0 * row.covered:.0f}"
        rows.append(
            [f"{row.name} ({row.unit})", *(f"{v:.2f}" for v in (row.mean, row.sd, row.rms, row.maximum)), covered]
        )
    head = ["error", "mean", "SD", "RMS", "largest", "within 2 stated SD (%)"]
    words = "The recording is simulated, so the truth is known. Of a normal error 95 % should be within two SD."
    about = "Errors of joint centres and joint angles over time"
    return paragraph(words) + chart(error_chart(scene, evaluation), about) + table("Errors by kind", head, rows)


def motion_of(scene: Scene) -> Motion:
    """The motion that a report is of."""
    if scene.motion is None:
        raise TypeError("a report is of a motion")
    return scene.motion


def subject_of(scene: Scene) -> Subject:
    """The subject that a report is of."""
    if scene.subject is None:
        raise TypeError("a report is of a subject")
    return scene.subject
