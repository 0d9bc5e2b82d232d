"""What a stated height, mass and sex say of a body before it is seen, and what is left to the data."""

from __future__ import annotations

import csv
import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from adapt.anatomy_file import load_anatomy
from adapt.commands import adapt_command, print_subject
from adapt.fit.posterior import OF_PEOPLE
from adapt.fit.stated_person import lengths_told
from adapt.model.body import make_body
from adapt.model.shape.population import ANYBODY, MEN_M, POPULATION, Person, residuals
from adapt.model.shape.prior import ShapePrior, overall_size, shape_prior
from adapt.model.size import expected_body
from adapt.subject import Subject, doubts
from adapt.template_builder.population import COLUMNS
from adapt.template_builder.population import main as build
from capture.errors import BonetrackError, FitError

SUMMARY = Path(__file__).parents[2] / "shared" / "anatomy" / "population" / "ansur2_limb_summary.csv"


@pytest.fixture(scope="module")
def leg():
    return load_anatomy("lower-limb-right")


@pytest.fixture(params=["arm", "leg"])
def body(request):
    return make_body(request.getfixturevalue(request.param))


def prior(body, person: Person) -> ShapePrior:
    return shape_prior(body.anatomy, body.affine, person)


def lengths(body, shape) -> np.ndarray:
    heads = body.affine.heads(shape)
    return np.linalg.norm(np.diff(heads, axis=0), axis=1)


@pytest.mark.parametrize("person", [ANYBODY, Person(1.6), Person(1.9, 95.0, "male"), Person(1.1), Person(sex="female")])
def test_whatever_is_said_the_prior_is_a_gaussian(body, person):
    known = prior(body, person)
    np.testing.assert_allclose(known.precision, known.precision.T, rtol=1e-9)
    assert np.linalg.eigvalsh(known.precision).min() > 0.0
    assert np.isfinite(known.mean).all()


def test_the_more_is_said_of_a_woman_the_surer_is_her_shape(body):
    covariance = np.linalg.inv(prior(body, Person(sex="female")).precision)
    for person in (Person(1.7, sex="female"), Person(1.7, 70.0, "female")):
        narrower = np.linalg.inv(prior(body, person).precision)
        assert (np.diag(narrower) <= np.diag(covariance) * (1.0 + 1e-6)).all()
        covariance = narrower


def test_tall_people_have_long_bones_and_longer_shanks_still(leg):
    body = make_body(leg)
    small, tall = (lengths(body, prior(body, Person(height, sex="male")).mean) for height in (1.6, 1.9))
    growth = tall / small
    names = dict(zip(("pelvis", "femur", "tibia", "foot"), growth, strict=True))
    assert 1.0 < names["femur"] < 1.0 + 1.4 * 0.3 / 1.6
    assert names["tibia"] > 1.9 / 1.6


def test_a_heavy_person_has_thicker_joints_and_hardly_longer_bones(body):
    light, heavy = (prior(body, Person(1.75, mass, "male")).mean for mass in (65.0, 110.0))
    assert (body.affine.scales(heavy) > body.affine.scales(light) - 1e-3).all()
    assert body.affine.scales(heavy).max() > body.affine.scales(light).max() + 0.01
    np.testing.assert_allclose(lengths(body, heavy)[1:], lengths(body, light)[1:], rtol=0.04)


def test_a_childs_height_gives_a_small_body_of_usual_proportions(body):
    """The survey has no children: their height is not put into its equations."""
    child, anybody = prior(body, Person(1.15)), prior(body, ANYBODY)
    ratio = lengths(body, child.mean) / lengths(body, anybody.mean)
    np.testing.assert_allclose(ratio, 1.15 / MEN_M, rtol=0.02)
    assert residuals(Person(1.15)) is residuals(Person(1.15))
    np.testing.assert_array_equal(residuals(Person(1.15)).mean, residuals(ANYBODY).mean)


def test_the_search_begins_with_a_body_as_large_as_the_person(arm):
    assert overall_size(expected_body(arm, Person(1.2))) == pytest.approx(1.2 / MEN_M, abs=0.01)
    np.testing.assert_array_equal(expected_body(arm, Person(None, 80.0)).shape, make_body(arm).shape)


def test_a_height_makes_the_same_data_surer_and_the_gain_is_told(body):
    """Information that adds up: the deviation without the height is that of a fit that was never told it."""
    rng = np.random.default_rng(0)
    m, q, person = len(body.shape), 5, Person(1.75, 75.0, "male")
    seen = rng.normal(size=(4, m + q)) * 20.0
    data = seen.T @ seen + np.diag(np.r_[np.zeros(m), np.ones(q)])
    with_prior = [data + np.pad(prior(body, one).precision, (0, q)) for one in (person, ANYBODY)]
    told = lengths_told(body, OF_PEOPLE**2 * np.linalg.inv(with_prior[0]), person)
    untold = lengths_told(body, OF_PEOPLE**2 * np.linalg.inv(with_prior[1]), ANYBODY)
    assert len(told) == len(body.affine.groups) - 1
    for one, other in zip(told, untold, strict=True):
        assert one.sd_of_anybody_mm == pytest.approx(other.sd_mm, rel=1e-6)
        assert one.sd_mm <= one.sd_of_anybody_mm
    assert any(one.sd_mm < 0.9 * one.sd_of_anybody_mm for one in told)


