"""Subjects and motions from strangers: nothing unpickled, no memory for what is not there, one line for each."""

from __future__ import annotations

import io
import json
import pickle
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from adapt.anatomy_file import load_anatomy, save_anatomy
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
    """The head of an array file that claims a shape."""
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".encode()
    header += b" " * (-(len(header) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header


def described(members: Members, **changes: object) -> bytes:
    description = json.loads(str(np.load(io.BytesIO(members["description.npy"]))))
    return array(json.dumps(description | changes))


def written(
    path: Path, file: bytes, change: Callable[[Members], Members], compression: int = zipfile.ZIP_STORED
) -> Path:
    """The file with some of its members changed."""
    with zipfile.ZipFile(io.BytesIO(file)) as old, zipfile.ZipFile(path, "w", compression) as new:
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
    refused = rf"bad\.npz: not a {kind} file(: times would .*)?; make one with"
    with pytest.raises(BonetrackError, match=refused) as error:
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


MADE = {"subject": (0, load_subject), "motion": (1, load_motion)}
HUGE = 400 << 20  # bytes, of zeros: 400 kB in a file


def memory_taken(act: Callable[[], object]) -> int:
    tracemalloc.start()
    try:
        act()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.fixture(scope="module")
def zeros() -> bytes:
    return headed(f"({HUGE // 8},)") + bytes(HUGE)


def small_file(path: Path, kind: str, name: str, data: bytes) -> Path:
    made = written(path, made_files()[MADE[kind][0]], lambda m: {name: data}, zipfile.ZIP_DEFLATED)
    assert made.stat().st_size < 5 << 20
    return made


@pytest.mark.parametrize("kind", MADE)
def test_an_enormous_array_that_nobody_knows_is_not_read(tmp_path: Path, kind: str, zeros: bytes) -> None:
    path, load = small_file(tmp_path / "extra.npz", kind, "extra.npy", zeros), MADE[kind][1]
    load(path)  # what is read once and kept
    assert memory_taken(lambda: load(path)) < 20 << 20


@pytest.mark.parametrize("kind", MADE)
def test_an_enormous_array_that_is_known_is_refused_by_name_without_taking_memory(
    tmp_path: Path, kind: str, zeros: bytes
) -> None:
    path, load = small_file(tmp_path / "bomb.npz", kind, "thetas.npy", zeros), MADE[kind][1]

    def refused() -> None:
        with pytest.raises(BonetrackError, match=rf"not a {kind} file: thetas would take 4194.* bytes of memory"):
            load(path)

    assert memory_taken(refused) < 5 << 20


def test_many_arrays_that_are_large_together_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    many = {f"transforms/{k}.npy": array(np.zeros((2, 4, 4))) for k in range(400)}
    path = written(tmp_path / "many.npz", made_files()[1], lambda m: many)
    monkeypatch.setattr(files, "MOST_BYTES", 80_000)
    with pytest.raises(BonetrackError, match=r"transforms/\d+ would take 256 bytes of memory, more than 80000 bytes"):
        load_motion(path)


def test_an_anatomy_of_ones_own_is_bounded_as_well(tmp_path: Path, zeros: bytes) -> None:
    save_anatomy(load_anatomy("upper-limb-right"), tmp_path / "own.npz")
    for name, refused in (("extra.npy", False), ("landmarks.npy", True)):
        path = written(tmp_path / f"{name}.npz", (tmp_path / "own.npz").read_bytes(), lambda m, n=name: {n: zeros})
        if not refused:
            assert load_anatomy(str(path)).landmark_names == load_anatomy("upper-limb-right").landmark_names
            continue
        with pytest.raises(BonetrackError, match="not an anatomy file: landmarks would take"):
            load_anatomy(str(path))


@pytest.mark.parametrize("name", ["../upper-limb-right", "/etc/upper-limb-right", "other.npz", ["upper-limb-right"]])
def test_a_subject_cannot_name_a_file_for_its_anatomy(tmp_path: Path, name: object) -> None:
    path = written(tmp_path / "subject.npz", made_files()[0], lambda m: {"description.npy": described(m, anatomy=name)})
    with pytest.raises(BonetrackError, match="not a subject file"):
        load_subject(path)
