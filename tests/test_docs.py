"""The pages of docs/: the example runs, the site builds, and the pages name what there is."""

from __future__ import annotations

import ast
import doctest
import importlib
import importlib.util
import inspect
import re
import runpy
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import click
import numpy as np
import pytest

from tests.test_curves import bends
from track.cli import bonetrack
from track.motion import load_motion, save_motion

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"


def test_the_example_in_python_runs_and_finds_the_arm(limb, tmp_path, capsys):
    """With the known subject as one made before: adapting takes a minute, and is tested elsewhere."""
    out = tmp_path / "out"
    out.mkdir()
    shutil.copy(limb.recording.path.parent / "subject.npz", out)
    runpy.run_path(str(DOCS / "examples" / "sample_to_bones.py"))["main"](limb.recording.path, out)
    said = capsys.readouterr().out
    assert "elbow" in said
    assert "motion.glb" in said
    motion = load_motion(out / "motion")
    assert motion.tracked.all()
    surface = np.load(out / "ulna_00000.npy")
    assert surface.shape == limb.subject.body.rest_bones["ulna"].shape
    assert (out / "motion.glb").stat().st_size > 100_000


def test_the_example_of_curves_says_how_far_an_elbow_moves(arm, tmp_path, capsys):
    turns = np.arange(300) / 50.0
    save_motion(bends(arm, 1.0 - np.cos(np.pi * turns)), tmp_path)
    runpy.run_path(str(DOCS / "examples" / "curves_of_a_motion.py"))["main"](tmp_path)
    said = capsys.readouterr().out
    assert "elbow flexion: moves 114.6 ± 0.0 degrees, at up to 18" in said
    assert "in the middle of the mean repetition: 114.6 degrees (3 cycles)" in said


def test_the_site_builds_without_a_warning(tmp_path):
    pytest.importorskip("material", reason="needs pip install '.[docs]'")
    command = [
        sys.executable,
        "-m",
        "mkdocs",
        "build",
        "-f",
        ".mkdocs.yml",
        "--strict",
        "--quiet",
        "--site-dir",
        str(tmp_path / "site"),
    ]
    ran = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert (tmp_path / "site" / "first-steps" / "index.html").is_file()
    in_python = re.sub("<[^>]*>", "", (tmp_path / "site" / "python" / "index.html").read_text(encoding="utf-8"))
    assert "def main(source: Path, out: Path)" in in_python  # the script itself stands on its page


def test_every_command_of_the_pages_is_one_that_the_program_has():
    """Commands, their options and how many names they take; nothing is run."""
    lines = [
        line.split("#")[0].strip()
        for page in [ROOT / "README.md", *DOCS.glob("*.md")]
        for line in page.read_text(encoding="utf-8").splitlines()
    ]
    given = [found[1] for line in lines if (found := re.match(r"(?:\S*/)?bonetrack ([a-z].*)", line))]
    assert len(given) > 30
    for words in map(shlex.split, given):
        command = bonetrack.commands[words[0]]
        with click.Context(command, info_name=words[0]) as context:
            command.parse_args(context, words[1:])


def test_every_script_and_module_that_the_pages_run_exists():
    pages = "\n".join(page.read_text(encoding="utf-8") for page in [ROOT / "README.md", *DOCS.glob("*.md")])
    scripts = set(re.findall(r"python3? ((?:docs|tests)/[\w/]+\.py)", pages))
    modules = set(re.findall(r"python3? -m ((?:capture|adapt|track|tests)[\w.]*)", pages))
    assert len(scripts) > 5
    assert len(modules) > 3
    assert not [script for script in scripts if not (ROOT / script).is_file()]
    assert not [module for module in modules if importlib.util.find_spec(module) is None]


PACKAGES = ("capture", "adapt", "track")
WITH_EXAMPLES = [
    path.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".")
    for package in PACKAGES
    for path in sorted((ROOT / package).rglob("*.py"))
    if ">>> " in path.read_text(encoding="utf-8")
]


@pytest.mark.parametrize("module", WITH_EXAMPLES)
def test_the_examples_in_docstrings_say_what_comes_out(module):
    imported = importlib.import_module(module)
    ran = doctest.testmod(imported, optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
    assert ran.attempted >= inspect.getsource(imported).count(">>> ")  # none is passed over
    assert ran.failed == 0


def test_every_link_and_picture_of_the_pages_exists():
    missing = []
    for page in [ROOT / "README.md", *DOCS.glob("*.md")]:
        for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
            if not target.startswith(("http", "#")) and not (page.parent / target.partition("#")[0]).exists():
                missing.append(f"{page.name}: {target}")
    assert not missing


def test_every_message_of_the_page_of_errors_is_in_the_code():
    """The page quotes messages with an ellipsis where the program puts in what it is about."""
    said = "\n".join(_texts())
    quoted = re.findall(r"\*\*`([^`]+)`\*\*", (DOCS / "errors.md").read_text(encoding="utf-8"))
    assert len(quoted) > 10
    lost = [message for message in quoted for part in message.split("...") if part.strip() and part.strip() not in said]
    assert not lost


def _texts() -> list[str]:
    """Every text in the program, f-strings with an ellipsis for what they put in."""
    texts = []
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.JoinedStr):
                    texts.append("".join(str(v.value) if isinstance(v, ast.Constant) else "..." for v in node.values))
                elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                    texts.append(node.value)
    return texts
