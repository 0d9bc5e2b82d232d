"""Comparisons: differences that are known, their intervals, labels, sides, and statistical parametric mapping."""

from __future__ import annotations

import csv
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from adapt.anatomy import Anatomy, Floats
from adapt.anatomy_file import load_anatomy
from tests.real_motions import leg_motion
from tests.test_curves import RATE, bends
from track.about import About, note_about, read_about
from track.cli import bonetrack
from track.curves.compare_command import labels_of
from track.curves.comparison import Comparison, Labelled, Sample, compare, difference
from track.curves.comparison_files import write_comparison
from track.curves.motion_curves import CurvesError, CurvesOptions, motion_curves
from track.curves.parametric_mapping import parametric_mapping
from track.motion import Motion, MotionError, save_motion

LEVEL = np.ones(101)


def sample(means: list[float], *, lasting: float = 0.0, subject: str | None = "s", side: str = "right") -> Sample:
    return Sample("x", np.outer(means, LEVEL), np.outer(means, [0.5, 1.5]), lasting * LEVEL, frozenset({subject}), side)


def repeated(arm: Anatomy, sizes: list[float], seed: int = 0) -> Motion:
    """The elbow bends and straightens in two seconds, by twice each size (rad)."""
    t = np.arange(100 * len(sizes)) / RATE
    noise = np.random.default_rng(seed).normal(0.0, 0.003, len(t))
    return bends(arm, np.repeat(sizes, 100) * (1.0 - np.cos(np.pi * t)) + noise)


def labelled(arm: Anatomy, label: str, sizes: list[float], **rest: str | None) -> Labelled:
    options = CurvesOptions(cutoff_hz=6.0, by="elbow_flexion")
    return Labelled(label, motion_curves(repeated(arm, sizes, seed=len(sizes)), arm, options), **rest)


def of_elbow(found: Comparison) -> tuple[float, float, float]:
    """The difference of the elbow's ranges, in degrees, with its interval."""
    angle = next(angle for angle in found.angles if angle.key == "elbow_flexion")
    number = next(number for number in angle.numbers[0] if number.name == "range")
    return number.difference, number.low, number.high


def test_a_known_difference_before_and_after_is_found(arm: Anatomy) -> None:
    before = labelled(arm, "before", [0.50, 0.48, 0.52, 0.50, 0.49])
    after = labelled(arm, "after", [0.70, 0.69, 0.71, 0.68, 0.72])
    value, low, high = of_elbow(compare([before, after]))
    assert value == pytest.approx(np.rad2deg(0.4), abs=0.5)  # twice 0.2, all of the way
    assert 0.0 < low < value < high


def test_intervals_hold_the_true_difference_as_often_as_they_say() -> None:
    rng, held = np.random.default_rng(4), 0
    for _ in range(1000):
        first, other = rng.normal(0.0, 3.0, 4), rng.normal(2.0, 1.0, 9)
        found = difference(sample(list(first)), sample(list(other)))
        held += bool(found.low[0] <= 2.0 <= found.high[0])
    assert 930 <= held <= 970


def test_what_lasts_widens_the_interval_unless_both_are_of_one_subject_file() -> None:
    first, other = [9.0, 10.0, 11.0], [14.0, 15.0, 16.0]

    def half(one: str | None, two: str | None) -> float:
        found = difference(sample(first, lasting=2.0, subject=one), sample(other, lasting=2.0, subject=two))
        return float(found.high[0] - found.value[0])

    assert half("a", "b") == half(None, None) == pytest.approx(np.hypot(half("a", "a"), 1.96 * np.sqrt(8.0)), rel=1e-3)
    assert half("a", "a") == pytest.approx(2.776 * np.sqrt(2.0 / 3.0), rel=1e-3)


def test_one_cycle_has_no_interval() -> None:
    found = difference(sample([1.0]), sample([2.0, 3.0]))
    assert found.value[0] == 1.5
    assert np.isnan(found.low).all()


def test_motions_of_one_label_are_a_group_of_their_mean_cycles(arm: Anatomy) -> None:
    people = [labelled(arm, "patients", [size] * 4) for size in (0.5, 0.6, 0.7)]
    others = [labelled(arm, "others", [size] * 5) for size in (0.8, 0.9)]
    found = compare([*people, *others])
    assert found.labels == ("patients", "others")
    assert [len(one.values) for one in found.angles[0].samples] == [3, 2]


def test_left_and_right_are_compared_by_movement_with_their_symmetry() -> None:
    legs = [
        Labelled(side, motion_curves(leg_motion("squats_opencap_s4", side), load_anatomy(f"lower-limb-{side}")))
        for side in ("right", "left")
    ]
    found = compare(legs)
    assert [angle.key for angle in found.angles][3] == "knee_angle"
    ranges = [next(n for n in angle.numbers[0] if n.name == "range") for angle in found.angles]
    knee = ranges[3]
    assert knee.symmetry == pytest.approx(200.0 * (knee.other - knee.first) / (knee.other + knee.first))
    assert abs(knee.symmetry) < 10.0


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"kind": "stride"}, "cycles are of different kinds: repetition, stride"),
        ({"by": "pro_sup"}, "repetitions are of different angles: elbow_flexion, pro_sup"),
        ({"cycles": ()}, "no angle has a whole cycle in every group"),
        ({"curves": {}}, "the motions have no angle in common"),
    ],
)
def test_what_cannot_be_compared_is_told_in_one_line(arm: Anatomy, change: dict[str, object], told: str) -> None:
    one = labelled(arm, "one", [0.5, 0.5])
    other = replace(one, label="other", curves=replace(one.curves, **change))
    with pytest.raises(CurvesError, match=told):
        compare([one, other])


