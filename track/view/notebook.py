"""A motion in a notebook: the scene in space to turn and play, and a strip of what was tracked."""

from __future__ import annotations

from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory

from adapt.subject import Subject
from capture.recording import Recording
from track.motion import Motion
from track.view.scene import motion_scene


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
    return Shown(frame + motion._repr_html_())
