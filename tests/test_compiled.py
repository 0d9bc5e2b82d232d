"""Machine code that is kept is not taken up again when what went into it has changed."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from capture import compiled

OUTER = """
from capture.compiled import compiled
from capture.inner import doubled
from capture.{kinds} import Pair
from capture.numbers_of_it import MORE


@compiled
def of_pair(pair):
    return doubled(pair.one) + MORE


def result(x):
    return of_pair(Pair(x, x))
"""
KINDS = """
from typing import NamedTuple


class Pair(NamedTuple):
    one: float
    other: float
"""
INNER = """
from capture.compiled import compiled


@compiled
def doubled(x):
    return {factor} * x
"""


def run(folder: Path) -> tuple[float, int]:
    """What the outer function makes of 1, and how often its machine code was taken from what is kept."""
    script = (
        "from capture.outer import of_pair, result; value = result(1.0); "
        "hits = of_pair.stats.cache_hits.values(); print(value, sum(hits))"
    )
    environment = os.environ | {"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run([sys.executable, "-c", script], env=environment, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    value, hits = done.stdout.split()
    return float(value), int(hits)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    package = tmp_path / "capture"
    package.mkdir()
    (package / "__init__.py").touch()
    shutil.copy(str(compiled.__file__), package / "compiled.py")
    (package / "outer.py").write_text(OUTER.format(kinds="kinds"))
    (package / "kinds.py").write_text(KINDS)
    (package / "inner.py").write_text(INNER.format(factor=2.0))
    (package / "numbers_of_it.py").write_text("MORE = 1.0\n")
    return tmp_path


def test_a_change_in_another_file_is_noticed_and_nothing_else_compiled_again(folder: Path) -> None:
    assert run(folder) == (3.0, 0)
    assert run(folder) == (3.0, 1)
    (folder / "capture" / "inner.py").write_text(INNER.format(factor=5.0))
    assert run(folder) == (6.0, 0)
    (folder / "capture" / "numbers_of_it.py").write_text("MORE = 4.0\n")
    assert run(folder) == (9.0, 0)
    assert run(folder) == (9.0, 1)


def test_a_class_that_has_moved_does_not_stand_in_the_way(folder: Path) -> None:
    """Numba reads what it kept, the class's old place included, before it asks whether that is old."""
    assert run(folder) == (3.0, 0)
    package = folder / "capture"
    (package / "kinds.py").rename(package / "sorts.py")
    (package / "outer.py").write_text(OUTER.format(kinds="sorts"))
    assert run(folder) == (3.0, 0)
    assert run(folder) == (3.0, 1)


def test_what_is_old_is_not_left_behind(folder: Path) -> None:
    run(folder)
    kept = sorted(path.name for path in (folder / "capture" / "__pycache__").glob("outer.*.nb?"))
    (folder / "capture" / "inner.py").write_text(INNER.format(factor=5.0))
    run(folder)
    now = sorted(path.name for path in (folder / "capture" / "__pycache__").glob("outer.*.nb?"))
    assert len(now) == len(kept) > 0
    assert not set(now) & set(kept)


def test_without_sources_to_read_it_is_compiled_anew(folder: Path) -> None:
    """As from an archive: nothing tells whether what was kept is old."""
    capture = folder / "capture"
    text = (capture / "compiled.py").read_text()
    (capture / "compiled.py").write_text(text.replace("path.read_bytes()", "(path / 'none').read_bytes()"))
    assert run(folder) == (3.0, 0)
    assert run(folder) == (3.0, 0)
