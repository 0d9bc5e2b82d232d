"""Files for other programs with lost frames in them, and what is the user's own: folders, bodies, memory."""

from __future__ import annotations

import base64
import os
import socket
import subprocess
import sys
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from adapt.subject import Subject, load_subject, save_subject
from capture.recording import open_recording
from capture.recording.depth_png import write_readings
from track.evaluation.known import record_known
from track.evaluation.trials.command import bonetrack
from track.evaluation.trials.fit import refused
from track.evaluation.trials.people import ARM, LEG
from track.evaluation.trials.recorded import performance_of
from track.evaluation.trials.situation import Outcome, Situation
from track.motion import Motion, load_motion

_GREEDY_MB, _HUGE = 1000.0, 1_000_000_000  # what an export may take; bytes that a small file unpacks to
_STARTS_IN_S = 60.0


def _known_subject(seed: int, folder: Path, *, anatomy: str = ARM) -> Path:
    """The subject that an adaptation without any error would find, and its calibrated recording beside."""
    known = record_known(performance_of(anatomy, seed), folder / "recording", seed=seed)
    body, times = known.body, performance_of(anatomy, seed).times
    report: dict[str, Any] = {"poses": [], "landmarks_never_shown": []}
    subject = Subject(body, known.thetas[::4], times[::4], 1e-6 * np.eye(len(body.shape)), report)
    save_subject(subject, folder / "subject.npz")
    return folder / "subject.npz"


def _with_lost_frames(seed: int, folder: Path) -> tuple[Motion, Outcome | None]:
    """A motion whose last frames are lost, exported to ``folder/export``; an outcome where that was refused."""
    subject = _known_subject(seed, folder)
    recording = open_recording(folder / "recording")
    for sensor in recording.sensors:
        for frame in sensor.frames[-3:]:
            size = (sensor.camera.height, sensor.camera.width)
            write_readings(frame.path, np.zeros(size, np.uint16))
    for step in (
        ("track", recording.path, "--subject", subject, "--out", folder / "motion"),
        ("export", folder / "motion", "--subject", subject, "--out", folder / "export"),
    ):
        told = bonetrack(*step)
        if told.code != 0:
            return load_motion(folder / "motion"), refused(told, {"step": str(step[0])})
    return load_motion(folder / "motion"), None


def trc_in_opensim(seed: int, folder: Path) -> Outcome:
    """The exported .trc is opened by OpenSim, and has every marker and frame."""
    motion, ended = _with_lost_frames(seed, folder)
    if ended is not None:
        return ended
    if find_spec("opensim") is None:
        return Outcome("not tried", "OpenSim is not installed")
    lost = int((~motion.tracked).sum())
    program = "import opensim, sys; t = opensim.TimeSeriesTableVec3(sys.argv[1]); print(t.getNumRows())"
    trc = next((folder / "export").glob("*.trc"))
    done = subprocess.run([sys.executable, "-c", program, trc], capture_output=True, text=True, check=False)
    said = (done.stdout + done.stderr).strip().splitlines()
    if done.returncode != 0 or said[-1:] != [str(len(motion.times))]:
        return Outcome(
            "WRONG WITHOUT A WORD", f"{lost} frames lost; OpenSim does not open it: {' '.join(said[-3:])[:200]}"
        )
    return Outcome("right", f"{lost} of {len(motion.times)} frames lost; OpenSim opens it with all of them")


def osim_in_nimble(seed: int, folder: Path) -> Outcome:
    """The exported .osim opens in nimblephysics."""
    told = bonetrack("export", _known_subject(seed, folder), "--out", folder / "export")
    if told.code != 0:
        return refused(told, {})
    python = os.environ.get("BONETRACK_NIMBLE_PYTHON")  # it wants numpy before 2, so a Python of its own
    if python is None:
        return Outcome("not tried", "BONETRACK_NIMBLE_PYTHON names no Python with nimblephysics")
    program = (
        "import sys; from nimblephysics_libs._nimblephysics.biomechanics import OpenSimParser; "
        "print(OpenSimParser.parseOsim(sys.argv[1]).skeleton.getNumDofs())"
    )
    osim = next((folder / "export").glob("*.osim"))
    done = subprocess.run([python, "-c", program, osim], capture_output=True, text=True, check=False)
    if done.returncode != 0 or not done.stdout.strip():
        return Outcome("WRONG WITHOUT A WORD", f"does not open: {' '.join(done.stderr.split())[-200:]}")
    return Outcome("right", "opens")


