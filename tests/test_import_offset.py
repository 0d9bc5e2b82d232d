"""Two sensors' files become one recording: by a stated offset, by one clock, or by the motion that both see."""

from __future__ import annotations

import shutil
import sqlite3
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.interpolate import PchipInterpolator

from capture.camera import Camera
from capture.commands import import_command
from capture.errors import RecordingError
from capture.importers import (
    DepthFrame,
    ImportOptions,
    Source,
    UserCamera,
    estimate_offset,
    import_recording,
    motion_of,
)
from capture.recording import Sensor, instants, open_recording
from tests.test_import_files import FILES

CAMERA = Camera(80, 60, 70.0, 70.0, 39.5, 29.5)
NAME = Path("second.oni")


def performance(seed: int, *, periodic: bool = False):
    """Where a forearm is (x, z) (m) at a time: still and moving by turns, or to and fro without end."""
    if periodic:
        return lambda t: 0.15 * np.array([np.sin(6.28 * t), np.cos(6.28 * t)])
    random = np.random.default_rng(seed)
    return PchipInterpolator(np.cumsum(random.exponential(0.9, 80)), random.uniform(-0.3, 0.3, (80, 2)))


def sees(
    position,
    *,
    turn: float,
    start_s: float,
    seconds: float,
    fps: float,
    seed: int,
    clock_s: float = 0.0,
    wall: float = 2.5,
):
    """Depth of the forearm, seen by a sensor turned about the vertical, with noise and unsteady times."""
    random = np.random.default_rng(seed)
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width]

    def frames():
        for index in range(int(seconds * fps)):
            x, z = position(start_s + index / fps + random.normal(0.0, 0.002))
            across, along = x * np.cos(turn) + z * np.sin(turn), 1.5 + z * np.cos(turn) - x * np.sin(turn)
            arm = (abs(u - 40.0 - 70.0 * across / 1.5) < 3.0) & (abs(v - 30) < 15)
            depth = np.where(arm, along, wall)
            depth += random.normal(0.0, 0.002, depth.shape) * depth**2
            yield DepthFrame(clock_s + index / fps, np.clip(1000.0 * depth, 0, 65535).astype(np.uint16))

    return Source(Sensor("sensor", CAMERA, 0.001, (0.2, 4.0)), frames(), times="the file")


def two_views(position, *, offset_s: float, other=None, seconds: float = 14.0, wall: float = 2.5):
    first = sees(position, turn=0.0, start_s=5.0, seconds=seconds, fps=30.0, seed=1, clock_s=100.0, wall=wall)
    other = position if other is None else other
    second = sees(other, turn=0.7, start_s=5.0 + offset_s, seconds=seconds, fps=25.0, seed=2, clock_s=7.0, wall=wall)
    return motion_of(first), motion_of(second)


@pytest.mark.parametrize(("seed", "offset_s", "wall"), [(1, 0.676, 2.5), (5, -1.31, 2.5), (4, 0.43, 0.0)])
def test_the_offset_is_found_within_what_it_states_with_and_without_a_wall_behind(seed, offset_s, wall):
    found = estimate_offset(*two_views(performance(seed), offset_s=offset_s, wall=wall), where=NAME)
    assert abs(found.seconds - offset_s) < 0.012
    assert abs(found.seconds - offset_s) < 3.0 * found.deviation_s
    assert found.deviation_s < 0.02
    assert found.correlation > 0.8


def test_motion_that_tells_no_offset_is_refused():
    with pytest.raises(RecordingError, match=r"second\.oni.*(too little motion|alike).*--offset"):
        estimate_offset(*two_views(performance(1), offset_s=0.0, other=performance(9), seconds=9.0), where=NAME)
    with pytest.raises(RecordingError, match=r"alike|chance"):
        estimate_offset(*two_views(performance(0, periodic=True), offset_s=0.3, seconds=7.0), where=NAME)
    with pytest.raises(RecordingError, match=r"too little motion|nothing moves"):
        estimate_offset(*two_views(lambda t: (0.0, 0.0), offset_s=0.0, seconds=5.0), where=NAME)
    with pytest.raises(RecordingError, match="shorter than 4 s"):
        estimate_offset(*two_views(performance(1), offset_s=0.0, seconds=3.0), where=NAME)


def write_raw(path: Path, source: Source) -> Path:
    path.write_bytes(b"".join(frame.readings.astype("<u2").tobytes() for frame in source.frames))
    return path


