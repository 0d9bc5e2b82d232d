"""docs/extending.md, word for word: its pieces of Python make one file, and its commands run in their order."""

from __future__ import annotations

import csv
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from adapt.anatomy_file import load_anatomy
from adapt.own_anatomy import content
from adapt.subject import load_subject
from track.motion import load_motion
from track.view.scene import open_scene

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "extending.md"
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where somebody did all that the page says."""
    folder, programs = tmp_path_factory.mktemp("work"), tmp_path_factory.mktemp("programs")
    for name, what in (("python", '"$@"'), ("bonetrack", '-c "from track.cli import main; main()" "$@"')):
        (programs / name).write_text(f'#!/bin/sh\nexec "{sys.executable}" {what}\n')
        (programs / name).chmod(0o755)
    paths = {"PATH": f"{programs}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}
    pieces = [text for kind, text in BLOCKS if kind == "python"]
    (folder / "make_limb.py").write_text("\n\n".join(pieces), encoding="utf-8")
    for commands in (text for kind, text in BLOCKS if kind == "sh"):
        for command in commands.splitlines():
            ran = subprocess.run(
                command, shell=True, cwd=folder, env=os.environ | paths, capture_output=True, text=True, check=False
            )
            assert ran.returncode == 0, f"{command}\n{ran.stdout}{ran.stderr}"
    return folder


def test_the_page_has_nothing_but_python_and_commands() -> None:
    assert {kind for kind, _ in BLOCKS} == {"python", "sh"}
    commands = [line.split()[1] for kind, text in BLOCKS if kind == "sh" for line in text.splitlines()]
    assert {"adapt", "track", "report", "export", "batch"} <= set(commands)


def test_the_toy_is_tracked_as_well_as_the_page_says(folder: Path) -> None:
    assert load_motion(folder / "motion").tracked.all()
    errors = json.loads((folder / "errors.json").read_text())["errors"]
    assert max(errors[f"centre {joint}"]["mean"] for joint in ("shoulder", "elbow", "wrist")) < 3.0
    assert max(errors[f"angle {name}"]["mean"] for name in ("elbow_bend", "wrist_tilt")) < 1.0


def test_report_tables_model_and_batch_are_there(folder: Path) -> None:
    assert "toy-limb" in (folder / "report.html").read_text(encoding="utf-8")
    assert {"angles.mot", "motion.glb"} <= {path.name for path in (folder / "tables").iterdir()}
    assert {"toy-limb.osim", "paddle.ply"} <= {path.name for path in (folder / "model").iterdir()}
    with (folder / "results" / "batch.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    assert (row["name"], row["frames"], row["lost"], row["error"]) == ("bending", "20", "0", "")


def test_the_subject_is_shown_without_the_file(folder: Path) -> None:
    anatomy = folder / "toy-limb.npz"
    away = anatomy.rename(folder / "away.npz")
    try:
        subject = load_subject(folder / "subject.npz")
        scene = open_scene(folder / "motion", subject=folder / "subject.npz", recording=folder / "recordings/bending")
    finally:
        away.rename(anatomy)
    assert content(subject.anatomy) == content(load_anatomy(anatomy))
    assert np.isfinite(scene.body.v_hat).all()


def test_the_other_side_of_the_toy_needs_no_file(folder: Path) -> None:
    assert load_anatomy(folder / "toy-limb-mirrored.npz").side == "left"