def demo_over_a_folder(seed: int, folder: Path) -> Outcome:
    """``demo`` is given a folder that has a `motion` of somebody else's."""
    notes = folder / "mine" / "motion" / "notes.txt"
    notes.parent.mkdir(parents=True)
    notes.write_text("a year's work\n", encoding="utf-8")
    told = bonetrack("demo", "--out", folder / "mine", limit_s=120.0)
    if not notes.is_file():
        return Outcome("WRONG WITHOUT A WORD", "the folder `motion` and what it held are gone")
    return refused(told, {}) if told.code else Outcome("right", "the folder stays as it was")


def other_subject(seed: int, folder: Path) -> Outcome:
    """An arm's subject is tracked in a leg's recording."""
    (folder / "leg").mkdir()
    _known_subject(seed, folder / "leg", anatomy=LEG)
    subject, start = _known_subject(seed, folder), time.perf_counter()
    told = bonetrack("track", folder / "leg" / "recording", "--subject", subject, "--out", folder / "motion")
    seconds = time.perf_counter() - start
    if told.code != 0:
        outcome = refused(told, {"seconds": seconds})
        return Outcome(outcome.verdict, f"{outcome.line} (after {seconds:.0f} s)", outcome.numbers)
    tracked = int(load_motion(folder / "motion").tracked.sum())
    line = f"{tracked} frames tracked after {seconds:.0f} s"
    return Outcome("said" if told.doubts or not tracked else "WRONG WITHOUT A WORD", line)


def greedy_file(seed: int, folder: Path) -> Outcome:
    """A subject file with an array that nobody asked for, small on disk and 1 GB in memory."""
    subject = _known_subject(seed, folder)
    with np.load(subject, allow_pickle=False) as kept:
        arrays: dict[str, Any] = {name: kept[name] for name in kept.files}
    np.savez_compressed(subject, **arrays, unasked=np.zeros(_HUGE, np.uint8))
    told = bonetrack("export", subject, "--out", folder / "export")
    line = f"{subject.stat().st_size / 1e6:.1f} MB on disk, {told.peak_mb:.0f} MB of memory taken"
    if told.peak_mb > _GREEDY_MB:
        return Outcome("WRONG WITHOUT A WORD", line)
    if told.code != 0:
        return refused(told, {"peak_mb": told.peak_mb})
    load_subject(subject)
    return Outcome("right", line)


def foreign_origin(seed: int, folder: Path) -> Outcome:
    """A web page of another origin opens the viewer's web socket."""
    recording = _known_subject(seed, folder).parent / "recording"
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(p or os.getcwd() for p in sys.path)}
    command = [sys.executable, "-c", "from track.cli import main; main()", "view", recording, "--port", port]
    viewer = subprocess.Popen(
        [*map(str, command)], env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        answer = _handshake(port, "http://elsewhere.example")
    finally:
        viewer.terminate()
        viewer.wait(30)
    if "101" in answer:
        return Outcome("WRONG WITHOUT A WORD", f"the web socket answers a page of another origin: {answer}")
    return Outcome("refused" if answer else "failed", answer or "the viewer did not start")


def _handshake(port: int, origin: str) -> str:
    """The first line of the answer to a web socket's opening; empty if nobody answers."""
    key = base64.b64encode(b"sixteen bytes ok").decode()
    request = (
        f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\nOrigin: {origin}\r\n\r\n"
    )
    end = time.monotonic() + _STARTS_IN_S
    while time.monotonic() < end:
        try:
            with socket.create_connection(("127.0.0.1", port), timeout=10.0) as line:
                line.sendall(request.encode("ascii"))
                return line.recv(4096).decode("latin-1").partition("\r\n")[0] or "closed without an answer"
        except ConnectionRefusedError:
            time.sleep(0.5)
    return ""


SITUATIONS = (
    Situation(
        "trc with lost frames",
        4,
        "a `.trc` with lost frames is opened by OpenSim",
        "cannot be opened at all, and shifts markers in another reader",
        trc_in_opensim,
    ),
    Situation("osim in nimblephysics", 4, "an `.osim` is opened by nimblephysics", "does not open", osim_in_nimble),
    Situation(
        "demo over a folder",
        5,
        "`demo` into a folder that has a `motion` of the user's",
        "deletes it, whatever it holds",
        demo_over_a_folder,
    ),
    Situation(
        "another's subject",
        5,
        "an arm's subject tracked in a leg's recording",
        "searches for minutes; an arm's motion with a leg's recording is accepted",
        other_subject,
    ),
    Situation(
        "greedy file", 5, "a small file with an array of 1 GB that nobody asked for", "4.3 GB of memory", greedy_file
    ),
    Situation(
        "foreign origin",
        5,
        "a web page of another origin opens the viewer's web socket",
        "any origin is accepted",
        foreign_origin,
    ),
)
