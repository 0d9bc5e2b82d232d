"""Subjects and motions from strangers: nothing unpickled, no memory for what is not there, one line for each."""

from __future__ import annotations

import io
import json
import pickle
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from adapt.subject import load_subject
from capture import files
from capture.errors import BonetrackError
from tests.fuzz.targets import made_files
from track.motion import load_motion

Members = dict[str, bytes]


def array(value: object) -> bytes:
    written = io.BytesIO()
    np.save(written, np.asarray(value))
    return written.getvalue()


def headed(shape: str) -> bytes:
    """An array file without numbers that claims a shape."""
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".encode()
    header += b" " * (-(len(header) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header


def described(members: Members, **changes: object) -> bytes:
    description = json.loads(str(np.load(io.BytesIO(members["description.npy"]))))
    return array(json.dumps(description | changes))


def written(path: Path, file: bytes, change: Callable[[Members], Members]) -> Path:
    """The file with some of its members changed."""
    with zipfile.ZipFile(io.BytesIO(file)) as old, zipfile.ZipFile(path, "w") as new:
        members = {name: old.read(name) for name in old.namelist()}
        for name, data in (members | change(members)).items():
            new.writestr(name, data)
    return path


BAD: dict[str, Callable[[Members], Members]] = {
    "a header that is no Python": lambda m: {"times.npy": headed("(2,), {")},
    "a member that is no array": lambda m: {"times.npy": b"2 seconds"},
    "a claim of 8 petabytes": lambda m: {"times.npy": headed("(1000000000000000,)")},
    "a pickle": lambda m: {"times.npy": pickle.dumps(np.zeros(2))},
    "pickled objects in an array": lambda m: {"times.npy": array(np.array([{}, []], dtype=object))},
    "brackets without end": lambda m: {"description.npy": array("[" * 100_000)},
    "fewer times than poses": lambda m: {"times.npy": array(np.zeros(1))},
    "poses of another anatomy": lambda m: {"thetas.npy": array(np.zeros((2, 3)))},
    "no times": lambda m: {"times.npy": array(0.0)},
}


@pytest.mark.parametrize("kind", ["subject", "motion"])
@pytest.mark.parametrize("what", BAD)
def test_what_is_no_subject_or_motion_is_refused_in_one_line(tmp_path: Path, kind: str, what: str) -> None:
    made, load = {"subject": (made_files()[0], load_subject), "motion": (made_files()[1], load_motion)}[kind]
    load(written(tmp_path / "good.npz", made, lambda m: {}))
    with pytest.raises(BonetrackError, match=rf"bad\.npz: not a {kind} file; make one with") as error:
        load(written(tmp_path / "bad.npz", made, BAD[what]))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("options", [{}, {"region_minimum_m": [0, 0], "region_maximum_m": [1, 1]}, []])
def test_a_motion_whose_settings_name_no_region_is_refused_in_one_line(tmp_path: Path, options: object) -> None:
    settings = {"versions": {}, "options": options, "thresholds": {}}
    path = written(
        tmp_path / "bad.npz", made_files()[1], lambda m: {"description.npy": described(m, settings=settings)}
    )
    with pytest.raises(BonetrackError, match=r"bad\.npz: not a motion file; make one with"):
        load_motion(path)


def test_a_small_file_that_would_become_enormous_is_refused_before_it_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bomb = written(tmp_path / "bomb.npz", made_files()[1], lambda m: {"zeros.npy": array(np.zeros(10_000))})
    load_motion(bomb)
    monkeypatch.setattr(files, "MOST_BYTES", 80_000)
    monkeypatch.setattr(np, "load", lambda *_, **__: pytest.fail("was read"))
    with pytest.raises(BonetrackError, match="not a motion file"):
        load_motion(bomb)


@pytest.mark.parametrize("name", ["../upper-limb-right", "/etc/upper-limb-right", "other.npz", ["upper-limb-right"]])
def test_a_subject_cannot_name_a_file_for_its_anatomy(tmp_path: Path, name: object) -> None:
    path = written(tmp_path / "subject.npz", made_files()[0], lambda m: {"description.npy": described(m, anatomy=name)})
    with pytest.raises(BonetrackError, match="not a subject file"):
        load_subject(path)