def test_a_height_that_the_limb_contradicts_is_told(arm):
    body = make_body(arm)
    subject = Subject(body, np.zeros((1, len(arm.coordinates))), np.zeros(1), np.eye(16), {"person": {"height_m": 1.3}})
    assert any("1.30 m is stated" in doubt for doubt in doubts(subject))
    subject.report["person"]["height_m"] = 1.75
    assert not any("is stated" in doubt for doubt in doubts(subject))


@pytest.mark.parametrize(
    ("wrong", "words"),
    [({"height_m": 178.0}, "metres"), ({"mass_kg": 900.0}, "kilograms"), ({"sex": "man"}, "male or female")],
)
def test_what_nobody_can_be_is_refused_with_the_unit(wrong, words):
    with pytest.raises(FitError) as refused:
        Person(**wrong)
    assert words in str(refused.value)


def test_the_command_refuses_a_height_in_centimetres_before_any_work(tmp_path):
    asked = ["nowhere", "--anatomy", "upper-limb-right", "--out", str(tmp_path / "s.npz"), "--height", "178"]
    done = CliRunner().invoke(adapt_command, asked)
    assert isinstance(done.exception, BonetrackError)
    assert "metres" in str(done.exception)


@pytest.mark.parametrize(("height", "told"), [(1.15, True), (1.76, False)])
def test_a_height_beyond_the_survey_is_said_to_tell_the_size_alone(arm, tmp_path, capsys, height, told):
    body, person = make_body(arm), Person(height)
    lengths = [asdict(length) for length in lengths_told(body, OF_PEOPLE**2 * np.eye(len(body.shape)), person)]
    report = dict.fromkeys(("poses", "left_out", "landmarks_never_shown"), ())
    report |= {"scales": {}, "noise_mm": 1.0, "person": asdict(person), "lengths": lengths}
    report["settings"] = {"frames_used": {}}
    print_subject(Subject(body, np.zeros((1, 10)), np.zeros(1), np.eye(16), report), tmp_path / "s.npz")
    assert ("nobody of that height" in capsys.readouterr().out) == told


# ---- where the figures come from


@pytest.mark.skipif(not SUMMARY.is_file(), reason="the survey's summary is not here")
def test_the_figures_that_ship_are_the_surveys():
    with SUMMARY.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    table = json.loads(POPULATION.read_text(encoding="utf-8"))
    columns = {"upper arm": "acromionradialelength", "foot": "footlength", "wrist girth": "wristcircumference"}
    for sex in ("male", "female"):
        for measure, column in columns.items():
            row = next(row for row in rows if row["sex"] == sex and row["measure"] == column)
            k = table["measures"].index(measure)
            mean, sd = np.exp(table[sex]["mean"][k]), np.sqrt(table[sex]["covariance"][k][k])
            assert mean == pytest.approx(float(row["mean"]) / 1e3, rel=0.005)
            assert sd == pytest.approx(float(row["sd"]) / float(row["mean"]), rel=0.03)


def test_the_table_is_made_from_persons_by_a_command(tmp_path):
    rng = np.random.default_rng(1)
    values = {column: rng.integers(100, 200, 40) for of in COLUMNS.values() for column in of}
    values["trochanterionheight"] = rng.integers(800, 900, 40)
    people, out = tmp_path / "people.csv", tmp_path / "table.json"
    with people.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(values)
        writer.writerows(zip(*values.values(), strict=True))
    done = CliRunner().invoke(build, [str(people), str(people), "--out", str(out)])
    assert done.exit_code == 0, done.output
    table = json.loads(out.read_text(encoding="utf-8"))
    at = table["measures"].index
    assert table["male"]["persons"] == 40
    assert table["male"]["mean"][at("mass")] == pytest.approx(np.log(0.1 * values["weightkg"]).mean(), abs=1e-4)
    thigh = np.log(1e-3 * (values["trochanterionheight"] - values["tibialheight"]))
    assert table["male"]["mean"][at("thigh")] == pytest.approx(thigh.mean(), abs=1e-4)
    assert table["male"]["covariance"][at("thigh")][at("thigh")] == pytest.approx(thigh.var(ddof=1), abs=1e-6)
    people.write_text("stature\n1\n", encoding="utf-8")
    assert "is not a table of ANSUR II" in str(CliRunner().invoke(build, [str(people), str(people)]).exception)
