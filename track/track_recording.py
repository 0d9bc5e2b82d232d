"""Track a whole recording: frame by frame, written as it goes, resumed after a kill.

Each finished frame is a line of ``MOTION/frames.jsonl``. The same command reads it back, drops an incomplete
last line and up to four before it, and goes on from there; the final files replace it at the end. After the last frame
the gaps are gone into backward (``track.backward_pass``); those lines tell the anchor that tracking went back from.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from adapt.anatomy import Floats
from adapt.fit.posterior import deviations
from adapt.match.correspondences import Target
from adapt.model.pose_space import reported_coordinates, root_coordinates
from adapt.subject import Subject
from capture.cloud.fuse import Region, fuse, region_of_interest
from capture.errors import CloudError
from capture.files import left_over, remove_left_over
from capture.journal import MARK as JOURNAL_MARK
from capture.journal import Journal, Told, journal_key, resume_journal
from capture.own import refuse_any_foreign
from capture.recording import Instant, Recording, instants, refuse_useless_depth
from track.angles import refuse_without_humerus, thoraco_humeral
from track.backward_pass import anchors, go_back
from track.belonging import subject_fingerprint
from track.export.opensim_tables import MOT, TRC, write_mot, write_trc
from track.export.osim_joints import follower_columns
from track.export.osim_motion import with_coupled
from track.export.quality_table import QUALITY, write_quality
from track.first_look import refuse_a_stranger, refuse_two_limbs
from track.motion import MARK, Motion, MotionError, bones_and_centres, coordinate_names, save_motion
from track.observed_bones import known_thetas
from track.options import AS_USUAL, TrackOptions
from track.out_of_step import in_step
from track.prefetch import one_ahead
from track.settings import Settings
from track.tracked_frame import TrackedFrame, TrackerState
from track.tracker import Tracker, make_tracker
from track.whereabouts import whereabouts

JOURNAL = "frames.jsonl"
_ANCHOR = "anchor"  # names the journal's lines of frames tracked backward
_STATE, _EVERY = "state", 5  # what tracking goes on from stands beside every fifth frame: so few are tracked again

Progress = Callable[[int, int], None]
"""Told how many frames of how many are done."""


def track_recording(
    recording: Recording,
    subject: Subject,
    out: Path,
    options: TrackOptions = AS_USUAL,
    *,
    progress: Progress = lambda done, total: None,
    told: Told = lambda _: None,
) -> Motion:
    """Track a subject through a recording and write the motion folder ``out``.

    Args:
        recording: calibrated, or of a single sensor.
        subject: who moves.
        out: the folder to write; a run that was cut short there is continued.
        options: where to look, from which poses, and what decides.
        progress: told how many frames of how many are done; gaps that are gone into backward count on.
        told: told in a line if a run that was cut short cannot be continued.

    Raises:
        OutputError: a file of the folder has a motion's name, but is none that bonetrack wrote.
        MotionError: the folder holds something else, there is no frame of a pose's number, a thorax but no humerus,
            the recording does not show the subject, or two limbs that could be the subject's.
        RecordingError, CalibrationError: see ``fuse``.
    """
    if options.world_from_thorax is not None:
        refuse_without_humerus(subject.anatomy)  # told before the work, not after it
    refuse_useless_depth(recording)
    moments = instants(recording)
    by_hand = options.by_frame(len(moments))
    _make_folder(out)
    tracker = make_tracker(subject, options.thresholds)
    settings = options.used(recording, subject=subject_fingerprint(subject), thresholds=tracker.decided_by())
    settings = replace(settings, places=whereabouts(out, recording=recording.path, subject=subject.path))
    region = options.region or region_of_interest(recording)
    key = _key(recording, tracker, options, region)
    journal = resume_journal(out / JOURNAL, key, told, goes_on=lambda entry: _STATE in entry)
    looks_first = not (by_hand or options.keep_searching)
    work = _Work(tracker, recording, region, moments, journal, looks_first=looks_first)
    frames = work.forward(by_hand, progress)
    frames = work.backward(frames, progress)
    motion = _motion(subject, in_step(subject.anatomy, frames), settings)
    write_motion_folder(motion, subject, out, world_from_thorax=options.world_from_thorax)
    journal.remove()
    return motion


def _key(recording: Recording, tracker: Tracker, options: TrackOptions, region: Region) -> str:
    """What a journal must have been begun with to be gone on with."""
    subject = tracker.subject
    person = (subject.body.shape, subject.body.v_hat, subject.thetas, subject.covariance, str(tracker.usual_m))
    return journal_key(recording, *person, *options.decide(region))


@dataclass(frozen=True)
class _Work:
    """What is tracked, and the journal in which finished frames stand."""

    tracker: Tracker
    recording: Recording
    region: Region
    moments: list[Instant]
    journal: Journal
    looks_first: bool

    def forward(self, by_hand: Mapping[int, Floats], progress: Progress) -> list[TrackedFrame]:
        """All frames in order of time."""
        done = [entry for entry in self.journal.entries if _ANCHOR not in entry]
        frames = [_frame(entry) for entry in done]
        state = _state(done[-1][_STATE]) if done else self.tracker.nothing_known()
        left = self.moments[len(frames) :]
        with closing(one_ahead(self._target, left)) as targets:
            for moment, target in zip(left, targets, strict=True):
                before = state
                frame, state = self._track(moment.time_s, target, state, by_hand.get(len(frames)))
                if self.looks_first and not np.isfinite(before.time_s):
                    self._look_first(frame, target, first=not frames)
                frames.append(frame)
                self.journal.append(asdict(frame) | self._kept(state, len(frames)))
                progress(len(frames), len(self.moments))
        return frames

    def _kept(self, state: TrackerState, count: int) -> dict[str, Any]:
        """What the journal's line of the last of ``count`` frames says of the state."""
        return {_STATE: asdict(state)} if count % _EVERY == 0 or count == len(self.moments) else {}

    def _look_first(self, frame: TrackedFrame, target: Target | CloudError, *, first: bool) -> None:
        """Refuse a recording that does not show the subject, or shows it twice, by the frames up to the first find."""
        if first and frame.lost:
            refuse_a_stranger(self.tracker, self.moments, frame, self._target, self.recording.path)
        elif not frame.lost and isinstance(target, Target):
            refuse_two_limbs(self.tracker, target, frame, self.recording.path)

    def backward(self, frames: list[TrackedFrame], progress: Progress) -> list[TrackedFrame]:
        """The frames with the gaps gone into from behind."""
        done = {(e[_ANCHOR], e["index"]): e for e in self.journal.entries if _ANCHOR in e}
        count = len(frames)

        def step(anchor: int, k: int, state: TrackerState) -> tuple[TrackedFrame, TrackerState]:
            nonlocal count
            count += 1
            if (anchor, k) not in done:
                target = self._target(self.moments[k])
                frame, state = self._track(-self.moments[k].time_s, target, state, searching=False)
                entry = {_ANCHOR: anchor, "index": k, **asdict(frame), _STATE: asdict(state)}
                self.journal.append(entry)
                progress(count, count)
                return frame, state
            entry = done[anchor, k]
            return _frame(entry), _state(entry[_STATE])

        for anchor in anchors(frames):
            frames = go_back(self.tracker, frames, anchor, partial(step, anchor))
        return frames

    def _target(self, moment: Instant) -> Target | CloudError:
        return ready_target(self.recording, self.region, moment)

    def _track(
        self,
        time_s: float,
        target: Target | CloudError,
        state: TrackerState,
        given: Floats | None = None,
        *,
        searching: bool = True,
    ) -> tuple[TrackedFrame, TrackerState]:
        if isinstance(target, CloudError):
            return self.tracker.missed(time_s, target.problem), state
        if given is not None:
            return self.tracker.given(target, time_s, given, state)
        return self.tracker.follow(target, time_s, state, searching=searching)


