"""Journals give back what was written into them, to the last bit, and only that from which work can go on."""

from __future__ import annotations

import numpy as np
import pytest

from capture.journal import resume_journal

KEY = "0" * 64


@pytest.mark.parametrize("what", ["row", "empty", "square", "symmetric", "unknown", "nearly symmetric", "no square"])
def test_floats_come_back_to_the_last_bit(what, tmp_path):
    rng = np.random.default_rng(1)
    square = rng.normal(size=(5, 5)) * 10.0 ** rng.integers(-300, 300, (5, 5))
    nearly = square + square.T
    nearly[1, 2] = np.nextafter(nearly[1, 2], np.inf)
    array = {
        "row": np.array([0.1, -0.0, np.inf, -np.inf, 5e-324]),
        "empty": np.zeros((0, 0)),
        "square": square,
        "symmetric": square + square.T,
        "unknown": np.full((3, 3), np.nan),
        "nearly symmetric": nearly,
        "no square": rng.normal(size=(2, 3)),
    }[what]
    resume_journal(tmp_path / "journal", KEY).append({"values": array, "ints": np.arange(3), "one": np.float64(0.1)})
    [entry] = resume_journal(tmp_path / "journal", KEY).entries
    assert entry["values"].shape == array.shape
    assert entry["values"].tobytes() == array.tobytes()
    assert (entry["ints"], entry["one"]) == ([0, 1, 2], 0.1)


def test_a_symmetric_array_takes_half_the_room(tmp_path):
    half = np.random.default_rng(2).normal(size=(20, 20))
    for name, array in (("whole", half), ("half", half + half.T)):
        resume_journal(tmp_path / name, KEY).append(array)
    assert (tmp_path / "half").stat().st_size < 0.55 * (tmp_path / "whole").stat().st_size


def test_work_goes_on_from_the_last_entry_that_it_can_go_on_from(tmp_path):
    journal = resume_journal(tmp_path / "journal", KEY)
    for entry in ({"frame": 0, "state": 1}, {"frame": 1}, {"frame": 2, "state": 3}, {"frame": 3}):
        journal.append(entry)
    resumed = resume_journal(tmp_path / "journal", KEY, goes_on=lambda entry: "state" in entry)
    assert [entry["frame"] for entry in resumed.entries] == [0, 1, 2]
    resumed.append({"frame": 3, "state": 4})
    assert [entry["frame"] for entry in resume_journal(tmp_path / "journal", KEY).entries] == [0, 1, 2, 3]