def test_one_group_is_none_to_compare(arm: Anatomy) -> None:
    with pytest.raises(CurvesError, match="there is one group only"):
        compare([labelled(arm, "one", [0.5, 0.5])])


def test_parametric_mapping_finds_where_in_the_cycle_curves_differ() -> None:
    pytest.importorskip("spm1d", reason="needs pip install 'bonetrack[statistics]'")
    assert where_they_differ(bump=10.0) == [pytest.approx((30.0, 50.0), abs=6.0)]
    assert where_they_differ(bump=0.0) == []


def where_they_differ(*, bump: float) -> list[tuple[float, float]]:
    rng, percent = np.random.default_rng(7), np.arange(101.0)

    def curves() -> Floats:
        size, turn = rng.normal(0.0, 1.0, (8, 1)), rng.normal(0.0, 1.0, (8, 1))
        return (
            size + turn * np.sin(2.0 * np.pi * percent / 100.0) + rng.normal(0.0, 0.2, (8, 1)) * np.cos(percent / 5.0)
        )

    found = parametric_mapping(curves(), curves() + bump * np.exp(-(((percent - 40.0) / 6.0) ** 2)))
    assert found is not None
    return [(start, end) for start, end, p in found.clusters if p < 0.05]


def test_two_cycles_are_too_few_for_parametric_mapping() -> None:
    pytest.importorskip("spm1d", reason="needs pip install 'bonetrack[statistics]'")
    assert parametric_mapping(np.zeros((2, 101)), np.zeros((5, 101))) is None


def test_without_spm1d_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "spm1d", None)
    result = CliRunner().invoke(bonetrack, ["compare", "a", "b", "--spm", "--out", str(tmp_path / "out")])
    assert str(result.exception) == "--spm needs spm1d; pip install 'bonetrack[statistics]'"


def test_files_hold_the_numbers_and_the_curves(arm: Anatomy, tmp_path: Path) -> None:
    found = compare([labelled(arm, "before", [0.5, 0.48, 0.52]), labelled(arm, "after", [0.7, 0.69, 0.71, 0.7])])
    write_comparison(found, {}, tmp_path)
    with (tmp_path / "numbers.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["coordinate"] == "elbow_flexion"]
    assert [(row["group"], row["against"], row["number"]) for row in rows] == [
        ("after", "before", name) for name in ("least", "largest", "range")
    ]
    assert float(rows[2]["difference"]) == pytest.approx(of_elbow(found)[0])
    assert float(rows[1]["low_95"]) < float(rows[1]["difference"]) < float(rows[1]["high_95"])
    with (tmp_path / "differences.csv").open(encoding="utf-8") as file:
        assert len(list(csv.DictReader(file))) == 101 * len(found.angles)
    told = json.loads((tmp_path / "comparison.json").read_text(encoding="utf-8"))
    assert told["groups"]["before"]["elbow_flexion"] == 3
    assert (tmp_path / "comparison.png").stat().st_size > 20_000


def test_the_command_compares_motions_by_what_is_noted_of_them(arm: Anatomy, tmp_path: Path) -> None:
    for session, sizes in (("before", [0.5, 0.48, 0.52]), ("after", [0.7, 0.69, 0.71])):
        folder = tmp_path / session / "motion"
        folder.mkdir(parents=True)
        save_motion(repeated(arm, sizes), folder)
        note_about(folder, person="P07", session=session)
    motions = [str(tmp_path / session / "motion") for session in ("before", "after")]
    result = CliRunner().invoke(bonetrack, ["compare", *motions, "--by", "elbow_flexion", "--out", str(tmp_path / "o")])
    assert result.exit_code == 0, result.output
    assert "elbow flexion, range: " in result.output
    assert "deg P07 before, " in result.output


def test_motions_are_never_made_a_group_by_chance(tmp_path: Path) -> None:
    paths = [tmp_path / name / "motion" for name in ("a", "b")]
    assert labels_of(paths) == ("a/motion", "b/motion")
    for path in paths:
        path.mkdir(parents=True)
        note_about(path, person="P07")
    assert labels_of(paths) == ("a/motion", "b/motion")


def test_what_is_noted_stays_with_the_motion_and_can_be_added_to(tmp_path: Path) -> None:
    note_about(tmp_path, person="P07", note="left knee taped")
    note_about(tmp_path, session="after", note=None)
    assert read_about(tmp_path) == About(person="P07", session="after", note="left knee taped")
    (tmp_path / "about.json").write_text("[]")
    with pytest.raises(MotionError, match=r"about\.json: is no file of notes"):
        read_about(tmp_path)
