"""A motion in a notebook: what was tracked as a strip, and the scene in space to turn and play."""

from __future__ import annotations

from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from adapt.subject import Subject
from capture.recording import Recording
from track.motion import Motion
from track.view.scene import motion_scene, runs

_TRACKED, _HIDDEN, _LOST = "#4d8f5b", "#e0a030", "#c0392b"
_WIDTH = 640  # px


@dataclass(frozen=True)
class Shown:
    """What a notebook shows as the last line of a cell."""

    html: str = field(repr=False)

    def _repr_html_(self) -> str:
        return self.html


def show(
    motion: Motion, subject: Subject, recording: Recording | None = None, *, title: str = "motion", height: int = 480
) -> Shown:
    """A motion of the subject in space, to turn and play, ``height`` px high, above a strip of what was tracked.

    The page is that of ``bonetrack view --html`` and stays in the notebook, which needs no network and no server.

    Raises:
        ViewError: viser is not installed.
        MotionError: the motion is one of another subject, or was tracked in another recording.
    """
    from track.view.embedded import write_embedded

    with TemporaryDirectory() as folder:
        page = Path(folder, "scene.html")
        write_embedded(motion_scene(motion, subject, recording, title=title), page)
        inside = escape(page.read_text(encoding="utf-8"))
    frame = f'<iframe style="width:100%;height:{height}px;border:0" sandbox="allow-scripts" srcdoc="{inside}"></iframe>'
    return Shown(frame + summary(motion))


def summary(motion: Motion) -> str:
    """A strip over time as HTML: green where all bones show, orange where some do not, red where a frame was lost."""
    tracked, whole = motion.tracked, motion.tracked & motion.shown.all(axis=1)
    counts = f"{int(tracked.sum())} of {len(tracked)} frames tracked"
    kinds = (
        ("all bones show", whole, _TRACKED),
        ("some do not show", tracked & ~whole, _HIDDEN),
        ("lost", ~tracked, _LOST),
    )
    strip, words = [], []
    for name, flags, colour in kinds:
        if flags.any():
            words.append(f'<span style="color:{colour}">■</span> {name}: {int(flags.sum())}')
        strip += [_bar(part, len(tracked), colour) for part in runs(np.asarray(flags))]
    span = f"{motion.times[0]:.2f} to {motion.times[-1]:.2f} s" if len(motion.times) else ""
    picture = (
        f'<svg width="100%" height="14" viewBox="0 0 {_WIDTH} 14" preserveAspectRatio="none">{"".join(strip)}</svg>'
    )
    return f"<div><b>{escape(motion.anatomy)}</b>: {counts}, {span}<br>{picture}<br>{' &nbsp; '.join(words)}</div>"


def _bar(part: slice, count: int, colour: str) -> str:
    left, wide = _WIDTH * part.start / count, _WIDTH * (part.stop - part.start) / count
    return f'<rect x="{left:.2f}" width="{wide:.2f}" height="14" fill="{colour}"/>'
