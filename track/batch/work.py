"""The work on one item: calibrate where nobody has, adapt, track, and keep what the table says of it.

An item's folder holds ``item.json`` (what it was made from), ``subject.npz``, ``motion/`` and, written last,
``row.json``. An item whose row is there is finished and never worked on again; adapting and tracking go on where they
stopped.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from capture.errors import BonetrackError
from capture.files import replaced_when_complete
from track.batch.items import BatchError, Item

if TYPE_CHECKING:
    from capture.recording import Recording

ITEM, ROW = "item.json", "row.json"
_NOT_OURS = "move its folder away, or give another --out"


@dataclass(frozen=True)
class Row:
    """What the table says of one item."""

    name: str
    frames: int = 0
    lost: int = 0
    residual_mm: float | None = None  # median over the tracked frames of the median distance of skin and cloud
    hidden: str = ""  # "bone count" of each bone that does not show in so many of the tracked frames
    used: str = ""  # "sensor used/total" of each sensor's frames
    warning: str = ""  # what a person should look at
    seconds: float | None = None  # of the run that finished it
    error: str = ""


Work = Callable[[Item, Path], Row]
"""What is done with an item, in its folder."""


def run_item(item: Item, folder: Path, work: Work) -> Row:
    """Do the work on an item, unless it is done already. What the user can mend becomes the row's error.

    Raises:
        Exception: anything else that goes wrong; another trial may succeed.

    >>> from tempfile import TemporaryDirectory
    >>> item = Item("walk", Path("recordings/walk"), "lower-limb-right")
    >>> with TemporaryDirectory() as folder:
    ...     done = run_item(item, Path(folder, "walk"), lambda item, folder: Row(item.name, frames=90))
    ...     run_item(item, Path(folder, "walk"), lambda item, folder: Row("made again")) == done
    True
    """
    begun = time.perf_counter()
    try:
        if done := finished(item, folder):
            return done
        _claim(item, folder)
        row = work(item, folder)
    except BonetrackError as error:
        return Row(item.name, error=str(error))
    row = replace(row, seconds=round(time.perf_counter() - begun, 2))
    _write(folder / ROW, asdict(row))
    return row


def finished(item: Item, folder: Path) -> Row | None:
    """The row of an item that was finished before, in its folder."""
    if _read(folder / ITEM) != item.described():
        return None
    row = _read(folder / ROW)
    return None if row is None else Row(**row)


def adapt_and_track(item: Item, folder: Path) -> Row:
    """Adapt the item's anatomy, unless its subject is given or adapted already, and track it."""
    import numpy as np

    from adapt.adapt_to_file import adapt_into
    from adapt.anatomy_file import load_anatomy
    from adapt.options import AdaptOptions
    from adapt.subject import load_subject
    from capture.cloud.region import automatic_region
    from capture.recording import Region, frames_used, open_recording
    from track.options import TrackOptions
    from track.track_recording import track_recording

    recording = _calibrated(open_recording(item.recording))
    region = None if item.region is None else Region(np.array(item.region[:3]), np.array(item.region[3:]))
    if item.near is not None:
        region = automatic_region(recording, near=np.array(item.near))
    told: list[str] = []
    subject_file = item.subject or folder / "subject.npz"
    if item.subject is None and not subject_file.is_file():
        options = AdaptOptions(region=region, person=item.person)
        adapt_into(subject_file, recording, load_anatomy(item.anatomy), options, told=told.append)
    subject = load_subject(subject_file, anatomy=item.anatomy)
    motion = track_recording(recording, subject, folder / "motion", TrackOptions(region=region), told=told.append)
    return _row(item.name, motion, subject, frames_used(recording), [*recording.mended, *told])


def _calibrated(recording: Recording) -> Recording:
    """A recording of several sensors that nobody calibrated, calibrated; others as they are.

    Raises:
        CalibrationError: its box does not tell where the sensors stand.
        BatchError: nothing can be written beside it.
    """
    from capture.calibration.calibrate import calibrate_recording, write_calibration
    from capture.recording import open_recording

    if len(recording.sensors) == 1 or recording.calibration is not None:
        return recording
    calibration = calibrate_recording(recording)
    try:
        write_calibration(recording, calibration)
    except OSError as error:
        raise BatchError(
            f"is not calibrated, and its calibration cannot be kept in it ({error.strerror})",
            where=recording.path,
            remedy="run `bonetrack calibrate` on a copy that can be written to",
        ) from error
    return open_recording(recording.path)


def _row(name: str, motion, subject, used, mended) -> Row:  # type: ignore[no-untyped-def]
    import numpy as np

    from adapt.subject import doubts
    from capture.recording import used_in_words

    tracked = motion.tracked
    counts = {
        bone: int((tracked & ~shown).sum()) for bone, shown in zip(motion.transforms, motion.shown.T, strict=True)
    }
    left_out = [] if motion.settings is None else motion.settings.options.get("left_out", [])
    return Row(
        name,
        frames=len(tracked),
        lost=int((~tracked).sum()),
        residual_mm=round(1e3 * float(np.median(motion.residuals[tracked])), 3) if tracked.any() else None,
        hidden=", ".join(f"{bone} {count}" for bone, count in counts.items() if count),
        used=", ".join(f"{one.sensor} {one.used}/{one.total}" for one in used),
        warning="; ".join(
            [
                *mended,
                *(f"left out of the region: {line}" for line in left_out),
                *used_in_words(used)[1:],
                *doubts(subject),
            ]
        ),
    )


def _claim(item: Item, folder: Path) -> None:
    """Make the folder the item's."""
    known = _read(folder / ITEM)
    if known is not None and known != item.described():
        differing = ", ".join(key for key, value in item.described().items() if known.get(key) != value)
        raise BatchError(f"results of another {differing}", where=folder, remedy="give another --out or another name")
    if known is None and folder.is_dir() and any(folder.iterdir()):
        raise BatchError("holds something that is not of a batch", where=folder, remedy="give another --out")
    folder.mkdir(parents=True, exist_ok=True)
    _write(folder / ITEM, item.described())


def _read(path: Path) -> dict | None:  # type: ignore[type-arg]
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except NotADirectoryError as error:
        raise BatchError("is a file, not a folder", where=path.parent, remedy="give another --out") from error
    except ValueError as error:
        raise BatchError("cannot be read", where=path, remedy=_NOT_OURS) from error
    if not isinstance(content, dict):
        raise BatchError("is not of a batch", where=path, remedy=_NOT_OURS)
    return content


def _write(path: Path, content: dict) -> None:  # type: ignore[type-arg]
    with replaced_when_complete(path) as partial:
        partial.write_text(json.dumps(content), encoding="utf-8")
