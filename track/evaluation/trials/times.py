"""Times and units: sensors out of step, images repeated, clocks in milliseconds, angles in degrees."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adapt.anatomy_file import load_anatomy
from capture.recording import open_recording
from capture.recording.types import FRAMES_FILE
from track.evaluation.trials.command import bonetrack
from track.evaluation.trials.fit import judged, refused
from track.evaluation.trials.people import ARM, sound
from track.evaluation.trials.recorded import Made, performance_of, record
from track.evaluation.trials.situation import Outcome, Situation
from track.simulation.simulate import performance_rig

Times = list[float]


def with_times(change: Callable[[Times], Times], *, sensors: tuple[int, ...]) -> Callable[[int, Path], Made]:
    """A sound arm; the stated times of some sensors' frames are changed."""

    def make(seed: int, folder: Path) -> Made:
        made = sound(ARM)(seed, folder)
        names = [sensor.name for sensor in open_recording(folder).sensors]
        for number in sensors:
            change_times(folder / names[number] / FRAMES_FILE, change)
        return made

    return make


def change_times(path: Path, change: Callable[[Times], Times]) -> None:
    """Rewrite the times of a sensor's list of frames."""
    with path.open(newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    times = change([float(row[1]) for row in rows])
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows(
            [header, *([r[0], t] for r, t in zip(rows, times, strict=True))]
        )


def out_of_step(phase: float) -> Callable[[int, Path], Made]:
    """The second sensor looks a share of a frame's period later, and its clock says so rightly.

    The limb is seen by each sensor when its clock says: every sensor has recorded a performance of its own times.
    """

    def make(seed: int, folder: Path) -> Made:
        performance = performance_of(ARM, seed)
        rig = performance_rig(performance, seed=seed)
        truth = record(performance, folder, seed=seed, rig=rig)
        period = float(performance.times[1] - performance.times[0])
        times = performance.times + phase * period
        thetas = np.column_stack([np.interp(times, performance.times, c) for c in performance.thetas.T])
        other = folder.parent / "late"
        record(replace(performance, times=times, thetas=thetas), other, seed=seed, rig=rig)
        late = rig.sensors[1].name
        for path in (other / late).glob("*"):
            path.replace(folder / late / path.name)
        every = np.sort(np.concatenate([performance.times, times]))
        poses = np.column_stack([np.interp(every, performance.times, c) for c in performance.thetas.T])
        rewrite_truth(folder, times_s=every, theta=poses)
        return Made(folder, ARM, replace(truth, times=every, thetas=poses))

    return make


def rewrite_truth(folder: Path, **arrays: NDArray[Any]) -> None:
    """Replace arrays of a recording's truth."""
    path = folder / "truth.npz"
    with np.load(path, allow_pickle=False) as truth:
        known: dict[str, Any] = {name: truth[name] for name in truth.files} | arrays
    np.savez(path, **known)


def repeated_images(seed: int, folder: Path) -> Made:
    """The second sensor hangs: from its fourth image on it repeats that one under new times."""
    made = sound(ARM)(seed, folder)
    sensor = open_recording(folder).sensors[1]
    for frame in sensor.frames[4:]:
        frame.path.write_bytes(sensor.frames[3].path.read_bytes())
    return made


def _scaled(factor: float) -> Callable[[Times], Times]:
    return lambda times: [factor * time for time in times]


def _shifted(seconds: float) -> Callable[[Times], Times]:
    return lambda times: [seconds + time for time in times]


def _wrapped(times: Times) -> Times:
    """A 32-bit clock of microseconds that begins anew in the middle."""
    span = 2**32 / 1e6
    return [(span - times[len(times) // 2] + time) % span for time in times]


def _doubled(times: Times) -> Times:
    return [*times[:5], times[4], *times[6:]]


def angles_in_degrees(seed: int, folder: Path) -> Outcome:
    """``simulate`` is given a table in degrees: an elbow of 70 rad."""
    table = folder / "motion.csv"
    index = load_anatomy(ARM).coordinate_index("elbow_flexion")
    elbow = np.rad2deg(performance_of(ARM, seed).thetas[:6, index])
    table.write_text("time,elbow_flexion\n" + "".join(f"{0.1 * k},{a}\n" for k, a in enumerate(elbow)))
    told = bonetrack("simulate", "--anatomy", ARM, "--motion", table, "--out", folder / "recording", "--noise", "none")
    if told.code != 0:
        return refused(told, {})
    return Outcome("said" if told.doubts else "WRONG WITHOUT A WORD", f"an elbow of {elbow.max():.0f} rad is simulated")


_CASES: tuple[tuple[str, str, str, Callable[[int, Path], Made]], ...] = (
    (
        "free-running sensor",
        "the second sensor's frames fall half a period beside the first's",
        "at 16.7 to 25 ms 0 of 60 frames of it used, and nothing says so",
        out_of_step(0.5),
    ),
    ("nearly in step", "the second sensor's frames fall a sixth of a period beside", "", out_of_step(1.0 / 6.0)),
    (
        "times in milliseconds",
        "times in milliseconds where seconds should stand",
        "15 degrees off, 25 times slower",
        with_times(_scaled(1e3), sensors=(0, 1)),
    ),
    (
        "times in nanoseconds",
        "times in nanoseconds where seconds should stand",
        "accepted",
        with_times(_scaled(1e9), sensors=(0, 1)),
    ),
    (
        "repeated images",
        "a sensor repeats its image under new times",
        "52 of 57 frames lost although the other sees everything",
        repeated_images,
    ),
    ("clocks do not overlap", "one sensor's clock is an hour ahead", "", with_times(_shifted(3600.0), sensors=(1,))),
    ("32-bit clock wraps", "a 32-bit clock of microseconds begins anew", "", with_times(_wrapped, sensors=(0, 1))),
    ("one time twice", "one time stands twice", "", with_times(_doubled, sensors=(0,))),
)


def _situations() -> Iterator[Situation]:
    for name, tried, before, make in _CASES:
        yield Situation(name, 2, tried, before, judged(make))
    tried = "a motion table in degrees for `simulate`"
    yield Situation("angles in degrees", 2, tried, "an elbow of 4,011 degrees is simulated", angles_in_degrees)


SITUATIONS = tuple(_situations())