def write_motion_folder(
    motion: Motion, subject: Subject, out: Path, *, world_from_thorax: Floats | None = None
) -> None:
    """Write ``motion.npz``, ``angles.mot``, ``centres.trc`` and ``quality.csv``."""
    thetas = known_thetas(subject.anatomy, motion.thetas, motion.shown)
    columns = reported_coordinates(subject.anatomy, thetas) | follower_columns(subject.body, motion.transforms)
    if world_from_thorax is not None:
        rotation = root_coordinates(subject.anatomy)[:3]
        columns |= thoraco_humeral(world_from_thorax, thetas, rotation, side=subject.anatomy.side)
    write_mot(out / "angles.mot", motion.times, with_coupled(subject.anatomy, columns))
    write_trc(out / "centres.trc", motion.times, motion.centres)
    write_quality(out / "quality.csv", motion, subject.anatomy)
    save_motion(motion, out)


def ready_target(recording: Recording, region: Region, moment: Instant) -> Target | CloudError:
    """The cloud of one instant, ready to be searched, or why there is none."""
    try:
        target = Target(fuse(recording, moment, region=region))
    except CloudError as error:
        return error
    _ = target.parts  # worked out here and now
    return target


def _motion(subject: Subject, frames: list[TrackedFrame], settings: Settings) -> Motion:
    thetas = np.array([frame.theta for frame in frames])
    shown = np.array([frame.shown for frame in frames])
    transforms, centres = bones_and_centres(subject, thetas, shown)
    sure = np.where(np.isfinite(thetas), deviations(np.array([frame.covariance for frame in frames])), np.nan)
    return Motion(
        anatomy=subject.anatomy.name,
        coordinates=coordinate_names(subject.anatomy),
        times=np.array([frame.time_s for frame in frames]),
        thetas=thetas,
        deviations=sure,
        lost=tuple(frame.lost for frame in frames),
        how=tuple("" if frame.lost else frame.how for frame in frames),
        shown=shown,
        residuals=np.array([frame.residual_m for frame in frames]),
        coverage=np.array([frame.coverage for frame in frames]),
        matches=np.array([frame.matches for frame in frames]),
        transforms=transforms,
        centres=centres,
        settings=settings,
    )


