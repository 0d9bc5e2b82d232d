"""Adapt an anatomy and write the subject; a run that was cut short goes on where it stopped.

First poses, the longest part, are lines of a journal beside the subject's file while it is not there yet.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from adapt.adapt_recording import adapt_recording
from adapt.anatomy import Anatomy, anatomy_arrays
from adapt.options import AS_USUAL, AdaptOptions
from adapt.own_anatomy import kept_anatomy
from adapt.stages import Progress
from adapt.subject import MARK, Subject, save_subject
from capture.errors import BonetrackError
from capture.files import remove_left_over
from capture.journal import MARK as JOURNAL_MARK
from capture.journal import Told, journal_key, resume_journal
from capture.own import refuse_any_foreign
from capture.recording import Recording


def adapt_into(
    out: Path,
    recording: Recording,
    anatomy: Anatomy,
    options: AdaptOptions = AS_USUAL,
    *,
    progress: Progress = lambda words, share: None,
    told: Told = lambda _: None,
) -> Subject:
    """``adapt_recording`` with its result written to the file ``out``, and resumed after a kill.

    Where an earlier run cannot be gone on with, that is ``told`` in a line.

    Raises:
        OutputError: something stands in the place of ``out`` that is no subject.
        AnatomyError: a user's own anatomy is too large for a subject.
        FitError, CloudError, RecordingError, CalibrationError: see ``adapt_recording``.
    """
    refuse_any_foreign({out: MARK, journal_path(out): JOURNAL_MARK})  # told before the work, not after it
    kept_anatomy(anatomy)  # so is one that is too large for a subject
    out.parent.mkdir(parents=True, exist_ok=True)
    remove_left_over(out.parent, [out.name, journal_path(out).name])
    journal = resume_journal(journal_path(out), _key(recording, anatomy, options), told, result=out)
    try:
        subject = adapt_recording(recording, anatomy, options, journal=journal, progress=progress)
    except BonetrackError:
        journal.remove()
        raise
    save_subject(subject, out)
    journal.remove()
    return replace(subject, path=out)


def journal_path(out: Path) -> Path:
    """Where the journal of a subject's file stands while the file is being made.

    >>> journal_path(Path("subject.npz")).name
    'subject.npz.partial-journal'
    """
    return out.with_name(f"{out.name}.partial-journal")


def _key(recording: Recording, anatomy: Anatomy, options: AdaptOptions) -> str:
    return journal_key(recording, repr(anatomy), *anatomy_arrays(anatomy).values(), *options.decide(recording))
