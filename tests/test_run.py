"""`bonetrack run`: all steps by one command, resumed where it stopped, its choices in a file beside the results."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import click
import numpy as np
import pytest

from tests.command_line import bonetrack, inside
from tests.test_cli import fails
from track.cli import bonetrack as group
from track.command_group import COMMON
from track.motion import load_motion
from track.run.choices import Choices, RunError, checked, read_choices
from track.run.run_steps import MOTION, PAGE, SUBJECT
from track.run.steps import STEPS
from track.run.written_choices import write_choices

NAMES = [step.name for step in STEPS]


def done_again(out: str) -> list[str]:
    """The steps that a run did, by what it said."""
    heads = [line for line in out.splitlines() if line.startswith("step ")]
    return [line.split(", ")[1].split(":")[0] for line in heads if line.endswith(":")]


def changed(path: Path, *pairs: tuple[str, str]) -> None:
    text = path.read_text(encoding="utf-8")
    for old, new in pairs:
        assert old in text, (old, text)
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")


def test_one_command_makes_motion_tables_and_report_of_raw_images(finished_run, limb):
    assert finished_run.said.code == 0, finished_run.said
    assert done_again(finished_run.said.out) == NAMES
    made = {path.relative_to(finished_run.results).as_posix() for path in finished_run.results.rglob("*")}
    assert {"bonetrack.toml", "steps.json", "subject.npz", "report.html", "motion/angles.mot"} <= made
    assert {"exports/angles.csv", "exports/upper-limb-right.osim", "recording/calibration.json"} <= made
    motion = load_motion(finished_run.results / MOTION)
    elbow = motion.coordinates.index("elbow_flexion")
    apart = np.rad2deg(motion.thetas[:, elbow] - limb.thetas[:, elbow])
    assert np.abs(apart).max() < 5.0
    assert not [path for path in made if "partial" in path]


def test_the_same_command_does_nothing_again_and_needs_no_more_than_the_folder(finished_run, tmp_path):
    results = finished_run.copy(tmp_path / "results")
    before = {path: path.stat().st_mtime_ns for path in results.rglob("*") if path.is_file()}
    ran = bonetrack("run", "--out", results)
    assert ran.code == 0, ran.err
    assert done_again(ran.out) == []
    assert ran.out.count("done before, with the same choices") == len(STEPS)
    assert {path: path.stat().st_mtime_ns for path in results.rglob("*") if path.is_file()} == before


def test_a_changed_choice_does_again_what_depends_on_it_and_nothing_else(finished_run, tmp_path):
    results = finished_run.copy(tmp_path / "results")
    said = [bonetrack("run", "--out", results, "--gltf"), bonetrack("run", "--out", results)]
    assert [done_again(ran.out) for ran in said] == [["export"], []]
    assert (results / "exports" / "motion.glb").is_file()
    bonetrack("run", "--out", results, "--set", "track.threshold", '[["least_coverage", 0.6]]')
    assert load_motion(results / MOTION).settings.thresholds["least_coverage"] == 0.6
    assert tomllib.loads((results / "bonetrack.toml").read_text())["track"]["threshold"] == [["least_coverage", 0.6]]


def test_what_was_taken_away_is_made_again(finished_run, tmp_path):
    results = finished_run.copy(tmp_path / "results")
    (results / "exports" / "angles.csv").unlink()
    (results / PAGE).unlink()
    assert done_again(bonetrack("run", "--out", results).out) == ["export", "report"]
    assert (results / "exports" / "angles.csv").is_file()


def test_a_run_that_was_stopped_goes_on_with_the_next_step(finished_run, tmp_path):
    results = finished_run.copy(tmp_path / "results")
    steps = json.loads((results / "steps.json").read_text())
    for step in ("track", "export", "report"):
        del steps["steps"][step]
    (results / "steps.json").write_text(json.dumps(steps))
    ran = bonetrack("run", "--out", results, "--leave-out", "report", "--leave-out", "export")
    assert done_again(ran.out) == ["track"]
    assert ran.out.count("left out") == 2


def test_comments_and_order_of_the_file_stay(finished_run):
    text = (finished_run.results / "bonetrack.toml").read_text(encoding="utf-8")
    assert text.startswith("[adapt]\nposes = 4\n") or "[adapt]\nposes = 4\n" in text
    assert 'first-poses = "../first.csv"  # saves a search' in text
    assert 'anatomy = "upper-limb-right"' in text


def test_other_files_into_the_same_results_are_refused(finished_run, tmp_path):
    results = finished_run.copy(tmp_path / "results")
    subject = (results / SUBJECT).read_bytes()
    said = fails("run", finished_run.folder / "right", "--out", results, saying="has results of other files: left")
    assert "give another --out" in said
    assert (results / SUBJECT).read_bytes() == subject


def test_a_recording_is_taken_as_it_is_and_one_that_is_calibrated_stays_so(limb, tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr("track.run.run_steps._command", lambda step, words, where: asked.append(step.name))
    run = ("run", limb.recording.path, "--out", tmp_path / "results", "--anatomy", "upper-limb-right")
    before = (limb.recording.path / "calibration.json").stat().st_mtime_ns
    bonetrack(*run)
    assert asked == ["adapt"]  # which makes nothing here, so that the run ends
    assert (limb.recording.path / "calibration.json").stat().st_mtime_ns == before


def test_a_file_without_any_choice_is_written_with_what_is_usual_and_reads_back_the_same(tmp_path):
    choices = Choices(("/left.bag", "/right.bag"), (), {"adapt": {"anatomy": "upper-limb-right"}})
    write_choices(tmp_path / "bonetrack.toml", choices)
    again = read_choices(tmp_path / "bonetrack.toml")
    assert again.files == tuple(str(Path(file).resolve()) for file in choices.files)
    assert [again.of(step) for step in STEPS] == [choices.of(step) for step in STEPS]
    text = (tmp_path / "bonetrack.toml").read_text(encoding="utf-8")
    for step in STEPS:
        for key in step.options:
            assert f"\n{key} = " in text or f"\n# {key} = " in text, f"{step.name}.{key}"


def test_every_option_of_every_step_can_stand_in_the_file():
    """What cannot is what the run itself states: files of the steps before, and where to write."""
    for step in STEPS:
        assert group.commands[step.name] is step.command
        asked = {parameter.name for parameter in step.command.params}
        missing = asked - {option.name for option in step.options.values()} - set(COMMON)
        assert missing == step.stated_by_run & asked, step.name
        assert step.stated_by_run <= asked, step.name


def test_what_stands_in_the_file_is_what_the_command_is_asked_for():
    examples = {
        "near": [0.0, -0.5, 2.0],
        "threshold": [["least_coverage", 0.6]],
        "offset": "-0.5",
        "fx": [500.0, 510.0],
    }
    for step in STEPS:
        values = {key: examples[key] for key in step.options if key in examples}
        context = click.Context(step.command)
        step.command.parse_args(context, [*step.arguments(values), *_required(step.command)])
        for key, value in values.items():
            taken = context.params[step.options[key].name]
            assert json.loads(json.dumps(taken)) == value, key


def _required(command: click.Command) -> list[str]:
    given = [
        word
        for option in command.params
        if isinstance(option, click.Option) and option.required
        for word in (option.opts[0], "x")
    ]
    return [*given, *("x" for argument in command.params if isinstance(argument, click.Argument))]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("posse = 6", "posse is unknown; there are files"),
        ("[adapt]\nposse = 6", r"\[adapt\] posse is unknown; there are anatomy"),
        ("[adapting]\nposes = 6", "adapting is unknown"),
        ("[adapt]\nposes = '6'", r"\[adapt\] poses cannot be '6'; give a whole number"),
        ("[adapt]\nposes = true", r"\[adapt\] poses cannot be True; give a whole number"),
        ("[adapt]\nheight = [1.8]", r"\[adapt\] height cannot be \[1.8\]; give a number"),
        ("[adapt]\nsex = 'm'", r"\[adapt\] sex cannot be 'm': .*; give one of male, female"),
        ("[adapt]\nnear = [0.0, 1.0]", r"\[adapt\] near cannot be .*; give 3 numbers \[X, Y, Z\]"),
        ("[track]\nkeep-searching = 1", r"keep-searching cannot be 1; give true or false"),
        ("[track]\nthreshold = ['least_coverage', 0.6]", r"threshold cannot be .*; give a list of 2 values"),
        ("[import]\nwidth = 0", r"\[import\] width cannot be 0: .*; give a whole number"),
        ("[import]\nfx = ['wide']", r"\[import\] fx cannot be \['wide'\]; give a list, each a number"),
        ("adapt = 6", "adapt cannot be 6; give a section"),
        ("files = 'left.bag'", "files cannot be 'left.bag'; give a list of texts"),
        ("leave-out = ['track']", "leave-out cannot be 'track'; give of export, report"),
        ("poses = ", "is not TOML: "),
    ],
)
def test_what_cannot_be_is_one_line_that_names_key_and_file(tmp_path, text, says):
    (tmp_path / "bonetrack.toml").write_text(text, encoding="utf-8")
    said = fails("run", "--out", tmp_path, saying=str(tmp_path / "bonetrack.toml"))
    with pytest.raises(RunError, match=says) as refused:
        read_choices(tmp_path / "bonetrack.toml")
    assert str(refused.value) in said
    assert [path.name for path in tmp_path.iterdir()] == ["bonetrack.toml"]


def test_what_a_step_finds_wrong_in_its_options_is_told_of_the_file(limb, tmp_path):
    run = ("run", limb.recording.path, "--out", tmp_path / "out", "--anatomy", "upper-limb-right")
    both = ("--near", 0, 0, 1, "--region", -1, -1, -1, 1, 1, 1)
    said = fails(*run, *both, saying="[adapt] Invalid value for --near: give either a region or a point")
    assert str(tmp_path / "out" / "bonetrack.toml") in said


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--anatomy", "upper-limb-right"), "no files are named"),
        (("nowhere.bag", "--anatomy", "upper-limb-right"), "nowhere.bag: does not exist"),
        (("left",), "which limb is not stated; give --anatomy"),
        (("left", "--settings", "other.toml"), "other.toml: does not exist"),
    ],
)
def test_what_is_missing_is_told_before_any_work(tmp_path, arguments, says):
    (tmp_path / "left").mkdir()
    with inside(tmp_path):
        fails("run", *arguments, "--out", "out", saying=says)
    assert not (tmp_path / "out").exists()


def test_choices_of_another_run_are_begun_with_but_not_its_files(finished_run, limb, tmp_path, monkeypatch):
    monkeypatch.setattr("track.run.run_steps._command", lambda step, words, where: None)
    settings = finished_run.results / "bonetrack.toml"
    bonetrack("run", limb.recording.path, "--out", tmp_path / "out", "--settings", settings)
    taken, were = (
        read_choices(tmp_path / "out" / "bonetrack.toml"),
        read_choices(settings),
    )
    assert taken.files == (str(limb.recording.path),)
    assert taken.of_step["adapt"] == were.of_step["adapt"]
    assert Path(taken.of_step["adapt"]["first-poses"]).is_file()


def test_a_step_that_is_not_there_cannot_be_set(tmp_path):
    ran = bonetrack("run", tmp_path, "--out", tmp_path / "out", "--set", "poses", "8")
    assert ran.code == 2
    assert "name a step and its option, as adapt.poses" in ran.err


def test_a_number_for_all_sensors_may_stand_alone(tmp_path):
    choices = checked({"import": {"fx": 570.0}}, where=tmp_path / "bonetrack.toml")
    assert choices.of_step["import"]["fx"] == [570.0]