def test_files_of_two_sensors_become_one_recording(tmp_path):
    paths = [
        write_raw(tmp_path / name, sees(performance(1), turn=turn, start_s=start_s, seconds=7.0, fps=30.0, seed=seed))
        for name, turn, start_s, seed in (("a.raw", 0.0, 5.0, 1), ("b.raw", 0.7, 5.5, 2))
    ]
    arguments = [*map(str, paths), "--out", str(tmp_path / "rec"), "--fx", "70", "--width", "80", "--height", "60"]
    result = CliRunner().invoke(import_command, [*arguments, "--sensor", "left", "--sensor", "right"])
    assert result.exit_code == 0, result.output
    recording = open_recording(tmp_path / "rec")
    left, right = recording.sensors
    assert (left.name, right.name) == ("left", "right")
    assert left.frames[0].time_s == 0.0
    assert right.frames[0].time_s == pytest.approx(0.5, abs=0.03)
    assert "right begins 0." in result.output
    assert "one standard deviation" in result.output


def test_a_stated_offset_is_kept(tmp_path):
    paths = [FILES / "realsense.db3", FILES / "openni.oni"]
    recording = import_recording(paths, tmp_path / "rec", ImportOptions(offset=0.1))
    first, second = recording.sensors
    assert (first.name, second.name) == ("sensor-1", "sensor-2")
    assert (first.frames[0].time_s, second.frames[0].time_s) == (0.0, 0.1)
    assert sum(len(instant.frames) == 2 for instant in instants(recording)) == 3
    assert "sensor-2 begins 0.1000 s after sensor-1 (as stated)" in recording.created_by


def of_the_computers_clock(path: Path) -> Path:
    """A RealSense file whose images say that their times are the computer's."""
    shutil.copy(FILES / "realsense.db3", path)
    with sqlite3.connect(path) as database:
        rows = list(database.execute("SELECT id, data FROM messages"))
        for key, data in rows:
            changed = bytes(data).replace(b"=Hardware Clock;", b"=Global Time;x=y;")
            database.execute("UPDATE messages SET data = ? WHERE id = ?", (changed[: len(data)], key))
    database.close()
    return path


def test_files_by_one_clock_keep_it(tmp_path):
    paths = [of_the_computers_clock(tmp_path / name) for name in ("a.db3", "b.db3")]
    recording = import_recording(paths, tmp_path / "rec", ImportOptions(offset="clock"))
    assert [sensor.frames[0].time_s for sensor in recording.sensors] == [0.0, 0.0]
    with pytest.raises(RecordingError, match="as many different names"):
        import_recording(
            paths, tmp_path / "rec", ImportOptions(offset="clock", sensor_names=["left", "left"], overwrite=True)
        )


@pytest.mark.parametrize(
    ("name", "why"), [("realsense.db3", "by the camera's own clock"), ("openni.oni", "begins its times at 0")]
)
def test_a_clock_that_a_file_cannot_share_is_not_taken_for_one(tmp_path, name, why):
    with pytest.raises(RecordingError, match=rf"{why}, so it shares no clock with the others.*--offset motion"):
        import_recording([FILES / name, FILES / name], tmp_path / "rec", ImportOptions(offset="clock"))


def test_images_whose_names_tell_no_time_are_said_to_begin_at_once(tmp_path):
    paths = [
        write_raw(tmp_path / name, sees(performance(1), turn=0.0, start_s=5.0, seconds=0.5, fps=30.0, seed=seed))
        for seed, name in enumerate(("a.raw", "b.raw"))
    ]
    stated = UserCamera(fx=70.0, size=(80, 60))
    recording = import_recording(paths, tmp_path / "rec", ImportOptions(cameras=stated, offset="clock"))
    assert "none has a clock, so all are taken to begin at once" in recording.created_by
    mixed = [of_the_computers_clock(tmp_path / "c.db3"), paths[0]]
    with pytest.raises(RecordingError, match="nominal rate, so it shares no clock"):
        import_recording(mixed, tmp_path / "mixed", ImportOptions(cameras=stated, offset="clock"))


def test_an_offset_after_which_nothing_overlaps_is_refused_and_leaves_no_recording(tmp_path):
    paths = [FILES / "realsense.db3", FILES / "openni.oni"]
    with pytest.raises(RecordingError, match=r"no time in common: 'sensor-1' 0\.00 to 0\.17 s and 'sensor-2' 60"):
        import_recording(paths, tmp_path / "rec", ImportOptions(offset=60.0))
    assert not (tmp_path / "rec" / "recording.json").exists()
    import_recording(paths, tmp_path / "rec", ImportOptions(offset=0.1))


def test_an_offset_must_be_a_number_or_a_way_to_find_it(tmp_path):
    for text in ("soon", "nan"):
        arguments = [str(FILES / "realsense.db3"), "--out", str(tmp_path / "rec"), "--offset", text]
        assert CliRunner().invoke(import_command, arguments).exit_code == 2
