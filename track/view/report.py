"""The report of a motion: one HTML page that says who was tracked, how well, what moved how far, and what is unsure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from adapt.fit.never_seen import guessed_lengths
from adapt.model.body import rest_theta
from adapt.subject import Subject, doubts
from capture.own import HTML, refuse_foreign, replaced_if_own
from capture.recording import Recording
from capture.settings import sensors_in_words, version_of, versions
from track.accuracy.errors import Evaluation, evaluate_motion
from track.belonging import tracked_elsewhere
from track.motion import Motion
from track.poses_by_hand import UNITS, as_shown
from track.view.measures import Girth, girths, lengths
from track.view.page import bullets, chart, page, paragraph, picture, refuse_without_plotly, table
from track.view.pictures import body_layers
from track.view.render import framing_camera, look_at, render
from track.view.report_charts import angle_chart, error_chart, quality_chart
from track.view.scene import Scene, joint_coordinates, motion_scene, runs

_NEAR_LIMIT_DEG = 1.0


def write_report(motion: Motion, subject: Subject, recording: Recording | None, path: Path, *, title: str) -> None:
    """Write the page.

    Raises:
        ReportError: plotly is not installed.
        OutputError: something stands there that bonetrack did not write.
        MotionError: motion, subject and recording do not belong together.
    """
    refuse_without_plotly()
    refuse_foreign(path, HTML)  # told before the work, not after it
    scene = motion_scene(motion, subject, recording, title=title)
    evaluation = None
    if recording is not None and scene.truth is not None:
        evaluation = evaluate_motion(motion, subject, recording)
    sections = [
        ("Subject", _subject(subject)),
        ("How well the subject fits", _fit(subject)),
        ("Joint angles", _angles(scene)),
        ("Range of motion", _ranges(scene)),
        ("Quality over time", _quality(scene)),
        ("What was lost", _lost(scene)),
        *([("Errors against the truth", _errors(scene, evaluation))] if evaluation is not None else []),
        ("Versions and settings", _versions(scene)),
        ("Limits", bullets(_LIMITS)),
    ]
    text = page(f"Tracked motion, {motion.anatomy}", f"{_lead(scene)} {_doubts(scene, subject)}".strip(), sections)
    with replaced_if_own(path, HTML) as partial:
        partial.write_text(text, encoding="utf-8")


def _lead(scene: Scene) -> str:
    motion = _motion(scene)
    seconds = scene.times[-1] - scene.times[0]
    tracked = int(motion.tracked.sum())
    words = f"{escape(scene.title)}: {tracked} of {len(scene.times)} frames tracked, over {seconds:.2f} s."
    if tracked:
        middle = 1e3 * float(np.median(motion.residuals[motion.tracked]))
        words += f" Skin and points are {middle:.2f} mm apart (median)."
    return words


def _doubts(scene: Scene, subject: Subject) -> str:
    """What could not be told, and which sensors' frames were used."""
    settings = _motion(scene).settings
    elsewhere = tracked_elsewhere(_motion(scene), subject)
    told = [*doubts(subject), *([elsewhere] if elsewhere else [])]
    told += [] if settings is None else sensors_in_words(settings.options)
    return escape(" ".join(f"{line[:1].upper()}{line[1:]}." for line in told))


def _subject(subject: Subject) -> str:
    bones = [
        [
            row.bone,
            row.ends,
            f"{1e3 * row.length_m:.1f}",
            f"{1e3 * row.sd_m:.1f}",
            _against(row.length_m, row.template_m),
        ]
        for row in lengths(subject)
    ]
    around = [
        [_place(row), f"{1e3 * row.girth_m:.0f}", _against(row.girth_m, row.template_m)] for row in girths(subject)
    ]
    head = ["bone", "measured from", "length (mm)", "± 1 SD (mm)", "against template"]
    parts = [
        _portrait(subject),
        table("Lengths of bones, between landmarks of their long axes", head, bones),
        table(
            "Girths of the limb in the rest pose, as a tape around the skin reads, square to the bone",
            ["where", "girth (mm)", "against template"],
            around,
        ),
        paragraph(
            "The template is the anatomy that the subject was adapted from. The SD of a length is what the "
            "fit says of itself; girths have none stated."
        ),
    ]
    return "\n".join(parts)


def _place(row: Girth) -> str:
    return f"{row.bone}, {100 * row.share:.0f} % of the way from {row.start}"


def _against(value: float, template: float) -> str:
    return f"{100.0 * (value / template - 1.0):+.1f} %"


