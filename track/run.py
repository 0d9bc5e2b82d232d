"""Track a whole recording: frame by frame, written as it goes, resumed after a kill.

Each finished frame is a line of ``MOTION/frames.jsonl``. The same command reads it back, drops an incomplete
last line, and goes on from there; the final files replace it at the end.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from adapt.anatomy import Floats
from adapt.fit.correspondences import Target
from adapt.subject import Subject
from capture.errors import CloudError
from capture.fuse import Region, fuse, region_of_interest
from capture.journal import journal_key, resume_journal
from capture.recording import Instant, Recording, instants
from track.ahead import one_ahead
from track.angles import refuse_without_humerus, reported_coordinates, thoraco_humeral
from track.export.opensim_tables import write_mot, write_trc
from track.export.osim_motion import with_coupled
from track.export.quality_table import write_quality
from track.motion import Motion, MotionError, bones_and_centres, coordinate_names, save_motion
from track.shown import known_thetas
from track.tracker import TrackedFrame, Tracker, TrackerState, make_tracker

JOURNAL = "frames.jsonl"


def track_recording(
    recording: Recording,
    subject: Subject,
    out: Path,
    *,
    region: Region | None = None,
    world_from_thorax: Floats | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Motion:
    """Track a subject through a recording and write the motion folder ``out``.

    Args:
        recording: calibrated, or of a single sensor.
        subject: who moves.
        out: the folder to write; a run that was cut short there is continued.
        region: where the limb is, instead of the recording's or the automatic region.
        world_from_thorax: (4, 4), if ISB's thoraco-humeral angles are wanted.
        progress: told how many frames of how many are done.

    Raises:
        MotionError: the folder holds something else, or there is a thorax but no humerus.
        RecordingError, CalibrationError: see ``fuse``.
    """
    if world_from_thorax is not None:
        refuse_without_humerus(subject.anatomy)  # told before the work, not after it
    moments = instants(recording)
    _make_folder(out)
    region = region or region_of_interest(recording)
    person = (subject.body.shape, subject.body.v_hat, subject.thetas, subject.covariance)
    journal = resume_journal(out / JOURNAL, journal_key(recording, *person, region.minimum, region.maximum))
    frames = [_frame(entry) for entry in journal.entries]
    state = _state(journal.entries[-1]["state"]) if journal.entries else None
    tracker = make_tracker(subject)
    left = moments[len(frames) :]
    with closing(one_ahead(partial(ready_target, recording, region), left)) as targets:
        for moment, target in zip(left, targets, strict=True):
            frame, state = _track_one(tracker, moment.time_s, target, state)
            frames.append(frame)
            journal.append({**asdict(frame), "state": None if state is None else asdict(state)})
            progress(len(frames), len(moments))
    motion = _motion(subject, frames)
    write_motion_folder(motion, subject, out, world_from_thorax=world_from_thorax)
    journal.remove()
    return motion


def write_motion_folder(
    motion: Motion, subject: Subject, out: Path, *, world_from_thorax: Floats | None = None
) -> None:
    """Write ``motion.npz``, ``angles.mot``, ``centres.trc`` and ``quality.csv``."""
    thetas = known_thetas(subject.anatomy, motion.thetas, motion.shown)
    columns = reported_coordinates(subject.anatomy, thetas)
    if world_from_thorax is not None:
        root = next(joint for joint in subject.anatomy.joints if joint.type == "free")
        rotation = [subject.anatomy.coordinate_index(name) for name in root.coordinates[:3]]
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


def _track_one(
    tracker: Tracker, time_s: float, target: Target | CloudError, state: TrackerState | None
) -> tuple[TrackedFrame, TrackerState | None]:
    if isinstance(target, CloudError):
        return tracker.missed(time_s, target.problem), state
    return tracker.first(target, time_s) if state is None else tracker.follow(target, time_s, state)


def _motion(subject: Subject, frames: list[TrackedFrame]) -> Motion:
    thetas = np.array([frame.theta for frame in frames])
    shown = np.array([frame.shown for frame in frames])
    transforms, centres = bones_and_centres(subject, thetas, shown)
    deviations = np.array([np.sqrt(np.diag(frame.covariance)) for frame in frames])
    deviations[~np.isfinite(thetas)] = np.nan
    return Motion(
        anatomy=subject.anatomy.name,
        coordinates=coordinate_names(subject.anatomy),
        times=np.array([frame.time_s for frame in frames]),
        thetas=thetas,
        deviations=deviations,
        lost=tuple(frame.lost for frame in frames),
        shown=shown,
        residuals=np.array([frame.residual_m for frame in frames]),
        coverage=np.array([frame.coverage for frame in frames]),
        matches=np.array([frame.matches for frame in frames]),
        transforms=transforms,
        centres=centres,
    )


def _make_folder(out: Path) -> None:
    if out.exists() and not out.is_dir():
        raise MotionError("is a file, not a folder", where=out, remedy="give another name")
    out.mkdir(parents=True, exist_ok=True)
    for left_over in out.glob(".*.partial-*"):  # of a run that was killed while it wrote
        left_over.unlink()
    strange = [path.name for path in out.iterdir() if path.name not in _OWN]
    if strange:
        raise MotionError(f"holds {strange[0]}, which is not a motion's", where=out, remedy="give another folder")


_OWN = {JOURNAL, "motion.npz", "angles.mot", "centres.trc", "quality.csv"}


def _frame(entry: dict[str, Any]) -> TrackedFrame:
    return TrackedFrame(
        time_s=entry["time_s"],
        theta=np.array(entry["theta"], dtype=np.float64),
        covariance=np.array(entry["covariance"], dtype=np.float64),
        shown=np.array(entry["shown"], dtype=bool),
        residual_m=entry["residual_m"],
        coverage=entry["coverage"],
        matches=entry["matches"],
        lost=entry["lost"],
    )


def _state(entry: dict[str, Any] | None) -> TrackerState | None:
    if entry is None:
        return None
    arrays = {name: np.array(entry[name], dtype=np.float64) for name in ("theta", "velocity", "known_s")}
    return TrackerState(**entry | arrays | {"shown": np.array(entry["shown"], dtype=bool)})
