"""Sections of a report about the subject: lengths, girths, and how well it fits."""

from __future__ import annotations

import numpy as np

from adapt.fit.never_seen import guessed_lengths
from adapt.model.body import rest_theta
from adapt.plain_words import landmark_words
from adapt.subject import Subject
from track.view.measures import Girth, girths, lengths
from track.view.page import paragraph, picture, table
from track.view.pictures import body_layers
from track.view.render import framing_camera, look_at, render


def subject_section(subject: Subject) -> str:
    """What the subject looks like: two pictures, lengths of bones, girths of the limb."""
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


def fit_section(subject: Subject) -> str:
    """How well the subject fits the poses that it was adapted to, and what was never seen."""
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
        parts.append(paragraph(f"{words}scaled: {', '.join(map(landmark_words, unseen))}."))
    return "\n".join(parts)