def _portrait(subject: Subject) -> str:
    """The subject at rest from the front and from the side."""
    theta = rest_theta(subject.body)
    layers = body_layers(subject.body, theta)
    skin = layers[-1].vertices
    panels = []
    for direction in (np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])):
        eye = look_at(skin, direction, np.array([0.0, 1.0, 0.0]))
        panels.append(render(layers, eye, framing_camera(eye, skin, width=420, height=520)))
    words = f"The adapted {subject.anatomy.name} in its rest pose, translucent skin with bones inside: front and side."
    return picture(np.concatenate(panels, axis=1), words)


def _fit(subject: Subject) -> str:
    report = subject.report
    rows = [
        [
            f"{pose['time_s']:.3f}",
            str(pose["matches"]),
            f"{pose['median_distance_mm']:.2f}",
            f"{pose['skin_to_cloud_mm']:.2f}",
            f"{100.0 * pose['coverage']:.0f}",
        ]
        for pose in report["poses"]
    ]
    head = ["time (s)", "skin points matched", "median distance (mm)", "mean distance (mm)", "visible skin found (%)"]
    sizes = [[name, f"{size['scale']:.3f}", f"{size['sd']:.3f}"] for name, size in report["scales"].items()]
    unseen = report["landmarks_never_shown"]
    parts = [
        table("The example poses that the subject was adapted to: skin against points", head, rows),
        table("Size at each joint against the template (1 is the template's)", ["joint", "size", "± 1 SD"], sizes),
        paragraph(f"Skin and points disagree by {report['noise_mm']:.1f} mm in patches of 3 cm."),
    ]
    if subject.never_seen:
        guesses = ", ".join(guessed_lengths(subject.anatomy, subject.never_seen))
        words = f"Never seen, so that nothing is claimed of them: {', '.join(subject.never_seen)}. "
        parts.append(paragraph(f"{words}How long these are is a guess: {guesses}."))
    if unseen:
        words = "No sensor saw the skin near these landmarks in any example pose, so their places are the template's "
        parts.append(paragraph(f"{words}scaled: {', '.join(unseen)}."))
    return "\n".join(parts)


def _angles(scene: Scene) -> str:
    names = ", ".join(coordinate.name for _, coordinate in joint_coordinates(_motion_subject(scene).anatomy))
    words = "Dark band: ± 1 standard deviation; light band: ± 2. Red ground: not known."
    if scene.truth is not None:
        words += " Dashed: the known truth of the simulated recording."
    return paragraph(words) + chart(angle_chart(scene), f"Joint angles over time with their uncertainty: {names}")


def _ranges(scene: Scene) -> str:
    motion, angles = _motion(scene), scene.angles
    rows = []
    for i, coordinate in joint_coordinates(_motion_subject(scene).anatomy):
        values, unit = angles[:, i], UNITS[coordinate.unit]
        if not np.isfinite(values).any():
            rows.append([f"{coordinate.name} ({unit})", *["–"] * 7])
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
        rows.append([f"{coordinate.name} ({unit})", *cells])
    head = [
        "joint angle",
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


_NEAR_LIMIT = float(np.deg2rad(_NEAR_LIMIT_DEG))


def _quality(scene: Scene) -> str:
    words = "How far the skin is from the points, and how much of the skin that should be seen was found there."
    return paragraph(words) + chart(quality_chart(scene), "Distance of skin and points, and coverage, over time")


def _lost(scene: Scene) -> str:
    motion = _motion(scene)
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
    motion = _motion(scene)
    rows = []
    for name, shows in zip(motion.transforms, motion.shown.T, strict=True):
        unknown = motion.tracked & ~shows
        spans = [f"{scene.times[run][0]:.2f} to {scene.times[run][-1]:.2f}" for run in runs(unknown)]
        if spans:
            rows.append([name, str(int(unknown.sum())), ", ".join(spans)])
    return rows


def _errors(scene: Scene, evaluation: Evaluation) -> str:
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


def _versions(scene: Scene) -> str:
    subject, tracked = _motion_subject(scene), _motion(scene).settings
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


def _motion(scene: Scene) -> Motion:
    if scene.motion is None:
        raise TypeError("a report is of a motion")
    return scene.motion


def _motion_subject(scene: Scene) -> Subject:
    if scene.subject is None:
        raise TypeError("a report is of a subject")
    return scene.subject


_LIMITS = (
    "Sensors see skin. Bones are placed by an anatomy model that was reshaped until its skin fits; how well they match "
    "this person's own bones has not been measured.",
    "A standard deviation says how far noise of the sensors and what is not known of the body's shape may move an "
    "angle. It does not hold errors of the model itself: skin that slides, muscles that bulge, joints of another kind.",
    "Where the model's joint limit is reached, the angle is held there.",
    "Angles have OpenSim's zero, names and signs, not those of a clinic's protocol.",
    "This is research software, not a medical device.",
)
