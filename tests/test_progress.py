"""How far work has come is told in files and pipes; logs keep all that is said; quiet commands tell problems alone."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import click
import pytest

import capture.progress
from capture.console import begin_log, end_log, stdout, tell
from capture.progress import progress
from tests.command_line import bonetrack
from tests.test_cli import fails
from track.cli import bonetrack as group
from track.command_group import COMMON


@pytest.fixture
def soon(monkeypatch):
    """Lines come soon, not only every few seconds."""
    monkeypatch.setattr(capture.progress, "EVERY_S", 0.02)


def lines_while(capsys, *at) -> list[str]:
    """What is printed while work stands at these places, one after the other, until a line says so of each."""
    said = ""
    with progress("tracking") as work:
        for place in at:
            work.at(*place)
            before, deadline = said.count("\n"), time.monotonic() + 5.0
            while said.count("\n") < before + 2 and time.monotonic() < deadline:
                time.sleep(0.005)
                said += capsys.readouterr().out
    return said.splitlines()


def test_a_line_tells_the_step_the_share_and_the_time_left(capsys, soon):
    said = lines_while(capsys, (10, 90, "10 of 90 frames"), (20, 90, "20 of 90 frames"), (45, 90, "45 of 90 frames"))
    assert any(line.startswith("tracking: 10 of 90 frames, 11 % done") for line in said)
    assert said[-1].startswith("tracking: 45 of 90 frames, 50 % done, about ")
    assert said[-1].endswith(" s left")


def test_where_nobody_knows_how_much_there_is_the_time_so_far_is_told(capsys, soon):
    assert lines_while(capsys, (7, None, "7 frames"))[0] == "tracking: 7 frames, 0 s so far"


def test_work_that_ends_at_once_says_nothing(capsys):
    with progress("tracking") as work:
        work.at(1, 1)
    assert capsys.readouterr().out == ""


def test_lines_end_with_the_work_even_if_it_fails(capsys, soon):
    with pytest.raises(ValueError, match="broken"), progress("tracking"):
        raise ValueError("broken")
    capsys.readouterr()
    time.sleep(0.1)
    assert capsys.readouterr().out == ""


def test_the_log_has_what_a_quiet_command_does_not_show(tmp_path, limb):
    log, cloud = tmp_path / "logs" / "log.txt", tmp_path / "cloud.ply"
    ran = bonetrack("fuse", limb.recording.path, "--frame", 0, "--out", cloud, "--quiet", "--log", log)
    assert (ran.code, ran.out, ran.err) == (0, "", "")
    first, *others = log.read_text(encoding="utf-8").splitlines()
    assert f"bonetrack fuse {limb.recording.path} --frame 0" in first
    assert any("points from 2 sensor(s)" in line for line in others)
    assert bonetrack("fuse", limb.recording.path, "--frame", 0, "--out", cloud).out  # the next is shown again


def test_the_log_has_the_error_too_and_what_earlier_runs_said(tmp_path):
    log = tmp_path / "log.txt"
    log.write_text("what an earlier run said\n", encoding="utf-8")
    said = fails("calibrate", tmp_path / "nowhere", "--log", log, saying="nowhere")
    kept = log.read_text(encoding="utf-8").splitlines()
    assert (kept[0], kept[-1]) == ("what an earlier run said", said)


def test_a_log_is_not_wrapped_and_takes_brackets_as_they_are(tmp_path):
    begin_log(tmp_path / "log.txt", "bonetrack")
    try:
        tell("a [b] " * 100)
        stdout.print("in words", highlight=False)
    finally:
        end_log()
    tell("said later")
    assert (tmp_path / "log.txt").read_text(encoding="utf-8").splitlines()[1:] == ["a [b] " * 100, "in words"]


def test_where_a_bar_shows_the_work_the_log_has_the_lines(tmp_path, capsys, soon, monkeypatch):
    monkeypatch.setattr(stdout, "_force_terminal", True)
    begin_log(tmp_path / "log.txt", "bonetrack")
    try:
        with progress("tracking") as work:
            work.at(1, 4)
            deadline = time.monotonic() + 5.0
            while "25 % done" not in (tmp_path / "log.txt").read_text(encoding="utf-8") and time.monotonic() < deadline:
                time.sleep(0.005)
    finally:
        end_log()
    lines = (tmp_path / "log.txt").read_text(encoding="utf-8").splitlines()
    assert set(lines[1:]) <= {"tracking, 0 s so far", "tracking, 25 % done, 0 s so far"}
    assert "25 % done" not in capsys.readouterr().out


def test_a_log_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    ran = bonetrack("calibrate", tmp_path, "--log", tmp_path / "file" / "log.txt")
    assert ran.code == 2
    assert str(tmp_path / "file" / "log.txt") in ran.err


def test_every_command_can_be_logged_and_be_quiet():
    for command in group.commands.values():
        assert set(COMMON) <= {parameter.name for parameter in command.params}, command.name


def test_the_help_has_every_command_in_a_section_and_whole_sentences():
    with click.Context(group, info_name="bonetrack") as context:
        assert sorted(group.list_commands(context)) == sorted(group.commands)
    said = bonetrack("--help").out
    assert [line for line in said.splitlines() if line in ("Capture:", "Adapt:", "Track:", "Take out:", "Check:")]
    assert "..." not in said.replace("[ARGS]...", "")
    for command in group.commands.values():
        assert command.get_short_help_str(limit=1000) in " ".join(said.split()), command.name


def test_shells_can_complete_commands():
    command = [sys.executable, "-c", "from track.cli import main; main()"]
    asked = {"_BONETRACK_COMPLETE": "bash_complete", "COMP_WORDS": "bonetrack cal", "COMP_CWORD": "1"}
    ran = subprocess.run(command, env=os.environ | asked, capture_output=True, text=True, check=False)
    assert "calibrate" in ran.stdout, ran


@pytest.mark.parametrize(("command", "says"), [("track", "goes on from here"), ("calibrate", "stopped\n")])
def test_whoever_stops_a_command_is_told_whether_it_goes_on(monkeypatch, limb, tmp_path, command, says):
    def interrupted(_):
        raise KeyboardInterrupt

    monkeypatch.setattr("capture.recording.open_recording", interrupted)
    more = ("--subject", tmp_path / "s.npz", "--out", tmp_path / "m") if command == "track" else ()
    ran = bonetrack(command, limb.recording.path, *more)
    assert (ran.code, says in ran.err) == (1, True)


def test_a_name_of_another_format_is_refused_before_the_work(limb, tmp_path):
    for suffix, arguments in {
        ".xyz": ("fuse", limb.recording.path, "--frame", 0, "--out"),
        ".txt": ("adapt", limb.recording.path, "--anatomy", "upper-limb-right", "--out"),
        ".csv": ("evaluate", tmp_path, "--out"),
        ".pdf": ("report", tmp_path, "--out"),
        ".png": ("view", tmp_path, "--html"),
    }.items():
        out = tmp_path / f"result{suffix}"
        ran = bonetrack(*arguments, out)
        assert ran.code == 2
        assert f"result{suffix}: this is written as" in ran.err
        assert not out.exists()


def test_the_time_left_goes_by_this_run_and_grows_while_nothing_is_done(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(capture.progress.time, "monotonic", lambda: now[0])
    with progress("tracking") as work:
        work.at(500, 1000)  # what an earlier run did
        assert "left" not in work.in_words()
        now[0] = 110.0
        work.at(600, 1000)
        assert work.in_words() == "tracking, 60 % done, about 40 s left"
        now[0] = 120.0
        assert work.in_words() == "tracking, 60 % done, about 1 min 20 s left"
        work.at(10, 1000)  # the next sensor begins
        assert "left" not in work.in_words()
