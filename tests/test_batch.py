"""A batch finishes what can be finished, once, whatever dies on the way, and says what could not be."""

from __future__ import annotations

import csv
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import track.batch.run_batch
from adapt.model.shape.population import ANYBODY, Person
from capture.errors import CloudError
from capture.recording import open_recording
from tests.known_limb import ANATOMY, KnownLimb
from tests.test_region import LEFT, RIGHT, swinging
from track.batch.items import BatchError, Item, read_items
from track.batch.run_batch import TABLE, run_batch, write_table
from track.batch.work import Row, adapt_and_track, finished, run_item


def toy_work(item: Item, folder: Path) -> Row:
    """Notes each trial beside the recording; what happens is in the item's name."""
    trials = item.recording.with_name(f"{item.name}.trials")
    with trials.open("a") as file:
        file.write(f"{os.getpid()}\n")
    if item.name == "mendable":
        raise CloudError("nobody is there", where=item.recording, remedy="state the region")
    if item.name == "hopeless":
        raise OSError("the disk is full")
    if item.name == "killed" and count(item) == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return Row(item.name, frames=30, lost=1, residual_mm=1.5, hidden="radius 3")


def count(item: Item) -> int:
    """How often an item was tried."""
    return len(item.recording.with_name(f"{item.name}.trials").read_text().splitlines())


def items(folder: Path, *names: str) -> list[Item]:
    return [Item(name, folder / name, "upper-limb-right") for name in names]


def test_a_killed_worker_costs_one_more_trial_of_its_item_and_nothing_else(tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="Dask is not installed (extra: batch)")
    todo = items(tmp_path, "first", "killed", "mendable", "hopeless", "last")
    told: list[str] = []
    rows = run_batch(
        todo, tmp_path / "out", workers=2, retries=1, work=toy_work, progress=lambda row: told.append(row.name)
    )
    assert [row.name for row in rows] == [item.name for item in todo]
    assert sorted(told) == sorted(item.name for item in todo)
    assert [row.frames for row in rows] == [30, 30, 0, 0, 30]
    assert "nobody is there; state the region" in rows[2].error
    assert rows[3].error == "OSError: the disk is full"
    assert [count(item) for item in todo] == [1, 2, 1, 2, 1]
    table = list(csv.DictReader((tmp_path / "out" / TABLE).open()))
    assert [(line["name"], line["hidden"]) for line in table[:2]] == [("first", "radius 3"), ("killed", "radius 3")]


