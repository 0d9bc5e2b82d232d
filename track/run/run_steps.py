"""A run: the steps one after the other, each by its own command, those that are done passed over."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from capture.console import tell
from capture.recording import open_recording
from capture.recording.types import CALIBRATION_FILE, HEADER_FILE
from track.run import choices as chosen
from track.run.choices import Choices, RunError
from track.run.done import DoneSteps, digest, file_digest, recording_digest, sources_digest
from track.run.steps import ADAPT, CALIBRATE, EXPORT, IMPORT, REPORT, STEPS, TRACK, Step

RECORDING, SUBJECT, MOTION, EXPORTS, PAGE = "recording", "subject.npz", "motion", "exports", "report.html"


@dataclass(frozen=True)
class Run:
    """A run into the folder ``out`` with its choices."""

    out: Path
    choices: Choices

    @property
    def files(self) -> list[Path]:
        """The sensors' files, or the recording."""
        return [Path(file) for file in self.choices.files]

    @property
    def recording(self) -> Path:
        """The recording's folder: the one that was given, or the one that is made here."""
        given = _is_recording(self.files[0]) if len(self.files) == 1 else False
        return self.files[0] if given else self.out / RECORDING

    def go(self) -> None:
        """Do what is not done yet.

        Raises:
            BonetrackError, OSError: see the commands of the steps.
        """
        for step, work in (
            (IMPORT, self._import),
            (CALIBRATE, self._calibrate),
            (ADAPT, self._adapt),
            (TRACK, self._track),
            (EXPORT, self._export),
            (REPORT, self._report),
        ):
            if step.name in self.choices.leave_out:
                tell(f"{_head(step)} left out")
            else:
                work()
        tell(f"results are in {self.out}, choices in {self.out / chosen.FILE}")

    def refuse_what_cannot_be(self) -> None:
        """Tell before the work what can be told before it.

        Raises:
            RunError: files are missing or do not go together, or the limb is not stated.
            ReportError: a report is wanted, and what it needs is not installed.
        """
        where = self.out / chosen.FILE
        if not self.files:
            raise RunError("no files are named", where=where, remedy="give the sensors' files, or a recording's folder")
        recordings = [file for file in self.files if _is_recording(file)]
        if recordings and len(self.files) > 1:
            remedy = "give one recording, or files of sensors"
            raise RunError("is a recording, and there are other files beside it", where=recordings[0], remedy=remedy)
        for file in self.files:
            if not file.exists():
                raise RunError("does not exist", where=file, remedy="name a sensor's file, or a recording's folder")
        if "anatomy" not in self.choices.of(ADAPT):
            raise RunError("which limb is not stated", where=where, remedy="give --anatomy, such as upper-limb-right")
        if REPORT.name not in self.choices.leave_out:
            from track.view.page import refuse_without_plotly

            refuse_without_plotly()

    def _import(self) -> None:
        if self.recording != self.out / RECORDING:
            tell(f"{_head(IMPORT)} {self.recording} is a recording already")
            return
        words = ["--out", str(self.recording), "--overwrite"]
        made_from = sources_digest(self.files)
        self._do(IMPORT, made_from, [*words, "--", *map(str, self.files)], lambda: [self.recording / HEADER_FILE])

    def _calibrate(self) -> None:
        """Where there are several sensors, unless somebody calibrated the recording that was given."""
        recording, asked = open_recording(self.recording), self.choices.of(CALIBRATE)
        if len(recording.sensors) == 1 and not asked:
            tell(f"{_head(CALIBRATE)} one sensor needs none")
            return
        if recording.calibration is not None and not asked and not self._done.knows(CALIBRATE.name):
            tell(f"{_head(CALIBRATE)} {self.recording} is calibrated already")
            return
        inside = self.recording == self.out / RECORDING
        made = [self.recording / CALIBRATION_FILE] if inside else []
        made_from = recording_digest(self.recording, calibrated=False)
        there = recording.calibration is not None
        self._do(CALIBRATE, made_from, ["--", str(self.recording)], lambda: made, there=there)

    def _adapt(self) -> None:
        subject = self.out / SUBJECT
        words = ["--out", str(subject), "--", str(self.recording)]
        self._do(ADAPT, recording_digest(self.recording), words, lambda: [subject])

    def _track(self) -> None:
        subject, motion = self.out / SUBJECT, self.out / MOTION
        made_from = recording_digest(self.recording) + file_digest(subject)
        words = ["--subject", str(subject), "--out", str(motion), "--", str(self.recording)]
        self._do(TRACK, made_from, words, lambda: _files_in(motion))

    def _export(self) -> None:
        """The motion's tables and the subject's model, in one folder, as OpenSim wants them."""
        subject, motion, out = self.out / SUBJECT, self.out / MOTION, self.out / EXPORTS
        made_from = file_digest(motion / "motion.npz") + file_digest(subject)
        words = ["--subject", str(subject), "--out", str(out), "--", str(motion)]

        def made() -> list[Path]:
            _command(EXPORT, ["--out", str(out), "--", str(subject)], self._where)
            return _files_in(out)

        self._do(EXPORT, made_from, words, made)

    def _report(self) -> None:
        subject, motion, page = self.out / SUBJECT, self.out / MOTION, self.out / PAGE
        made_from = file_digest(motion / "motion.npz") + file_digest(subject) + recording_digest(self.recording)
        words = ["--subject", str(subject), "--recording", str(self.recording), "--out", str(page), "--", str(motion)]
        self._do(REPORT, made_from, words, lambda: [page])

    def _do(
        self, step: Step, made_from: str, words: Sequence[str], made: Callable[[], list[Path]], *, there: bool = True
    ) -> None:
        """A step, unless it is done and what it made is ``there``; ``made`` says afterwards which files it made."""
        asked = self.choices.of(step)
        told = digest(asked, made_from)
        if there and self._done.is_done(step.name, told):
            tell(f"{_head(step)} done before, with the same choices")
            return
        tell(_head(step))
        _command(step, [*step.arguments(asked), *words], self._where)
        self._done.note(step.name, told, made())

    @property
    def _done(self) -> DoneSteps:
        return DoneSteps(self.out)

    @property
    def _where(self) -> Path:
        return self.out / chosen.FILE


def _command(step: Step, words: Sequence[str], where: Path) -> Any:
    """Run a step's command; what it finds wrong in its options is told of the file that has them."""
    try:
        return step.command.main(list(words), prog_name=f"bonetrack {step.name}", standalone_mode=False)
    except click.UsageError as error:
        remedy = "change it there, or on the command line"
        raise RunError(f"[{step.name}] {error.format_message()}", where=where, remedy=remedy) from error


def _head(step: Step) -> str:
    """Which step of how many.

    >>> _head(TRACK)
    'step 4 of 6, track:'
    """
    return f"step {STEPS.index(step) + 1} of {len(STEPS)}, {step.name}:"


def _is_recording(path: Path) -> bool:
    return (path / HEADER_FILE).is_file()


def _files_in(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())
