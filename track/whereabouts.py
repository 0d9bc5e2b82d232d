"""Where a motion's subject and recording lie, as the motion knows it: commands need not ask.

Kept are the way from the motion's folder, which holds where results are moved as a whole, and the whole path.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from capture.recording.types import HEADER_FILE
from track.motion import Motion, MotionError, load_motion

Places = Mapping[str, Sequence[str]]

SUBJECT, RECORDING = "subject", "recording"


def whereabouts(folder: Path, *, recording: Path, subject: Path | None) -> dict[str, list[str]]:
    """Places of what a motion in this folder is made from; the first that is there is meant.

    >>> found = whereabouts(Path("walk/motion"), recording=Path("walk/recording"), subject=Path("walk/subject.npz"))
    >>> found["recording"][0], found["subject"][0]
    ('../recording', '../subject.npz')
    """
    known = {RECORDING: recording} | ({} if subject is None else {SUBJECT: subject})
    return {name: _ways(folder.resolve(), path.resolve()) for name, path in known.items()}


def _ways(folder: Path, path: Path) -> list[str]:
    try:
        return [Path(os.path.relpath(path, folder)).as_posix(), str(path)]
    except ValueError:  # on another drive, as Windows has them
        return [str(path)]


def subject_of(motion: Motion, folder: Path, given: Path | None = None) -> Path:
    """The file of the motion's subject: the one that is ``given``, else the one that the motion knows.

    Raises:
        MotionError: nobody says which, or it is not where it was.
    """
    found = given or _there(motion, folder, SUBJECT)
    if found is None:
        problem = _gone(motion, SUBJECT) or "does not know where its subject is, for an older version made it"
        raise MotionError(problem, where=folder, remedy="give --subject")
    return found


def recording_of(
    motion: Motion, folder: Path, given: Path | None = None, told: Callable[[str], None] = lambda _: None
) -> Path | None:
    """The folder of the motion's recording: the one that is ``given``, else the one that the motion knows.

    None where that is not there any more, which is ``told`` in a line.
    """
    found = given or _there(motion, folder, RECORDING)
    if found is None and (gone := _gone(motion, RECORDING)):
        told(f"{folder}: {gone}; nothing of it is shown: give --recording")
    return found


def made_from(
    folder: Path, *, subject: Path | None, recording: Path | None, told: Callable[[str], None] = lambda _: None
) -> tuple[Path, Path | None]:
    """Subject and recording of the motion in a folder; see ``subject_of`` and ``recording_of``."""
    if subject is not None and recording is not None:
        return subject, recording
    motion = load_motion(folder)
    return subject_of(motion, folder, subject), recording_of(motion, folder, recording, told)


def is_motion(source: Path) -> bool:
    """Whether a path is a motion's folder, or the file in it."""
    return (source / "motion.npz").is_file() or source.name == "motion.npz"


def _there(motion: Motion, folder: Path, what: str) -> Path | None:
    home = folder if folder.is_dir() else folder.parent
    # Joined with an absolute path, the home drops out.
    candidates = [home / place for place in _places(motion, what)]
    marks = [path / HEADER_FILE if what == RECORDING else path for path in candidates]
    return next((path for path, mark in zip(candidates, marks, strict=True) if mark.is_file()), None)


def _gone(motion: Motion, what: str) -> str | None:
    places = _places(motion, what)
    return f"its {what} is not at {places[-1]} any more" if places else None


def _places(motion: Motion, what: str) -> list[str]:
    return [] if motion.settings is None else [str(place) for place in motion.settings.places.get(what, ())]
