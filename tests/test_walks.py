"""docs/walks.md: four people go from raw files to their answer, each by at most two commands, as the page has them."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import shutil
import xml.etree.ElementTree as xml
from pathlib import Path

import numpy as np
import pygltflib
import pytest

from tests.command_line import Ran, bonetrack, inside
from tests.known_limb import FRAMES
from tests.raw_files import RUN
from tests.sources import ROOT
from track.motion import load_motion
from track.run.steps import STEPS

PAGE = (ROOT / "docs" / "walks.md").read_text(encoding="utf-8")
MOST_COMMANDS = 2


def section(title: str) -> str:
    return next(part for part in PAGE.split("\n## ") if part.startswith(title))


def blocks(title: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", section(title), re.DOTALL)


def walk(title: str) -> list[Ran]:
    """Give the commands of a section, in the folder where one is; what they said."""
    commands = [shlex.split(line) for block in blocks(title, "sh") for line in block.splitlines()]
    assert 0 < len(commands) <= MOST_COMMANDS
    assert {program for program, *_ in commands} == {"bonetrack"}
    said = [bonetrack(*words) for _, *words in commands]
    assert [ran.code for ran in said] == [0] * len(said), said
    return said


@pytest.fixture
def folder(finished_run, tmp_path):
    """Raw images with the results of the first walk: what stands there already is done, and is not done again."""
    return shutil.copytree(finished_run.folder, tmp_path / "walk")


def elbow_is_found(results: Path, limb) -> None:
    motion = load_motion(results / "motion")
    elbow = motion.coordinates.index("elbow_flexion")
    assert np.abs(np.rad2deg(motion.thetas[:, elbow] - limb.thetas[:, elbow])).max() < 5.0


def test_a_therapists_assistant_gets_a_report_of_images_and_a_file(finished_run, limb):
    asked, *command = (shlex.split(line) for line in blocks("A therapist", "sh")[0].splitlines())
    assert command == [["bonetrack", *RUN]]  # by which the results were made from nothing but images and that file
    assert finished_run.said.code == 0, finished_run.said
    with inside(finished_run.folder):
        assert "The machine" in bonetrack(*asked[1:]).out
    page = (finished_run.results / "report.html").read_text(encoding="utf-8")
    assert f"{FRAMES} of {FRAMES} frames tracked" in page
    assert "Range of motion" in page
    elbow_is_found(finished_run.results, limb)


def test_an_engineer_gets_a_model_and_a_motion_for_opensim_and_a_table(folder, limb):
    before = (folder / "results" / "motion" / "motion.npz").stat().st_mtime_ns
    with inside(folder):
        said = walk("An engineer")
    assert said[0].out.count("done before, with the same choices") == len(STEPS)  # which the file stated as well
    assert (folder / "results" / "motion" / "motion.npz").stat().st_mtime_ns == before
    exports = folder / "results" / "exports"
    model = xml.parse(exports / "upper-limb-right.osim").getroot()
    coordinates = {found.get("name") for found in model.iter("Coordinate")}
    lines = (exports / "angles.mot").read_text(encoding="utf-8").split("endheader")[1].splitlines()
    assert set(lines[1].split()[1:]) <= coordinates
    assert len(lines) == FRAMES + 2
    assert (exports / "markers.trc").is_file()
    assert (folder / "tables" / "angles.parquet").is_file()
    elbow_is_found(folder / "results", limb)


def test_an_artist_gets_an_animated_skeleton_and_a_page_to_look_at(folder):
    with inside(folder):
        walk("A character artist")
    scene = pygltflib.GLTF2().load(str(folder / "results" / "exports" / "motion.glb"))
    assert scene.animations
    assert scene.skins
    assert (folder / "scene.html").stat().st_size > 100_000


def test_a_programmer_gets_arrays_and_another_threshold(folder, limb):
    said = io.StringIO()
    with inside(folder):
        walk("A research programmer")
        with contextlib.redirect_stdout(said):
            exec(blocks("A research programmer", "python")[0], {})
    lowest, highest, sure = map(float, re.findall(r"[\d.]+", said.getvalue().splitlines()[0]))
    true = np.rad2deg(limb.thetas[:, limb.subject.anatomy.coordinate_index("elbow_flexion")])
    assert abs(lowest - true.min()) < 5.0
    assert abs(highest - true.max()) < 5.0
    assert 0.1 < sure < 5.0
    assert said.getvalue().splitlines()[1] == "0.6"


def test_every_walk_of_the_page_is_walked():
    titles = [part.splitlines()[0] for part in PAGE.split("\n## ")[1:]]
    walked = ["An engineer", "A therapist", "A character artist", "A research programmer"]
    assert [title.startswith(start) for title, start in zip(titles, walked, strict=True)] == [True] * len(walked)