def _make_folder(out: Path) -> None:
    if out.exists() and not out.is_dir():
        raise MotionError("is a file, not a folder", where=out, remedy="give another name")
    out.mkdir(parents=True, exist_ok=True)
    strange = {path.name for path in out.iterdir()} - set(_OWN) - {path.name for path in left_over(out, _OWN)}
    if strange:
        raise MotionError(f"holds {min(strange)}, which is not a motion's", where=out, remedy="give another folder")
    refuse_any_foreign({out / name: mark for name, mark in _OWN.items()})
    remove_left_over(out, _OWN)


_OWN = {JOURNAL: JOURNAL_MARK, "motion.npz": MARK, "angles.mot": MOT, "centres.trc": TRC, "quality.csv": QUALITY}


def _frame(entry: dict[str, Any]) -> TrackedFrame:
    return TrackedFrame(
        time_s=entry["time_s"],
        theta=np.array(entry["theta"], dtype=np.float64),
        covariance=np.array(entry["covariance"], dtype=np.float64),
        shown=np.array(entry["shown"], dtype=bool),
        residual_m=entry["residual_m"],
        skin_m=entry["skin_m"],
        coverage=entry["coverage"],
        matches=entry["matches"],
        lost=entry["lost"],
        how=entry["how"],
        late=np.array(entry["late"], dtype=np.float64).reshape((len(entry["late"]),) * 2),
    )


def _state(entry: dict[str, Any]) -> TrackerState:
    arrays = {name: np.array(entry[name], dtype=np.float64) for name in ("theta", "velocity", "known_s", "look")}
    return TrackerState(**entry | arrays | {"shown": np.array(entry["shown"], dtype=bool)})
