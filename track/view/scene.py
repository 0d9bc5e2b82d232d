"""What there is to look at: a recording, a subject or a motion, joined with what belongs to it, over one timeline."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy import Anatomy, Coordinate, Floats
from adapt.model import pose_space
from adapt.model.body import Body, rest_theta
from adapt.own_anatomy import is_comparable
from adapt.subject import Subject, load_subject
from capture.cloud.fuse import Region
from capture.errors import BonetrackError
from capture.recording import Instant, Recording, instants, open_recording
from capture.rigid import inverse
from track.accuracy.truth import read_truth, world_from_common
from track.belonging import refuse_other_recording, refuse_other_subject
from track.markers.align import at_times
from track.markers.read import MarkerError, read_markers
from track.motion import Motion, MotionError, load_motion
from track.observed_bones import known_thetas

_SAME_S = 1e-3
"""Two times nearer than this are one instant."""


@dataclass(frozen=True, eq=False)
class KnownTruth:
    """The truth of a simulated recording in the recording's frame: body, poses (T, n), where its world stands."""

    body: Body
    thetas: Floats = field(repr=False)  # NaN where the truth has no such time
    common_from_world: Floats = field(repr=False)  # (4, 4)


@dataclass(frozen=True, eq=False)
class Scene:
    """T instants on one timeline; what is not there is None.

    ``numbers`` (T,) are the instants' frame numbers in the recording, ``thetas`` (T, n) the poses to show (NaN where
    there is none).
    """

    title: str
    times: Floats  # (T,) s
    numbers: tuple[int, ...]
    subject: Subject | None = None
    thetas: Floats | None = field(default=None, repr=False)
    motion: Motion | None = None
    recording: Recording | None = None
    moments: tuple[Instant, ...] | None = field(default=None, repr=False)
    truth: KnownTruth | None = None
    markers: dict[str, Floats] | None = field(default=None, repr=False)  # a laboratory's, (T, 3) m, NaN where unknown

    def shows(self, bone: str, k: int) -> bool:
        """Whether a bone's place in frame k is known; where nothing was tracked, everything shown is meant to be."""
        return self.motion is None or bone not in self.motion.hidden(k)

    @cached_property
    def angles(self) -> Floats:
        """The poses (T, n) with NaN for what is not known: what charts and tables show of them."""
        if self.thetas is None or self.subject is None:
            return np.full((len(self.times), 0), np.nan)
        if self.motion is None:
            return self.thetas
        return known_thetas(self.subject.anatomy, self.thetas, self.motion.shown)

    @property
    def region(self) -> Region | None:
        """The region that the motion was tracked in, if that is known."""
        return None if self.motion is None or self.motion.settings is None else self.motion.settings.region

    @property
    def body(self) -> Body | None:
        """Who is shown."""
        return None if self.subject is None else self.subject.body

    @property
    def anatomy(self) -> Anatomy | None:
        """The anatomy of who is shown."""
        return None if self.subject is None else self.subject.anatomy


def open_scene(source: Path, *, subject: Path | None = None, recording: Path | None = None) -> Scene:
    """Open a recording folder, a subject's file or a motion folder with what belongs to it.

    Raises:
        MotionError: ``source`` is none of them, a motion comes without its subject, or they do not belong together.
        RecordingError, AnatomyError: see ``open_recording``, ``load_subject``.
    """
    if (source / "motion.npz").is_file() or source.name == "motion.npz":
        if subject is None:
            problem = "a motion is shown with the subject it belongs to"
            raise MotionError(problem, where=source, remedy="give --subject")
        opened = None if recording is None else open_recording(recording)
        return motion_scene(load_motion(source), load_subject(subject), opened, title=_name(source))
    if source.is_dir():
        person = None if subject is None else load_subject(subject)
        return recording_scene(open_recording(source), person, title=_name(source))
    if not source.exists():
        remedy = "name a recording folder, a subject's file or a motion folder"
        raise MotionError("there is nothing here", where=source, remedy=remedy)
    opened = None if recording is None else open_recording(recording)
    return subject_scene(load_subject(source), opened, title=source.name)


def with_markers(scene: Scene, path: Path) -> Scene:
    """The scene with markers that `bonetrack import-markers` brought into its frame and clock.

    Raises:
        MarkerError: it is no marker file, or none of them is known at the scene's times.
    """
    trial = read_markers(path)
    markers = {name: at_times(trial.times, at, scene.times) for name, at in trial.points.items()}
    if not any(np.isfinite(at).any() for at in markers.values()):
        problem = "knows no marker at any time of what is shown"
        raise MarkerError(problem, where=path, remedy="give the markers.trc that `bonetrack import-markers` wrote")
    return replace(scene, markers=markers)


