"""Whether a motion, a subject and a recording belong together: results know what they were made from.

Results of older versions do not say so. Of these a motion's subject is told by how it poses the bones; a recording only
by its times (``track.view.scene``).
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from adapt.model.body import bone_transforms
from adapt.subject import Subject
from capture.recording import Recording
from capture.recording.fingerprint import fingerprint
from track.motion import Motion, MotionError

_SAME_POSE_M = 1e-3  # of an older motion's bones (m, and rad), posed by its subject and as they stand in the file


def subject_fingerprint(subject: Subject) -> str:
    """A digest of what one adaptation found; the file's name and what the report says do not count."""
    digest = hashlib.sha256(subject.anatomy.name.encode())
    for array in (subject.body.shape, subject.thetas, subject.times):
        digest.update(np.ascontiguousarray(array, dtype=np.float64).tobytes())
    return digest.hexdigest()[:32]


def refuse_other_subject(motion: Motion, subject: Subject) -> None:
    """Raise MotionError if the motion is not one of this subject."""
    if motion.anatomy != subject.anatomy.name:
        problem = f"a motion of anatomy {motion.anatomy!r} does not go with a subject of {subject.anatomy.name!r}"
        raise MotionError(problem, remedy="give the subject that was tracked")
    kept = None if motion.settings is None else motion.settings.options.get("subject_fingerprint")
    same = _poses_as_told(motion, subject) if kept is None else kept == subject_fingerprint(subject)
    if not same:
        raise MotionError("the motion is one of another subject", remedy="give the subject that was tracked")


def refuse_other_recording(made: Motion | Subject, recording: Recording) -> None:
    """Raise MotionError if a motion or a subject is known to be made from another recording."""
    options, what = _settings(made), "motion was tracked" if isinstance(made, Motion) else "subject was adapted"
    if _made_elsewhere(options, recording):
        problem = f"is not the recording that the {what} in, which was called {options.get('recording')}"
        raise MotionError(problem, where=recording.path, remedy="give the recording it was made from")


def adapted_elsewhere(subject: Subject, recording: Recording) -> str | None:
    """What to say of a subject that was adapted in another recording than the one it is used in; None if it was not."""
    options = _settings(subject)
    if not _made_elsewhere(options, recording):
        return None
    return (
        f"the subject was adapted in another recording ({options.get('recording')}): "
        "right if it is the same person and the same limb"
    )


def tracked_elsewhere(motion: Motion, subject: Subject) -> str | None:
    """The same of a motion and its subject."""
    here, there = _settings(motion), _settings(subject)
    known = [options.get("recording_fingerprint") for options in (here, there)]
    if None in known or known[0] == known[1]:
        return None
    return f"the subject was adapted in another recording ({there.get('recording')}) than was tracked"


def _settings(made: Motion | Subject) -> Mapping[str, Any]:
    if isinstance(made, Motion):
        return {} if made.settings is None else made.settings.options
    kept = made.report.get("settings")
    return kept if isinstance(kept, Mapping) else {}


def _made_elsewhere(options: Mapping[str, Any], recording: Recording) -> bool:
    kept = options.get("recording_fingerprint")
    return kept is not None and kept != fingerprint(recording)


def _poses_as_told(motion: Motion, subject: Subject) -> bool:
    """Whether the subject in the motion's first known pose has its bones where the motion has them."""
    tracked = np.flatnonzero(np.isfinite(motion.thetas).all(axis=1))
    if not len(tracked) or motion.thetas.shape[1] != len(subject.anatomy.coordinates):
        return not len(tracked)
    posed = bone_transforms(subject.body, motion.thetas[tracked[0]])
    return all(
        name in posed and not (np.abs(posed[name] - told[tracked[0]]) > _SAME_POSE_M).any()  # unknown ones are NaN
        for name, told in motion.transforms.items()
    )
