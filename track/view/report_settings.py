"""Section of a report about what made it: versions, settings, the recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from capture.provenance import version_of, versions
from capture.recording import Recording
from track.view.page import paragraph, table
from track.view.report_motion import motion_of, subject_of
from track.view.scene import Scene


def versions_section(scene: Scene) -> str:
    """The software and the settings that made subject and motion, and the recording."""
    subject, tracked = subject_of(scene), motion_of(scene).settings
    adapted = subject.report.get("settings")
    made = [("subject", adapted and adapted["versions"]), ("motion", tracked and tracked.versions)]
    made.append(("page", versions() | {"plotly": version_of("plotly")}))
    known = [(name, stated) for name, stated in made if stated]
    programs = list(dict.fromkeys(program for _, stated in known for program in stated))
    rows = [[program, *(stated.get(program, "") for _, stated in known)] for program in programs]
    parts = [
        table("The software that made them", ["", *(name for name, _ in known)], rows),
        paragraph(f"Anatomy {subject.anatomy.name}, {len(subject.body.v_hat)} skin vertices."),
    ]
    if adapted:
        options = {name: value for name, value in adapted.items() if name != "versions"}
        parts.append(_settings("How the subject was adapted", options))
    if tracked is not None:
        parts.append(_settings("How the motion was tracked", tracked.options))
        parts.append(_settings("What tracking decides by", tracked.thresholds))
    older = [name for name, stated in made if not stated]
    if older:
        parts.append(paragraph(f"Of the {' and the '.join(older)} no settings are known: an older version made it."))
    if scene.recording is not None:
        parts.append(_recording(scene.recording))
    return "\n".join(parts)


def _settings(caption: str, settings: Mapping[str, Any]) -> str:
    return table(caption, ["setting", "value"], [[name, _in_words(value)] for name, value in settings.items()])


def _in_words(value: Any) -> str:
    """A setting as people read it.

    >>> _in_words([{"name": "start", "frame": 3}]), _in_words([0.1, -1 / 3, 2]), _in_words(None)
    ('name start, frame 3', '0.1, -0.3333, 2', 'none')
    """
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_in_words(part)}" for key, part in value.items())
    if isinstance(value, Sequence) and not isinstance(value, str):
        nested = any(isinstance(part, Mapping | list) for part in value)
        return ("; " if nested else ", ").join(_in_words(part) for part in value) or "none"
    if isinstance(value, float):
        return f"{value:.4g}"
    return "none" if value is None else str(value)


def _recording(recording: Recording) -> str:
    rows = []
    for sensor in recording.sensors:
        times = np.array([frame.time_s for frame in sensor.frames])
        rate = f"{1.0 / np.median(np.diff(times)):.1f}" if len(times) > 1 else "–"
        known = None if recording.calibration is None else recording.calibration.sensors.get(sensor.name)
        residual = "–" if known is None or known.residual_mm is None else f"{known.residual_mm:.2f}"
        size = f"{sensor.camera.width} x {sensor.camera.height}"
        rows.append([sensor.name, size, str(len(times)), rate, residual])
    head = ["sensor", "image", "frames", "frames a second", "calibration residual (mm)"]
    return table(f"Recording {recording.path.name}", head, rows)
