"""The wheel holds what commands use, and nothing else: read from the sources and from setuptools' configuration.

``python -m tests.test_wheel`` prints how much of the code that is.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Sequence
from fnmatch import fnmatchcase
from pathlib import Path

import pytest

from tests.sources import PACKAGES, ROOT, imports, modules, reached

COMMANDS = "track.cli"
MOST_SHARE = 0.72  # of the lines of all Python in the three packages; commands have come to reach more of them


def shipped_files() -> set[Path]:
    """What setuptools puts into the wheel by pyproject.toml, modules and data, relative to the checkout."""
    setup = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
    find, data = setup["packages"]["find"], setup["package-data"]
    files = set()
    for path in (path for package in PACKAGES for path in (ROOT / package).rglob("*.py")):
        package = ".".join(path.parent.relative_to(ROOT).parts)
        if _matches(package, find["include"]) and not _matches(package, find["exclude"]):
            files.add(path.relative_to(ROOT))
    for package, patterns in data.items():
        found = (path for pattern in patterns for path in (ROOT / package).glob(pattern))
        files |= {path.relative_to(ROOT) for path in found if path.is_file()}
    return files


def _matches(package: str, patterns: Sequence[str]) -> bool:
    return any(fnmatchcase(package, pattern) for pattern in patterns)


@pytest.fixture(scope="module")
def shipped() -> set[str]:
    """The modules in the wheel."""
    files = {ROOT / path for path in shipped_files()}
    return {name for name, path in modules().items() if path in files}


def documented() -> set[str]:
    """The modules that docs/python.md names, with all in them, and those that its example imports."""
    page = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    example = (ROOT / "docs" / "examples" / "sample_to_bones.py").read_text(encoding="utf-8")
    named = set(re.findall(r"`((?:capture|adapt|track)[.\w]*)`", page))
    named |= set(re.findall(r"^from ((?:capture|adapt|track)[.\w]*) import", example, re.MULTILINE))
    return {module for module in modules() if any(module == name or module.startswith(f"{name}.") for name in named)}


def test_every_module_of_the_wheel_serves_a_command_or_the_documented_interface(shipped):
    assert sorted(shipped - reached({COMMANDS} | (documented() & shipped))) == []


def test_what_is_documented_is_in_the_wheel(shipped):
    assert documented() <= shipped


def test_nothing_in_the_wheel_imports_what_is_not_in_it(shipped):
    strays = [
        f"{name} imports {other}" for name in sorted(shipped) for other in imports()[name] if other not in shipped
    ]
    assert strays == []


def test_the_evaluation_and_the_template_builder_are_left_out(shipped):
    outside = set(modules()) - shipped
    assert {"adapt.template_builder.__main__", "track.evaluation.protocol", "track.evaluation.field_trials"} <= outside
    assert all(name.startswith(("adapt.template_builder", "track.evaluation")) for name in outside)


def test_the_wheel_alone_imports_and_has_its_templates(tmp_path):
    for path in shipped_files():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).symlink_to(ROOT / path)
    script = f"""
import importlib
from adapt.anatomy_file import anatomy_names, load_anatomy
for name in {sorted(reached([COMMANDS]))}:
    assert importlib.import_module(name).__file__.startswith({str(tmp_path)!r}), name
print([load_anatomy(name).name for name in anatomy_names()])
"""
    command = [sys.executable, "-c", script]
    ran = subprocess.run(
        command,
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    assert "upper-limb-right" in ran.stdout
    assert "lower-limb-right" in ran.stdout


@pytest.mark.parametrize(
    ("program", "page"),
    [
        ("track.evaluation.protocol", "README.md"),
        ("track.evaluation.protocol", "docs/accuracy.md"),
        ("track.evaluation.field_trials", "docs/field-trials.md"),
        ("track.evaluation.paper", "docs/evaluation.md"),
        ("adapt.template_builder", "README.md"),
    ],
)
def test_programs_outside_the_wheel_run_from_a_checkout_by_the_command_on_their_page(program, page):
    assert f"python -m {program} " in (ROOT / page).read_text(encoding="utf-8")
    command = [sys.executable, "-m", program, "--help"]
    ran = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr


def lines(names: set[str]) -> int:
    """How many lines of Python modules have."""
    return sum(len(modules()[name].read_text(encoding="utf-8").splitlines()) for name in names)


def test_the_wheel_does_not_grow_beyond_its_share(shipped):
    assert lines(shipped) <= MOST_SHARE * lines(set(modules()))


if __name__ == "__main__":
    here = {name for name, path in modules().items() if path.relative_to(ROOT) in shipped_files()}
    sys.stdout.write(f"{lines(here)} of {lines(set(modules()))} lines of Python are in the wheel\n")
