"""`bonetrack doctor`: what is here, what is missing for what, and an exit code that holds."""

from __future__ import annotations

import re
import tomllib
from importlib import metadata

import psutil
import pytest
from packaging.requirements import Requirement

from tests.command_line import bonetrack
from tests.sources import ROOT
from track.doctor import machine, packages
from track.doctor.packages import WHAT_FOR, extras, program

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
FOR_DEVELOPERS = {"all", "benchmark", "build", "docs", "lint", "opensim", "test", "train"}


def asks_for(monkeypatch, *lines):
    monkeypatch.setattr(packages, "requirements", lambda: [Requirement(line) for line in lines])


def told(findings, state):
    return [finding.told for finding in findings if finding.state == state]


def test_every_extra_of_users_is_looked_for_and_brought_by_all():
    assert set(WHAT_FOR) == set(PROJECT["optional-dependencies"]) - FOR_DEVELOPERS
    (everything,) = PROJECT["optional-dependencies"]["all"]
    assert Requirement(everything).extras == set(WHAT_FOR)


def test_what_the_tests_run_with_is_found(monkeypatch):
    asks_for(monkeypatch, *PROJECT["dependencies"])
    found = program()
    assert [finding.state for finding in found] == ["ok"] * (1 + len(PROJECT["dependencies"]))
    assert any(finding.told.startswith("open3d ") for finding in found)


def test_a_package_that_everything_needs_and_is_missing_is_bad(monkeypatch):
    asks_for(monkeypatch, "no-such-package>=1", "numpy>=999", "pytest; extra == 'test'")
    missing, old = (finding for finding in program() if finding.state == "bad")
    assert missing.told == "no-such-package is not installed, nothing runs without it"
    assert re.fullmatch(r"numpy is of version [\d.]+ and should be >=999, nothing runs without it", old.told)
    assert all("pip install" in finding.remedy for finding in (missing, old))
    ran = bonetrack("doctor")
    assert ran.code == 1
    assert ran.err.startswith("error: not fit: no-such-package is not installed")


def test_a_package_of_one_format_names_its_extra_and_is_no_failure(monkeypatch):
    asks_for(monkeypatch, "no-such-package; extra == 'azure-kinect'")
    (finding,) = (one for one in extras() if one.state == "missing")
    assert finding.told == "no-such-package is not installed, for importing Azure Kinect files (.mkv)"
    assert finding.remedy == "pip install 'bonetrack[azure-kinect]'"
    monkeypatch.setattr("track.doctor.machine._room", lambda place: machine.Finding("ok", "room"))
    monkeypatch.setattr("track.doctor.machine._memory", lambda: machine.Finding("ok", "memory"))
    ran = bonetrack("doctor")
    assert ran.code == 0, ran.err
    assert "  missing   no-such-package is not installed" in ran.out


def test_what_cannot_be_had_on_this_machine_is_not_asked_for(monkeypatch):
    asks_for(monkeypatch, 'no-such-package; sys_platform == "amiga" and extra == "realsense-live"')
    assert [finding.state for finding in extras()] == ["not here"]


def test_a_package_that_cannot_be_imported_is_not_called_installed(monkeypatch):
    asks_for(monkeypatch, "numpy")

    def broken(name):
        raise ImportError("libsomething.so: cannot open shared object file")

    monkeypatch.setattr(packages.importlib, "import_module", broken)
    assert "cannot be imported (ImportError: libsomething.so" in told(program(), "bad")[0]


def test_a_checkout_that_nobody_installed_says_so(monkeypatch):
    def unknown(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(packages.metadata, "version", unknown)
    (finding,) = program()
    assert "runs from a checkout" in finding.told
    assert finding.remedy == "pip install . in the checkout"


@pytest.mark.parametrize(("free", "state"), [(200 << 20, "bad"), (3 << 30, "ok")])
def test_little_memory_and_a_full_disk_are_bad(monkeypatch, tmp_path, free, state):
    memory = psutil.virtual_memory()._replace(available=free)
    monkeypatch.setattr(machine.psutil, "virtual_memory", lambda: memory)
    usage = machine.shutil.disk_usage(tmp_path)._replace(free=free)
    monkeypatch.setattr(machine.shutil, "disk_usage", lambda place: usage)
    _, of_memory, of_room, *_ = machine.machine(tmp_path / "not" / "there" / "yet")
    assert (of_memory.state, of_room.state) == (state, state)
    assert str(tmp_path) in of_room.told


def test_a_place_that_cannot_be_written_to_is_bad(monkeypatch, tmp_path):
    def refused(**_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(machine.tempfile, "TemporaryFile", refused)
    ran = bonetrack("doctor", tmp_path)
    assert ran.code == 1
    assert f"{tmp_path} cannot be written to (Permission denied)" in ran.err


def test_without_a_browser_the_way_round_is_told(monkeypatch):
    def none():
        raise machine.webbrowser.Error("could not locate runnable browser")

    monkeypatch.setattr(machine.webbrowser, "get", none)
    finding = machine.machine(ROOT)[-1]
    assert finding.state == "missing"
    assert "--html" in finding.remedy


def test_every_finding_that_is_not_well_has_a_remedy(monkeypatch):
    asks_for(monkeypatch, "no-such-package", "no-such-package; extra == 'view'")
    for finding in [*program(), *extras(), *machine.machine(ROOT)]:
        assert finding.remedy or finding.state in ("ok", "not here"), finding
