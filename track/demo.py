"""``bonetrack demo``: the whole main job on the sample recording, with errors against the known truth."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from adapt.adapt_to_file import adapt_into
from adapt.anatomy_file import load_anatomy
from adapt.commands import print_subject
from adapt.subject import MARK, Subject
from capture.calibration.calibrate import calibrate_recording, write_calibration
from capture.cloud.fuse import fuse
from capture.console import stdout, tell
from capture.errors import RecordingError
from capture.own import PNG, refuse_any_foreign, refuse_foreign
from capture.progress import Work, progress
from capture.recording import Recording, instants, open_recording
from capture.recording.types import CALIBRATION_FILE
from track.accuracy.commands import print_evaluation
from track.accuracy.errors import MARK as EVALUATION_MARK
from track.accuracy.errors import evaluate_motion, write_evaluation
from track.accuracy.truth import read_truth
from track.motion import Motion
from track.motion_summary import print_motion
from track.track_recording import track_recording
from track.view.charts import plot_angles
from track.view.pictures import picture_fit

ANATOMY = "upper-limb-right"
_SAMPLE = "-sample"
_PICTURES = 3
_FILES = {"subject.npz": MARK, "errors.json": EVALUATION_MARK, "angles.png": PNG}


def run_demo(out: Path, *, anatomy: str = ANATOMY) -> None:
    """Calibrate, adapt, track and evaluate an anatomy's sample recording; write everything into ``out``.

    Raises:
        RecordingError: the sample recording is not at hand.
        OutputError: something stands in a file's place that bonetrack did not write.
    """
    refuse_any_foreign({out / name: mark for name, mark in _FILES.items()})  # told before the work, not after it
    recording = _copy_of_sample(anatomy, out / "recording")
    with _step("calibrating the sensors by the box"):
        write_calibration(recording, calibrate_recording(recording))
        recording = open_recording(recording.path)
    with _step("adapting the anatomy") as work:
        subject = adapt_into(
            out / "subject.npz",
            recording,
            load_anatomy(anatomy),
            progress=lambda words, share: work.at(share, 1.0, words),
            told=tell,
        )
    print_subject(subject, out / "subject.npz")
    with _step("tracking") as work:
        motion = track_recording(
            recording,
            subject,
            out / "motion",
            progress=lambda done, total: work.at(done, total, f"{done} of {total} frames"),
            told=tell,
        )
    print_motion(motion, subject)
    with _step("comparing with the truth"):
        evaluation = evaluate_motion(motion, subject, recording)
        write_evaluation(evaluation, out / "errors.json")
    print_evaluation(evaluation)
    with _step("drawing"):
        pictures = _draw(recording, subject, motion, out)
    for path in pictures:
        stdout.print(f"picture: {path}", highlight=False)


@contextmanager
def _step(what: str) -> Iterator[Work]:
    """Show what is being done, and afterwards how long it took."""
    start = time.perf_counter()
    with progress(what) as work:
        yield work
    stdout.print(f"{what}: {time.perf_counter() - start:.1f} s", highlight=False)


def samples() -> dict[str, Path]:
    """The sample recordings at hand, by anatomy."""
    for folder in (Path(__file__).parents[1] / "recordings", Path("recordings")):
        found = {path.name.removesuffix(_SAMPLE): path for path in sorted(folder.glob(f"*{_SAMPLE}"))}
        if found:
            return found
    return {}


def _copy_of_sample(anatomy: str, to: Path) -> Recording:
    """A copy, so that calibrating leaves the sample as it came; an earlier copy is taken up, nothing else replaced."""
    known = samples()
    if anatomy not in known:
        remedy = f"there are samples of {', '.join(known)}" if known else "run the demo in a checkout of the project"
        raise RecordingError(f"no sample recording of {anatomy}", where=Path("recordings"), remedy=remedy)
    _refuse_other_content(to, known[anatomy])
    shutil.copytree(known[anatomy], to, dirs_exist_ok=True)
    return open_recording(to)


def _refuse_other_content(folder: Path, sample: Path) -> None:
    """Raise RecordingError where a folder holds anything but a copy of the sample, whole or in part."""
    remedy = "give another --out"
    if folder.exists() and not folder.is_dir():
        raise RecordingError("is a file, not a folder", where=folder, remedy=remedy)
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder)
        if path.is_dir() or str(name) == CALIBRATION_FILE:
            continue
        if not (sample / name).is_file() or path.read_bytes() != (sample / name).read_bytes():
            raise RecordingError(f"holds {name}, which is not of the demo's sample", where=folder, remedy=remedy)


def _draw(recording: Recording, subject: Subject, motion: Motion, out: Path) -> list[Path]:
    truth = read_truth(recording)
    written = [out / "angles.png"]
    plot_angles(motion, subject.anatomy, written[0], true_times=truth.times, true_thetas=truth.thetas)
    moments = instants(recording)
    tracked = np.flatnonzero(motion.tracked)
    for number in tracked[np.linspace(0, len(tracked) - 1, min(_PICTURES, len(tracked))).astype(int)]:
        cloud = fuse(recording, moments[number])
        written.append(out / f"fit_{number:04d}.png")
        refuse_foreign(written[-1], PNG)
        title = f"{subject.anatomy.name}, frame {number} of the sample, at {motion.times[number]:.2f} s"
        shown = motion.shown[number]
        picture_fit(subject.body, motion.thetas[number], cloud, written[-1], shown=shown, title=title)
    return written
