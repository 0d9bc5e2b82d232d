"""A full disk, a folder that may not be written to, a kill: one clear line, and the same command then goes on."""

from __future__ import annotations

import contextlib
import errno
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from adapt.subject import save_subject
from capture.files import replaced_when_complete
from capture.journal import resume_journal
from capture.recording import open_recording
from capture.recording.depth_png import write_readings
from tests.command_line import bonetrack
from tests.known_limb import FRAMES
from tests.test_cli import fails
from tests.test_track import same_motion
from track.track_recording import JOURNAL, track_recording

IMAGES = 60


@contextlib.contextmanager
def room_for(count: int) -> Iterator[None]:
    """No file can grow beyond so many bytes, as on a disk that is nearly full."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (count, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@contextlib.contextmanager
def nobody() -> Iterator[None]:
    """Without the superuser's rights, who may write anywhere."""
    if os.geteuid() != 0:
        yield
        return
    os.seteuid(65534)
    try:
        yield
    finally:
        os.seteuid(0)


def images(folder: Path, *, count: int = IMAGES, size: tuple[int, int] = (240, 320)) -> Path:
    """A folder of noisy depth images, some 100 kB each."""
    folder.mkdir()
    rng = np.random.default_rng(0)
    for k in range(count):
        write_readings(folder / f"{k:04d}.png", rng.integers(500, 4000, size, dtype=np.uint16))
    return folder


def importing(source: Path, out: Path) -> tuple[str, ...]:
    return ("import", str(source), "--out", str(out), "--fx", "300")


def test_importing_onto_a_full_disk_says_so_and_the_same_command_then_works(tmp_path):
    source, out = images(tmp_path / "source", count=3), tmp_path / "rec"
    with room_for(20_000):
        line = fails(*importing(source, out), saying="File too large; make room")
    assert "the same command again: it is done anew" in line
    assert str(out / "sensor" / "000000.png") in line
    fails("fuse", out, "--frame", 0, "--out", tmp_path / "cloud.ply", saying="never finished")
    assert bonetrack(*importing(source, out)).code == 0
    assert len(open_recording(out).sensors[0].frames) == 3


def test_tracking_onto_a_full_disk_keeps_what_was_tracked(limb, tmp_path):
    save_subject(limb.subject, tmp_path / "subject.npz")
    out = tmp_path / "motion"
    command = ("track", limb.recording.path, "--subject", tmp_path / "subject.npz", "--out", out)
    with room_for(8_000):
        line = fails(*command, saying="File too large; make room")
    assert JOURNAL in line
    assert "it goes on where it stopped" in line
    seen = []
    motion = track_recording(limb.recording, limb.subject, out, progress=lambda done, total: seen.append(done))
    assert 1 < seen[0] < FRAMES
    same_motion(motion, track_recording(limb.recording, limb.subject, tmp_path / "undisturbed"))


def test_a_full_disk_is_told_of_the_subject_not_of_the_journal_beside_it(tmp_path):
    out = tmp_path / "subject.npz"
    journal = resume_journal(tmp_path / "subject.npz.partial-journal", "0" * 64, result=out)
    with room_for(100), pytest.raises(OSError, match="File too large") as full:
        journal.append({"theta": [0.0] * 1000})
    assert full.value.filename == str(out)


def test_errors_name_the_file_that_people_know_not_the_one_it_is_written_under(tmp_path):
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "file" / "cloud.ply", tmp_path / f"{'a' * 250}.ply"):
        with (
            pytest.raises(OSError, match=r"Not a directory|too long") as failed,
            replaced_when_complete(path) as partial,
        ):
            partial.write_text("anything")
        assert failed.value.filename == str(path)
    whole = tmp_path / "table.parquet"
    with pytest.raises(OSError, match="full") as failed, replaced_when_complete(whole) as partial:
        raise OSError(errno.ENOSPC, f"{partial} cannot be written, for the disk is full")
    assert failed.value.strerror == f"{whole} cannot be written, for the disk is full"


def test_a_folder_that_may_not_be_written_to_is_named():
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        source = images(folder / "source", count=1)
        folder.chmod(0o555)
        with nobody():
            line = fails(*importing(source, folder / "rec"), saying="Permission denied; give a folder that you may")
        assert str(folder / "rec") in line
        folder.chmod(0o755)
        assert bonetrack(*importing(source, folder / "rec")).code == 0


def test_an_import_that_was_killed_is_done_anew_by_the_same_command(tmp_path):
    source, out = images(tmp_path / "source"), tmp_path / "rec"
    run = "from track.cli import main; main()"
    process = subprocess.Popen([sys.executable, "-c", run, *importing(source, out)], stdout=subprocess.DEVNULL)
    deadline = time.monotonic() + 60.0
    while not (out / "sensor" / "000004.png").exists() and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.002)
    os.kill(process.pid, signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    assert not (out / "recording.json").exists()
    assert bonetrack(*importing(source, out)).code == 0
    assert bonetrack(*importing(source, tmp_path / "undisturbed")).code == 0
    assert contents(out) == contents(tmp_path / "undisturbed")


def contents(folder: Path) -> dict[str, bytes]:
    """The bytes of every file, by its name."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
