"""The report of a motion: one HTML page that says who was tracked, how well, what moved how far, and what is unsure."""

from __future__ import annotations

from html import escape
from pathlib import Path

import numpy as np

from adapt.subject import Subject, doubts
from capture.own import HTML, refuse_foreign, replaced_if_own
from capture.provenance import sensors_in_words
from capture.recording import Recording
from track.about import About
from track.accuracy.errors import evaluate_motion
from track.belonging import tracked_elsewhere
from track.motion import Motion
from track.view.page import bullets, page, refuse_without_plotly
from track.view.report_motion import (
    angles_section,
    errors_section,
    lost_section,
    motion_of,
    quality_section,
    ranges_section,
)
from track.view.report_settings import versions_section
from track.view.report_subject import fit_section, subject_section
from track.view.report_summary import summary_section
from track.view.scene import Scene, motion_scene


def write_report(
    motion: Motion,
    subject: Subject,
    recording: Recording | None,
    path: Path,
    *,
    title: str,
    about: About | None = None,
) -> None:
    """Write the page. It begins with what whoever treats the person needs (``track.view.report_summary``).

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
    about = about or About()
    sections = [
        ("At a glance", summary_section(scene, about)),
        ("Subject", subject_section(subject)),
        ("How well the subject fits", fit_section(subject)),
        ("Joint angles", angles_section(scene)),
        ("Range of motion", ranges_section(scene)),
        ("Quality over time", quality_section(scene)),
        ("What was lost", lost_section(scene)),
        *([("Errors against the truth", errors_section(scene, evaluation))] if evaluation is not None else []),
        ("Versions and settings", versions_section(scene)),
        ("Limits", bullets(_LIMITS)),
    ]
    text = page(
        about.title or f"Tracked motion, {motion.anatomy}",
        f"{_lead(scene)} {_doubts(scene, subject)}".strip(),
        sections,
    )
    with replaced_if_own(path, HTML) as partial:
        partial.write_text(text, encoding="utf-8")


def _lead(scene: Scene) -> str:
    motion = motion_of(scene)
    seconds = scene.times[-1] - scene.times[0]
    tracked = int(motion.tracked.sum())
    words = f"{escape(scene.title)}: {tracked} of {len(scene.times)} frames tracked, over {seconds:.2f} s."
    if tracked:
        middle = 1e3 * float(np.median(motion.residuals[motion.tracked]))
        words += f" Skin and points are {middle:.2f} mm apart (median)."
    return words


def _doubts(scene: Scene, subject: Subject) -> str:
    """What could not be told, and which sensors' frames were used."""
    settings = motion_of(scene).settings
    elsewhere = tracked_elsewhere(motion_of(scene), subject)
    told = [*doubts(subject), *([elsewhere] if elsewhere else [])]
    told += [] if settings is None else sensors_in_words(settings.options)
    return escape(" ".join(f"{line[:1].upper()}{line[1:]}." for line in told))


_LIMITS = (
    "Sensors see skin. Bones are placed by an anatomy model that was reshaped until its skin fits; how well they match "
    "this person's own bones has not been measured.",
    "A standard deviation says how far noise of the sensors and what is not known of the body's shape may move an "
    "angle. It does not hold errors of the model itself: skin that slides, muscles that bulge, joints of another kind.",
    "Where the model's joint limit is reached, the angle is held there.",
    "Angles have OpenSim's zero, names and signs, not those of a clinic's protocol.",
    "This is research software, not a medical device.",
)
