"""The evaluation of the paper: cases are run once, kept, and make the page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from capture.errors import AnatomyError
from tests.toy_anatomy import toy_anatomy
from track.evaluation import paper
from track.evaluation.experiments import table_1
from track.evaluation.experiments.experiment import Experiment, Result, markdown_table, summary
from track.evaluation.known import carried
from track.evaluation.page import page_text, section
from track.evaluation.paper import ON_REAL_ANATOMY, beside_opensim, on_real_anatomy, results_of
from track.evaluation.results import EvaluationError, run_case


def counting(runs: list[str]) -> Experiment:
    def run(case: str, folder: Path) -> Result:
        runs.append(case)
        return {"error": len(runs)}

    def describe(results: Mapping[str, Result], images: Path) -> str:
        return markdown_table([["case", "error"], *[[case, str(r["error"])] for case, r in results.items()]])

    def losses(results: Mapping[str, Result]) -> list[str]:
        return [f"{len(results)} cases are too many"]

    return Experiment("counting", "Counting", ("seed 1", "seed 2"), run, describe, losses)


def test_a_case_is_run_once_and_read_afterwards(tmp_path: Path) -> None:
    runs: list[str] = []
    experiment = counting(runs)
    first = [run_case(experiment, case, tmp_path) for case in experiment.cases]
    again = [run_case(experiment, case, tmp_path) for case in experiment.cases]
    assert first == again
    assert [case.result for case in first] == [{"error": 1}, {"error": 2}]
    assert runs == ["seed 1", "seed 2"]


def test_the_page_shows_the_results(tmp_path: Path) -> None:
    experiment = counting([])
    text = section(experiment, results_of(experiment, tmp_path, experiment.cases), tmp_path)
    assert text.splitlines()[0] == "## Counting"
    assert "| seed 2 | 2 |" in text


def test_the_page_is_written_from_what_was_run_and_says_what_was_not(tmp_path: Path) -> None:
    runs: list[str] = []
    experiment = counting(runs)
    results_of(experiment, tmp_path, ["seed 1"])
    found = {"counting": results_of(experiment, tmp_path, [])}
    text = page_text([experiment], found, tmp_path / "images")
    assert runs == ["seed 1"]
    assert "1 of 2 cases have been run" in text
    assert "- Counting\n    - 1 cases are too many\n" in text
    assert "| counting | 2 | 1 |" in text


def test_the_page_says_when_a_template_has_been_built_anew_since(tmp_path: Path) -> None:
    case = run_case(counting([]), "seed 1", tmp_path)
    old = replace(case, templates={**case.templates, "upper-limb-right": "another"})
    assert "another build of" not in section(counting([]), {"seed 1": case}, tmp_path)
    assert "another build of upper-limb-right" in section(counting([]), {"seed 1": old}, tmp_path)


def test_a_file_that_is_no_result_is_told_of(tmp_path: Path) -> None:
    file = tmp_path / "counting" / "seed-1.json"
    file.parent.mkdir()
    file.write_text('{"error": 1}')
    with pytest.raises(EvaluationError, match=r"seed-1\.json: is not a result; delete it"):
        run_case(counting([]), "seed 1", tmp_path)


def test_a_summary_passes_over_what_is_not_known() -> None:
    assert summary([1.0, 3.0, np.nan]) == "2.00 ± 1.00 (3.00)"
    assert summary([np.nan]) == "-"


def test_a_pose_carried_there_and_back_is_the_same() -> None:
    anatomy = toy_anatomy()
    rng = np.random.default_rng(0)
    thetas = rng.normal(scale=0.3, size=(3, len(anatomy.coordinates)))
    turn = np.array([[0.0, -1.0, 0.0, 0.3], [1.0, 0.0, 0.0, -0.2], [0.0, 0.0, 1.0, 0.1], [0.0, 0.0, 0.0, 1.0]])
    back = carried(anatomy, carried(anatomy, thetas, turn), np.linalg.inv(turn))
    np.testing.assert_allclose(back, thetas, atol=1e-12)


def test_experiments_on_real_anatomy_are_left_out_with_a_reason_where_it_is_not(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert on_real_anatomy(None) == on_real_anatomy(tmp_path / "nowhere") == []
    told = "".join(capsys.readouterr().out.split())
    assert "no--anatomy-datagiven" in told
    assert "nosuchfolder" in told
    assert [experiment.name for experiment in on_real_anatomy(tmp_path)] == list(ON_REAL_ANATOMY)


def test_some_cases_are_run_and_those_run_before_are_shown_with_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    runs: list[str] = []
    monkeypatch.setattr(paper, "EXPERIMENTS", (counting(runs),))
    for wanted, shown in (("2", ["seed 2"]), ("1", ["seed 1", "seed 2"])):
        asked = ["--out", str(tmp_path), "--matching", wanted]
        ran = CliRunner().invoke(paper.main, asked, catch_exceptions=False)
        said = ran.output + capsys.readouterr().out
        assert [case for case in ("seed 1", "seed 2") if case in said] == shown
    assert runs == ["seed 2", "seed 1"]


def test_a_case_that_cannot_be_run_is_told_of_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def run(case: str, folder: Path) -> Result:
        raise AnatomyError("the skin source is not installed", remedy="install it")

    monkeypatch.setattr(paper, "EXPERIMENTS", (replace(counting([]), run=run),))
    ran = CliRunner().invoke(paper.main, ["--out", str(tmp_path)])
    assert ran.exit_code == 1
    assert "Error: counting: the skin source is not installed; install it" in ran.output


def test_the_comparison_with_opensim_is_left_out_with_a_reason_where_it_cannot_be_made(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert beside_opensim(None) == beside_opensim(tmp_path) == []
    assert "skipped: table-1-opensim" in capsys.readouterr().out


def test_the_page_tells_what_opensim_knows_better() -> None:
    def case(ours: float, theirs: float) -> Result:
        errors = {
            tool: {"angle a": {"mean": mean}} for tool, mean in (("bonetrack", ours), ("OpenSim x 1e-05", theirs))
        }
        return {"errors": errors, "frames": 10, "lost": 0}

    assert table_1.losses(
        {"arm seed 1": case(1.0, 2.0), "leg seed 1": case(1.0, 0.5), "leg seed 2": case(2.0, 1.0)}
    ) == ["leg, OpenSim x 1e-05 errs less in angle a (0.75, ours 1.50)"]