def test_what_is_finished_is_not_run_again_even_without_dask(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    todo = items(tmp_path, "one", "two")
    made = [run_item(item, tmp_path / "out" / item.name, toy_work) for item in todo]
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    assert run_batch(todo, tmp_path / "out", work=toy_work) == made
    assert run_item(todo[0], tmp_path / "out" / "one", toy_work) == made[0]
    assert [count(item) for item in todo] == [1, 1]
    with pytest.raises(BatchError, match=r"Dask is not installed.*bonetrack\[batch\]"):
        run_batch([*todo, *items(tmp_path, "three")], tmp_path / "out", work=toy_work)


def test_an_existing_scheduler_does_the_work(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed", reason="Dask is not installed (extra: batch)")
    with distributed.LocalCluster(n_workers=1, processes=False, scheduler_kwargs={"dashboard": False}) as cluster:
        rows = run_batch(items(tmp_path, "one"), tmp_path / "out", scheduler=cluster.scheduler_address, work=toy_work)
        assert cluster.status.name == "running"  # whoever started it ends it
    assert [row.error for row in rows] == [""]


def test_results_of_another_recording_are_not_taken_for_this_ones(tmp_path: Path) -> None:
    item = items(tmp_path, "one")[0]
    run_item(item, tmp_path / "out", toy_work)
    other = replace(item, anatomy="lower-limb-left")
    assert finished(other, tmp_path / "out") is None
    assert "results of another anatomy; give another --out" in run_item(other, tmp_path / "out", toy_work).error
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").touch()
    assert "not of a batch" in run_item(item, tmp_path / "mine", toy_work).error
    assert count(item) == 1


def test_a_folder_of_recordings_is_read_in_the_order_of_their_names(tmp_path: Path) -> None:
    for name in ("walk", "run", "notes"):
        (tmp_path / name).mkdir()
    for name in ("walk", "run"):
        (tmp_path / name / "recording.json").touch()
    assert read_items(tmp_path, anatomy="a") == [
        Item("run", tmp_path / "run", "a"),
        Item("walk", tmp_path / "walk", "a"),
    ]
    with pytest.raises(BatchError, match="no anatomy is stated; state it"):
        read_items(tmp_path)


def test_a_table_states_names_subjects_and_regions(tmp_path: Path) -> None:
    table = tmp_path / "table.csv"
    table.write_text(
        "recording,anatomy,name,subject,region\nr/walk,leg,,,\nr/walk,arm,walk-arm,s.npz,-1 -1 -1 1 1 1.5\n"
    )
    plain, full = read_items(table)
    assert plain == Item("walk", tmp_path / "r/walk", "leg")
    assert full == Item("walk-arm", tmp_path / "r/walk", "arm", tmp_path / "s.npz", (-1.0, -1.0, -1.0, 1.0, 1.0, 1.5))


def test_what_is_said_of_the_person_is_kept_with_the_item_and_goes_into_the_adaptation(tmp_path, monkeypatch) -> None:
    table = tmp_path / "batch.csv"
    table.write_text("recording,anatomy,height,mass,sex\nr,leg,,,\nr2,lower-limb-right,1.62,55,female\n")
    anybody, she = read_items(table)
    assert anybody.person == ANYBODY
    assert "person" not in anybody.described()  # as earlier versions wrote it
    assert she.described()["person"] == {"height_m": 1.62, "mass_kg": 55.0, "sex": "female"}
    swinging(tmp_path / "r2", LEFT, RIGHT)
    people = []

    def noted(out, recording, anatomy, options, **_):
        people.append(options.person)
        raise CloudError("far enough")

    monkeypatch.setattr("adapt.adapt_to_file.adapt_into", noted)
    with pytest.raises(CloudError, match="far enough"):
        adapt_and_track(she, tmp_path / "out")
    assert people == [Person(1.62, 55.0, "female")]


def test_a_point_near_the_person_is_kept_with_the_item_and_names_his_region(tmp_path: Path, monkeypatch) -> None:
    table = tmp_path / "table.csv"
    table.write_text("recording,anatomy,near\nr,leg,\nr2,leg,0.6 0 1.8\n")
    anybody, somebody = read_items(table)
    assert "near" not in anybody.described()  # as earlier versions wrote it
    assert somebody.described()["near"] == [0.6, 0.0, 1.8]
    swinging(tmp_path / "r2", LEFT, RIGHT)
    regions = []

    def noted(recording, subject, out, options, **_):
        regions.append(options.region)
        raise CloudError("far enough")

    monkeypatch.setattr("track.track_recording.track_recording", noted)
    monkeypatch.setattr("adapt.subject.load_subject", lambda *_, **__: None)
    with pytest.raises(CloudError, match="far enough"):
        adapt_and_track(replace(somebody, subject=tmp_path / "s.npz"), tmp_path / "out")
    assert 0.0 < regions[0].minimum[0] < 0.6 < regions[0].maximum[0]


@pytest.mark.parametrize(
    ("content", "saying"),
    [
        ("anatomy\nleg\n", "no column recording"),
        ("recording,anatomy,colour\nr,leg,red\n", "unknown column colour"),
        ("recording,anatomy\nr,leg\nr,leg\n", "2 items are called r; tell them apart"),
        ("recording,anatomy\n,leg\n", "line 2: not one value for each column"),
        ("recording,anatomy\nr,leg,arm\n", "line 2: not one value for each column"),
        ("recording,anatomy\nr,\n", "line 2: no anatomy is stated"),
        ("recording,anatomy,name\nr,leg,../r\n", "cannot name a folder"),
        ("recording,anatomy,region\nr,leg,0 0 0 1 1\n", "is no region"),
        ("recording,anatomy,region\nr,leg,0 0 0 1 -1 1\n", "is no region"),
        ("recording,anatomy,near\nr,leg,0 0\n", "is no point; give x y z"),
        ("recording,anatomy,near\nr,leg,0 0 nan\n", "is no point"),
        ("recording,anatomy,height\nr,leg,178\n", "give metres"),
        ("recording,anatomy,mass\nr,leg,heavy\n", "no height and no mass; give m and kg"),
        ("recording,anatomy,sex\nr,leg,man\n", "give male or female"),
        ("recording,anatomy,subject,height\nr,leg,s.npz,1.8\n", "both a subject and a person"),
        ("recording,anatomy,region,near\nr,leg,0 0 0 1 1 1,0 0 0\n", "both a region and a point"),
        ("recording,anatomy\n", "there are no recordings"),
    ],
)
def test_a_wrong_table_is_refused_with_its_line(tmp_path: Path, content: str, saying: str) -> None:
    table = tmp_path / "table.csv"
    table.write_text(content)
    with pytest.raises(BatchError, match=saying):
        read_items(table)


def test_a_recording_that_nobody_calibrated_is_calibrated_first(limb: KnownLimb, tmp_path: Path) -> None:
    recording = tmp_path / "rec"
    shutil.copytree(limb.recording.path, recording)
    (recording / "calibration.json").unlink()
    for sensor in limb.recording.sensors:  # a few frames are enough
        listed = recording / sensor.name / "frames.csv"
        listed.write_text("".join(listed.read_text().splitlines(keepends=True)[:4]))
    subject = limb.recording.path.parent / "subject.npz"
    row = run_item(Item("arm", recording, ANATOMY, subject), tmp_path / "out" / "arm", adapt_and_track)
    assert (row.error, row.frames, row.lost) == ("", 3, 0)
    assert open_recording(recording).calibration is not None
    (recording / "calibration.json").unlink()
    (recording / "sensor2" / "box.csv").unlink()
    row = run_item(Item("bare", recording, ANATOMY, subject), tmp_path / "out" / "bare", adapt_and_track)
    assert "sensor2: there are no images of the calibration box; record the box" in row.error


def test_a_missing_recording_fails_alone_and_a_bad_file_is_no_table(tmp_path: Path) -> None:
    row = run_item(Item("gone", tmp_path / "gone", "upper-limb-right"), tmp_path / "out" / "gone", adapt_and_track)
    assert "gone" in row.error
    write_table(tmp_path / "table.csv", [row])
    assert row.error in (tmp_path / "table.csv").read_text()
    (tmp_path / "bad.csv").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(BatchError, match="not a CSV file"):
        read_items(tmp_path / "bad.csv")
    with pytest.raises(BatchError, match="no such folder or file"):
        read_items(tmp_path / "nothing")


class PausedCluster:
    """What a Dask client says of a cluster whose processes hold too much memory to take work."""

    def __init__(self, *states: str, executing: int = 0) -> None:
        self._states, self._executing = states, executing

    def scheduler_info(self) -> dict[str, Any]:
        metrics = {"task_counts": {"executing": self._executing}}
        workers = {f"tcp://{k}": {"status": status, "metrics": metrics} for k, status in enumerate(self._states)}
        return {"workers": workers}


def test_processes_that_are_all_paused_are_not_waited_for() -> None:
    with pytest.raises(BatchError, match="all 2 processes are paused"):
        track.batch.run_batch._refuse_if_paused(PausedCluster("paused", "paused"))
    track.batch.run_batch._refuse_if_paused(PausedCluster("paused", "running"))
    track.batch.run_batch._refuse_if_paused(PausedCluster("paused", "paused", executing=1))  # they end what they began


def test_the_processes_of_a_machine_share_its_memory_whatever_its_cores() -> None:
    """Dask's own choice; were it a core's part for each, many processes would be allowed more than there is."""
    system = pytest.importorskip("distributed.system", reason="Dask is not installed (extra: batch)")
    with track.batch.run_batch._client(None, 3, 0) as client:
        limits = [worker["memory_limit"] for worker in client.scheduler_info()["workers"].values()]
    assert len(limits) == 3
    assert 0.8 * system.MEMORY_LIMIT < sum(limits) <= system.MEMORY_LIMIT


def test_a_batch_looks_again_and_again_while_it_waits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    looked: list[int] = []
    monkeypatch.setattr(track.batch.run_batch, "_LOOK_EVERY_S", 0.2)
    monkeypatch.setattr(track.batch.run_batch, "_refuse_if_paused", lambda client: looked.append(1))
    rows = run_batch([Item("slow", tmp_path / "slow", ANATOMY)], tmp_path / "out", workers=1, work=_slow)
    assert [row.name for row in rows] == ["slow"]
    assert looked


def _slow(item: Item, folder: Path) -> Row:
    time.sleep(1.0)
    return Row(item.name)


def test_names_are_whole_where_the_table_goes_into_a_file(tmp_path: Path) -> None:
    name = "a-very-long-name-of-a-recording-that-nobody-would-want-to-be-cut-" + "x" * 60
    said = subprocess.run(
        [sys.executable, "-c", f"from track.batch.commands import print_rows\nfrom track.batch.work import Row\n"
         f"print_rows([Row({name!r}, hidden='hand 12', error='one line that is long enough to be wrapped ' * 4)])"],
        capture_output=True, text=True, check=True, env=os.environ | {"COLUMNS": "60"},
    ).stdout  # fmt: skip
    assert name in said
