"""Files that users import: without readings, in other units and forms, or not what their name says."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from capture.recording import open_recording
from capture.recording.depth_png import Readings, read_readings, write_readings
from track.evaluation.trials.command import Told, bonetrack
from track.evaluation.trials.fit import refused, track_and_judge
from track.evaluation.trials.recorded import Made
from track.evaluation.trials.sensors import as_disparity, one_sensor
from track.evaluation.trials.situation import Outcome, Situation
from track.evaluation.trials.times import rewrite_truth

_SIZE = ("--width", "640", "--height", "480")
_POINTER = "version https://git-lfs.github.com/spec/v1\noid sha256:{}\nsize 614400\n"


@dataclass(frozen=True, eq=False)
class Source:
    """Depth images in mm of an arm, the made recording, and an empty folder to write files in."""

    made: Made
    images: list[Readings]
    folder: Path

    @property
    def camera(self) -> tuple[str, ...]:
        """What a user states of the camera."""
        camera = open_recording(self.made.recording).sensors[0].camera
        return tuple(part for name in ("fx", "fy", "cx", "cy") for part in (f"--{name}", f"{getattr(camera, name)}"))


def _source(seed: int, folder: Path) -> Source:
    made = one_sensor(seed, folder / "made")
    sensor = open_recording(made.recording).sensors[0]
    size = {"width": sensor.camera.width, "height": sensor.camera.height}
    source = Source(made, [read_readings(frame.path, **size) for frame in sensor.frames], folder / "files")
    source.folder.mkdir()
    return source


Write = Callable[[Source], tuple[str, ...]]
"""Writes a source's files and returns the options that a user would give."""


def imported(write: Write, *, worthless: bool = False) -> Callable[[int, Path], Outcome]:
    """Import what is written and track it; of ``worthless`` files nothing can come."""

    def run(seed: int, folder: Path) -> Outcome:
        source = _source(seed, folder)
        told = bonetrack("import", source.folder, "--out", folder / "recording", *write(source))
        if told.code != 0:
            return refused(told, {"step": "import"})
        if worthless:
            return _worthless(told)
        recording = folder / "recording"
        (recording / "truth.npz").write_bytes((source.made.recording / "truth.npz").read_bytes())
        rewrite_truth(recording, sensor_names=np.array([sensor.name for sensor in open_recording(recording).sensors]))
        return track_and_judge(Made(recording, source.made.anatomy, source.made.truth), folder)

    return run


def _worthless(told: Told) -> Outcome:
    return Outcome("said" if told.doubts else "WRONG WITHOUT A WORD", "imported: " + " ".join(told.out.split())[-200:])


def _pngs(change: Callable[[Readings], Readings]) -> Write:
    def write(source: Source) -> tuple[str, ...]:
        for k, image in enumerate(source.images):
            write_readings(source.folder / f"{k:06d}.png", change(image))
        return (*source.camera, "--fps", "10")

    return write


def _dumps(source: Source) -> tuple[str, ...]:
    """Raw dumps with decimals of seconds in their names, that sort wrongly as text."""
    for k, image in enumerate(source.images):
        image.astype("<u2").tofile(source.folder / f"depth-{9.5 + 0.1 * k:.1f}.bin")
    return (*source.camera, *_SIZE, "--fps", "10", "--pattern", "*.bin")


def _text(source: Source) -> tuple[str, ...]:
    for k, image in enumerate(source.images):
        np.savetxt(source.folder / f"{k:06d}.txt", image, fmt="%d")
    return (*source.camera, *_SIZE, "--fps", "10", "--pattern", "*.txt")


def _ascii_pgm(source: Source) -> tuple[str, ...]:
    for k, image in enumerate(source.images):
        height, width = image.shape
        rows = "\n".join(" ".join(map(str, row)) for row in image)
        (source.folder / f"{k:06d}.pgm").write_text(f"P2\n{width} {height}\n65535\n{rows}\n", encoding="ascii")
    return (*source.camera, "--fps", "10", "--pattern", "*.pgm")


def _pointers(source: Source) -> tuple[str, ...]:
    for k in range(len(source.images)):
        (source.folder / f"{k:06d}.png").write_text(_POINTER.format(f"{k:064x}"), encoding="ascii")
    return (*source.camera, "--fps", "10")


def _recording_already(source: Source) -> tuple[str, ...]:
    source.folder.rmdir()
    source.made.recording.rename(source.folder)
    return ("--fx", "580")


_CASES: tuple[tuple[str, str, str, Write, bool], ...] = (
    ("control: images", "control: millimetre PNGs with the right camera", "", _pngs(lambda image: image), False),
    ("raw dumps with clocks", "raw dumps whose names carry seconds, 9.5 to 11.0", "sorted as text", _dumps, False),
    ("text depth", "depth as text tables", "", _text, False),
    ("ASCII PGM", "depth as ASCII PGM", "", _ascii_pgm, False),
    ("LFS pointer", "Git LFS pointers in place of images", "not called one", _pointers, True),
    (
        "empty images",
        "images without one reading",
        "imported with exit 0",
        _pngs(lambda image: np.zeros_like(image)),
        True,
    ),
    (
        "all readings out of range",
        "readings of 60 m throughout",
        "imported with exit 0",
        _pngs(lambda image: np.full_like(image, 60000)),
        True,
    ),
    (
        "constant images",
        "images of one and the same reading",
        "imported with exit 0",
        _pngs(lambda image: np.full_like(image, 2047)),
        True,
    ),
    ("imported disparity", "raw disparity imported as millimetres", "a subject is written", _pngs(as_disparity), False),
    ("recording as source", "a recording is given to `import`", "not recognised", _recording_already, True),
)


def _situations() -> Iterator[Situation]:
    for name, tried, before, write, worthless in _CASES:
        control = name.startswith("control")
        yield Situation(name, 3, tried, before, imported(write, worthless=worthless), control=control)


SITUATIONS = tuple(_situations())