def motion_scene(motion: Motion, subject: Subject, recording: Recording | None, *, title: str) -> Scene:
    """A motion, with the clouds and the truth of its recording if that is given.

    Raises:
        MotionError: it is one of another subject, or was tracked in another recording.
    """
    refuse_other_subject(motion, subject)
    moments, numbers = None, tuple(range(len(motion.times)))
    if recording is not None:
        refuse_other_recording(motion, recording)
        moments, numbers = _at(recording, motion.times)
    truth = None if recording is None else known_truth(recording, motion.times, subject.anatomy)
    return Scene(title, motion.times, numbers, subject, motion.thetas, motion, recording, moments, truth)


def subject_scene(subject: Subject, recording: Recording | None, *, title: str) -> Scene:
    """A subject: at rest, or in its example poses in the recording they were taken from."""
    if recording is None:
        return Scene(title, np.zeros(1), (0,), subject, rest_theta(subject.body)[None])
    refuse_other_recording(subject, recording)
    moments, numbers = _at(recording, subject.times)
    truth = known_truth(recording, subject.times, subject.anatomy)
    return Scene(title, subject.times, numbers, subject, subject.thetas, None, recording, moments, truth)


def recording_scene(recording: Recording, subject: Subject | None, *, title: str) -> Scene:
    """A recording's clouds; with a subject, whose poses can then be set by hand."""
    moments = tuple(instants(recording))
    times = np.array([moment.time_s for moment in moments])
    truth = known_truth(recording, times, None if subject is None else subject.anatomy)
    thetas = None if subject is None else np.full((len(times), len(subject.anatomy.coordinates)), np.nan)
    return Scene(title, times, tuple(range(len(times))), subject, thetas, None, recording, moments, truth)


def known_truth(recording: Recording, times: Floats, anatomy: Anatomy | None) -> KnownTruth | None:
    """The truth at these times (T,), or None where none is known, or none of this anatomy.

    A recording that is not calibrated has no frame that the truth could be shown in.
    """
    if recording.truth_path is None:
        return None
    try:
        truth = read_truth(recording)
        common_from_world = inverse(world_from_common(recording, truth))
    except BonetrackError:
        return None  # a moving mesh's truth knows no bones
    if anatomy is not None and not is_comparable(truth.body.anatomy, anatomy):
        return None
    nearest = np.abs(truth.times[None, :] - times[:, None]).argmin(axis=1)
    thetas = truth.thetas[nearest].copy()
    thetas[np.abs(truth.times[nearest] - times) > _SAME_S] = np.nan
    return KnownTruth(truth.body, thetas, common_from_world)


def _at(recording: Recording, times: Floats) -> tuple[tuple[Instant, ...], tuple[int, ...]]:
    """The recording's instants at these times (T,) and their numbers."""
    moments = instants(recording)
    known = np.array([moment.time_s for moment in moments])
    nearest = np.abs(known[None, :] - times[:, None]).argmin(axis=1)
    apart = np.abs(known[nearest] - times)
    if (apart > _SAME_S).any():
        problem = f"has no frame at {times[apart.argmax()]:.3f} s"
        raise MotionError(problem, where=recording.path, remedy="give the recording it was made from")
    return tuple(moments[k] for k in nearest), tuple(int(k) for k in nearest)


def _name(path: Path) -> str:
    whole = path.resolve()
    return f"{whole.parent.name}/{whole.name}"


def joint_coordinates(anatomy: Anatomy) -> list[tuple[int, Coordinate]]:
    """Place in theta and description of the coordinates that people call joint angles: all but a free joint's.

    >>> from adapt.anatomy_file import load_anatomy
    >>> [(i, coordinate.name) for i, coordinate in joint_coordinates(load_anatomy("upper-limb-right"))]
    [(6, 'elbow_flexion'), (7, 'pro_sup'), (8, 'deviation'), (9, 'flexion')]
    """
    return [(i, anatomy.coordinates[i]) for i in pose_space.joint_coordinates(anatomy)]


def runs(flags: NDArray[np.bool_]) -> list[slice]:
    """Where the flags (T,) are true without a break.

    >>> runs(np.array([True, True, False, True]))
    [slice(0, 2, None), slice(3, 4, None)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
