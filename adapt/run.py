"""Adapt an anatomy and write the subject; a run that was cut short goes on where it stopped.

First poses, the longest part, are lines of a journal beside the subject's file while it is not there yet.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from adapt.anatomy import Anatomy, Floats, anatomy_arrays
from adapt.fit.alternate import Progress
from adapt.fit.recording import DEFAULT_POSES, adapt_recording
from adapt.model.shape.population import ANYBODY, Person
from adapt.own_anatomy import kept_anatomy
from adapt.subject import MARK, Subject, save_subject
from capture.cloud.fuse import Region
from capture.errors import BonetrackError
from capture.files import remove_left_over
from capture.journal import MARK as JOURNAL_MARK
from capture.journal import journal_key, resume_journal
from capture.own import refuse_any_foreign
from capture.recording import Recording


def adapt_into(
    out: Path,
    recording: Recording,
    anatomy: Anatomy,
    *,
    poses: int = DEFAULT_POSES,
    frames: Sequence[int] | None = None,
    first_poses: Mapping[int, Floats] | None = None,
    region: Region | None = None,
    person: Person = ANYBODY,
    progress: Progress = lambda _: None,
) -> Subject:
    """``adapt_recording`` with its result written to the file ``out``, and resumed after a kill.

    Raises:
        OutputError: something stands in the place of ``out`` that is no subject.
        AnatomyError: a user's own anatomy is too large for a subject.
        FitError, CloudError, RecordingError, CalibrationError: see ``adapt_recording``.
    """
    refuse_any_foreign({out: MARK, journal_path(out): JOURNAL_MARK})  # told before the work, not after it
    kept_anatomy(anatomy)  # so is one that is too large for a subject
    out.parent.mkdir(parents=True, exist_ok=True)
    remove_left_over(out.parent, [out.name, journal_path(out).name])
    key = _key(recording, anatomy, f"{poses} {frames} {person}", first_poses or {}, region or recording.region)
    journal = resume_journal(journal_path(out), key)
    try:
        subject = adapt_recording(
            recording,
            anatomy,
            poses=poses,
            frames=frames,
            first_poses=first_poses,
            region=region,
            person=person,
            journal=journal,
            progress=progress,
        )
    except BonetrackError:
        journal.remove()
        raise
    save_subject(subject, out)
    journal.remove()
    return subject


def journal_path(out: Path) -> Path:
    """Where the journal of a subject's file stands while the file is being made.

    >>> journal_path(Path("subject.npz")).name
    'subject.npz.partial-journal'
    """
    return out.with_name(f"{out.name}.partial-journal")


def _key(
    recording: Recording, anatomy: Anatomy, options: str, first_poses: Mapping[int, Floats], region: Region | None
) -> str:
    arrays = anatomy_arrays(anatomy).values()
    poses = [part for frame, theta in sorted(first_poses.items()) for part in (str(frame), theta)]
    corners = [] if region is None else [region.minimum, region.maximum]
    return journal_key(recording, repr(anatomy), *arrays, options, *poses, "region", *corners)
