"""The field trials: cases are run once and kept, judged by the truth, and make the page."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from adapt.anatomy import Floats
from adapt.anatomy_file import load_anatomy
from adapt.model.body import Body, joint_centres, make_body, pose_skin, rest_theta
from adapt.model.size import resized
from track.evaluation import field_trials
from track.evaluation.field_trials import outcome_of
from track.evaluation.results import EvaluationError
from track.evaluation.trials import fit, table
from track.evaluation.trials.command import Told
from track.evaluation.trials.page import page_text
from track.evaluation.trials.people import ARM, part_of
from track.evaluation.trials.real import situations_of
from track.evaluation.trials.sensors import as_disparity
from track.evaluation.trials.situation import SEEDS, SOUND_SEED, Outcome, Situation, Verdict
from track.evaluation.trials.times import change_times
from track.simulation.performance import Performance


def toy(runs: list[int], verdict: Verdict = "refused") -> Situation:
    def run(seed: int, folder: Path) -> Outcome:
        assert not list(folder.iterdir())
        (folder / "recording").mkdir()
        runs.append(seed)
        return Outcome(verdict, "a | line\nof <two>", {"seed": seed})

    return Situation("toy case", 1, "a toy", "nothing", run)


def numbers(mean: float, within: float | None) -> dict[str, object]:
    return {"angles": {"elbow": {"mean": mean, "max": mean}}, "within_2_sd": within}


def test_a_case_is_run_once_and_read_afterwards(tmp_path: Path) -> None:
    runs: list[int] = []
    case = toy(runs)
    first = outcome_of(case, 101, tmp_path, run=True)
    assert outcome_of(case, 101, tmp_path, run=True) == first
    assert outcome_of(case, 102, tmp_path, run=False) is None
    assert runs == [101]


def test_a_case_that_was_cut_short_begins_in_an_empty_folder(tmp_path: Path) -> None:
    left = tmp_path / "toy-case" / "101.unfinished" / "recording"
    left.mkdir(parents=True)
    outcome_of(toy([]), 101, tmp_path, run=True)
    assert not left.exists()


def test_a_folder_that_no_case_left_is_not_emptied(tmp_path: Path) -> None:
    kept = tmp_path / "toy-case" / "101" / "thesis.txt"
    kept.parent.mkdir(parents=True)
    kept.write_text("mine")
    with pytest.raises(EvaluationError, match="without its outcome"):
        outcome_of(toy([]), 101, tmp_path, run=True)
    assert kept.read_text() == "mine"


def test_a_file_that_is_no_outcome_is_refused(tmp_path: Path) -> None:
    (tmp_path / "toy-case").mkdir()
    (tmp_path / "toy-case" / "101.json").write_text("[]", encoding="utf-8")
    with pytest.raises(EvaluationError, match="delete it"):
        outcome_of(toy([]), 101, tmp_path, run=True)


def test_the_page_shows_every_situation_and_names_the_losses() -> None:
    bad, good = toy([], "WRONG WITHOUT A WORD"), toy([])
    outcome = Outcome("WRONG WITHOUT A WORD", "a | line\nof <two>")
    text = page_text([bad], {bad.name: {101: outcome}}, split="held")
    assert "Silent wrong results: 1" in text
    assert "- toy case, variant 101: WRONG WITHOUT A WORD" in text
    assert "| a toy | nothing | **WRONG WITHOUT A WORD**: a \\| line of &lt;two> |" in text
    assert "not run" in page_text([good], {}, split="held")


def test_further_sound_recordings_are_counted_and_those_not_right_named() -> None:
    shares = [Outcome("right", "", {"within_2_sd": share}) for share in (0.9, 1.0)]
    cases = [
        ("sound arm", 1001, shares[0]),
        ("sound arm", 1002, Outcome("refused", "no fit")),
        ("leg", 1003, shares[1]),
    ]
    text = page_text([], {}, split="held", sound=cases)
    assert "3 further ones" in text
    assert "2 right, 1 refused" in text
    assert "within two stated deviations: sound arm 90 %, leg 100 %." in text
    assert "sound arm, seed 1002: refused: no fit" in text


def test_further_sound_recordings_take_the_controls_in_turn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    runs: list[int] = []
    case = replace(toy(runs, "right"), control=True)
    monkeypatch.setattr(field_trials, "SITUATIONS", [case, replace(case, name="other", control=False)])
    arguments = ["--out", str(tmp_path), "--sound", "2", "--only", "none"]
    assert CliRunner().invoke(field_trials.main, arguments).exit_code == 0
    assert runs == [SOUND_SEED, SOUND_SEED + 1]


def test_a_control_must_not_be_refused_and_no_case_may_be_wrong_without_a_word() -> None:
    case = toy([])
    control = Situation("control", 1, "", "", case.run, control=True)
    assert case.good(Outcome("refused", ""))
    assert not control.good(Outcome("refused", ""))
    assert not case.good(Outcome("WRONG WITHOUT A WORD", ""))
    assert not case.good(Outcome("failed", ""))


def test_a_verdict_asks_for_small_errors_and_for_deviations_that_cover_them() -> None:
    assert fit._verdict(numbers(1.0, 0.95), [], same_side=True) == "right"
    assert fit._verdict(numbers(1.0, 0.50), [], same_side=True) == "overconfident"
    assert fit._verdict(numbers(20.0, 0.50), [], same_side=True) == "WRONG WITHOUT A WORD"
    assert fit._verdict(numbers(20.0, 0.95), [], same_side=True) == "said"
    one_frame = numbers(1.0, 0.95) | {"gross_frames": 1}
    assert fit._verdict(one_frame, [], same_side=True) == "WRONG WITHOUT A WORD"
    assert fit._verdict(numbers(20.0, 0.50), ["warning: doubtful"], same_side=True) == "said"


def test_a_frame_is_far_off_only_where_its_deviation_does_not_tell() -> None:
    errors, stated = {"elbow": np.array([1.0, 130.0, 130.0, np.nan])}, {"elbow": np.array([2.0, 7.0, 100.0, 1.0])}
    assert fit.gross_frames(errors, stated) == 1


def test_a_result_for_the_wrong_side_is_wrong_unless_it_speaks_of_the_side() -> None:
    assert fit._verdict(numbers(1.0, None), ["warning: slow"], same_side=False) == "WRONG WITHOUT A WORD"
    assert fit._verdict(numbers(1.0, None), ["the side is undecided"], same_side=False) == "said"


def test_an_ending_that_tells_nothing_is_no_refusal() -> None:
    assert fit.refused(Told(1, "", "error: x: is empty; give another"), {}).verdict == "refused"
    assert fit.refused(Told(1, "", "error: two limbs; say which by --near X Y Z"), {}).verdict == "asked"
    assert fit.refused(Told(1, "", "error: unexpected ValueError: NaN"), {}).verdict == "failed"
    assert fit.refused(Told(None, "", "no end"), {}).verdict == "failed"


def test_a_body_of_another_size_has_all_its_joints_as_far_apart_as_that() -> None:
    body = make_body(load_anatomy(ARM))
    small = resized(body, 0.6)
    theta = rest_theta(body)

    def spans(who: Body) -> Floats:
        centres = np.array(list(joint_centres(who, theta).values()))
        return np.asarray(np.linalg.norm(np.diff(centres, axis=0), axis=1))

    assert spans(small) == pytest.approx(0.6 * spans(body), rel=1e-6)
    assert np.ptp(pose_skin(small, theta), axis=0).max() < 0.7 * np.ptp(pose_skin(body, theta), axis=0).max()


def test_a_part_of_the_skin_is_closed_where_it_is_cut() -> None:
    body = make_body(load_anatomy(ARM))
    performance = Performance(body, np.zeros(1), rest_theta(body)[None])
    skin, faces = part_of(performance, ("humerus", "ulna", "radius"))
    vertices = skin(pose_skin(body, performance.thetas[0]))
    assert faces.max() < len(vertices) < len(body.anatomy.skin_vertices)
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()


def test_disparity_falls_where_depth_falls_and_stands_for_nothing_at_its_largest() -> None:
    raw = as_disparity(np.array([0, 600, 1200, 2400], dtype=np.uint16))
    assert raw.tolist() == [2047, 542, 813, 949]


def test_times_are_changed_in_a_list_of_frames(tmp_path: Path) -> None:
    path = tmp_path / "frames.csv"
    path.write_text("file,time_s\na.png,0.5\nb.png,1.5\n", encoding="utf-8")
    change_times(path, lambda times: [2.0 * time for time in times])
    assert path.read_text(encoding="utf-8") == "file,time_s\na.png,1.0\nb.png,3.0\n"


def test_variants_that_bounds_are_set_on_are_not_reported() -> None:
    assert not set(SEEDS["tuning"]) & set(SEEDS["held"])


def test_situations_have_names_of_their_own() -> None:
    names = [situation.name for situation in table.SITUATIONS]
    assert len(names) == len(set(names))


def test_without_real_recordings_they_are_skipped_with_a_reason(tmp_path: Path) -> None:
    assert situations_of(None) == ([], "no --real given")
    assert "no such folder" in situations_of(tmp_path / "none")[1]


def test_the_command_runs_what_is_asked_for_and_writes_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs: list[int] = []
    monkeypatch.setattr(field_trials, "SITUATIONS", (toy(runs),))
    page = tmp_path / "page.md"
    options = ["--out", str(tmp_path / "out"), "--variants", "1", "--page", str(page)]
    result = CliRunner().invoke(field_trials.main, options)
    assert result.exit_code == 0, result.output
    assert runs == [101]
    assert "**refused**" in page.read_text(encoding="utf-8")
    assert CliRunner().invoke(field_trials.main, [*options, "--only", "other"]).exit_code == 0
    assert runs == [101]
