"""Soft tissue: thin over the bony landmarks, deep on muscle, and what strays from the template strays by that."""

from __future__ import annotations

import numpy as np
import pytest

from adapt.anatomy import Anatomy
from adapt.anatomy_file import load_anatomy
from adapt.match.skin_sample import sample_skin, weighted_by_tissue
from adapt.tissue import DEEP_M, RANGE_M, SHARE, tissue_depth, tissue_deviation, tissue_field
from track.evaluation.random_bodies import soft_tissue
from track.evaluation.tissue_share import GIRTHS, Population, read_population, ring, varies_around

BONY = ("EM", "EL", "olecranon", "US", "RS")  # humeral epicondyles, elbow's tip, styloids
NEAR_M = 0.010


def near_landmark(arm: Anatomy, name: str):
    """Vertices (V,) of the skin about a landmark: within 1 cm of the one nearest to it."""
    landmark = arm.landmarks[arm.landmark_names.index(name)]
    nearest = arm.skin_vertices[np.linalg.norm(arm.skin_vertices - landmark, axis=1).argmin()]
    return np.linalg.norm(arm.skin_vertices - nearest, axis=1) < NEAR_M


def muscle_of_the_upper_arm(arm: Anatomy):
    """Vertices (V,) around the middle half of the humerus."""
    shoulder, medial, lateral = (arm.landmarks[arm.landmark_names.index(name)] for name in ("GH", "EM", "EL"))
    axis = 0.5 * (medial + lateral) - shoulder
    along = (arm.skin_vertices - shoulder) @ axis / (axis @ axis)
    off = np.linalg.norm(arm.skin_vertices - shoulder - along[:, None] * axis, axis=1)
    return (along > 0.25) & (along < 0.75) & (off < 0.08)


@pytest.mark.parametrize("name", BONY)
def test_tissue_is_thin_over_bony_landmarks(arm, name):
    depth = tissue_depth(arm)[near_landmark(arm, name)]
    assert len(depth) > 2
    assert depth.min() < 0.006
    assert np.median(depth) < 0.011


def test_tissue_is_deeper_on_the_upper_arms_muscle(arm):
    depth, muscle = tissue_depth(arm), muscle_of_the_upper_arm(arm)
    thinnest = max(np.median(depth[near_landmark(arm, name)]) for name in BONY)
    assert muscle.sum() > 200
    assert np.median(depth[muscle]) > 2.0 * thinnest
    assert np.quantile(depth[muscle], 0.05) > thinnest


def test_tissue_depth_is_the_distance_to_the_nearest_bone(arm):
    some = np.random.default_rng(0).choice(len(arm.skin_vertices), 20, replace=False)
    bones = np.concatenate([bone.vertices for bone in arm.bones])
    apart = np.linalg.norm(arm.skin_vertices[some, None] - bones, axis=2).min(axis=1)
    np.testing.assert_allclose(tissue_depth(arm)[some], apart)


def test_skin_strays_by_a_share_of_the_depth_that_stops_growing(arm):
    depth, deviation = tissue_depth(arm), tissue_deviation(arm)
    shallow = depth < DEEP_M
    assert 0.1 < shallow.mean() < 0.9
    np.testing.assert_allclose(deviation[shallow], SHARE * depth[shallow])
    np.testing.assert_allclose(deviation[~shallow], SHARE * DEEP_M)


def test_the_share_is_that_by_which_girths_vary_between_people(arm):
    """Deviation / 2 pi (mm) of girths between women, and men, alike in all that handles say (ANSUR II)."""
    people = {
        "bicepscircumferenceflexed": (2.5, 2.6),
        "forearmcircumferenceflexed": (1.3, 1.4),
        "wristcircumference": (0.7, 0.9),
        "thighcircumference": (4.7, 4.4),
        "lowerthighcircumference": (2.4, 2.1),
        "calfcircumference": (2.0, 2.2),
        "anklecircumference": (1.4, 1.2),
    }
    limbs = {"upper-limb-right": arm, "lower-limb-right": load_anatomy("lower-limb-right")}
    of_all = {g.measure: 1e3 * varies_around(limbs[g.anatomy], ring(limbs[g.anatomy], g.place)) for g in GIRTHS}
    shares = np.array([np.mean(varies) / of_all[measure] for measure, varies in people.items()])
    assert np.exp(np.log(shares).mean()) == pytest.approx(SHARE, rel=0.15)
    assert shares.min() > 0.5 * SHARE
    assert shares.max() < 2.0 * SHARE


def test_made_up_soft_tissue_has_the_deviation_that_the_depth_allows(arm):
    drawn = np.array([soft_tissue(arm, np.random.default_rng(seed)) for seed in range(20)])
    size = np.linalg.norm(drawn, axis=2) / tissue_deviation(arm)
    assert np.sqrt((size**2).mean()) == pytest.approx(1.0, abs=0.15)
    shallow = tissue_depth(arm) < 0.5 * DEEP_M
    deep = tissue_depth(arm) > DEEP_M
    moved = np.sqrt((drawn**2).sum(axis=2).mean(axis=0))
    assert moved[deep].mean() > 2.0 * moved[shallow].mean()
    assert np.sqrt((size[:, shallow] ** 2).mean()) == pytest.approx(1.0, abs=0.25)


def test_made_up_soft_tissue_lies_along_the_normals_and_repeats(arm):
    one, same, other = (soft_tissue(arm, np.random.default_rng(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert np.abs(one - other).max() > 0.001
    normals = sample_skin(arm).normals(arm.skin_vertices)
    np.testing.assert_allclose(np.cross(one, normals), 0.0, atol=1e-9)


def test_the_field_has_the_deviation_that_the_depth_allows(arm):
    """Where the surface goes on all around; at its rims and tips the field varies more."""
    field, inner = tissue_field(arm), arm.fit_weight > 0.9
    deviation = np.sqrt((field.modes**2).sum(axis=1) + field.remainder**2)
    ratio = deviation[inner] / np.maximum(tissue_deviation(arm)[inner], 1e-6)
    assert np.median(ratio) == pytest.approx(1.0, abs=0.05)
    assert np.quantile(ratio, 0.05) > 0.9
    assert (field.remainder <= tissue_deviation(arm) + 1e-6).all()


def test_neighbouring_skin_moves_alike_and_far_skin_does_not(arm):
    field = tissue_field(arm)
    unit = field.modes / np.linalg.norm(field.modes, axis=1, keepdims=True)
    here = int(np.flatnonzero(muscle_of_the_upper_arm(arm))[0])
    apart = np.linalg.norm(arm.skin_vertices - arm.skin_vertices[here], axis=1)
    alike = unit @ unit[here]
    assert alike[apart < 0.01].min() > 0.9
    assert np.abs(alike[apart > 2.0 * RANGE_M]).max() < 0.15


def test_coefficients_and_displacement_are_each_others_inverse(arm):
    field = tissue_field(arm)
    c = np.random.default_rng(3).normal(size=field.modes.shape[1])
    np.testing.assert_allclose(field.coefficients(field.displacement(c)), c, atol=1e-8)


def test_the_modes_express_nearly_all_of_made_up_soft_tissue(arm):
    field, drawn = tissue_field(arm), soft_tissue(arm, np.random.default_rng(4))
    left = drawn - field.displacement(field.coefficients(drawn))
    counted = arm.fit_weight > 0.5
    assert np.linalg.norm(left[counted], axis=1).mean() < 0.05 * np.linalg.norm(drawn[counted], axis=1).mean()


def test_vertices_count_less_by_what_the_modes_leave_out(arm):
    sample = sample_skin(arm)
    bony = weighted_by_tissue(sample, arm)
    np.testing.assert_array_equal(bony.vertices, sample.vertices)
    share = bony.observations[sample.vertices] / sample.observations[sample.vertices]
    assert ((share > 0.0) & (share <= 1.0)).all()
    order = np.argsort(tissue_field(arm).remainder[sample.vertices])
    assert (np.diff(share[order]) <= 1e-12).all()
    assert share.min() < 0.85 < share.max()


def test_people_alike_in_something_differ_less_the_more_it_tells(tmp_path):
    (tmp_path / "ansur2_limb_summary.csv").write_text(
        "# survey\nsex,measure,n,mean,sd\nmale,length,9,300,10\nmale,girth,9,200,20\nfemale,girth,9,180,5\n"
    )
    (tmp_path / "ansur2_limb_correlation_male.csv").write_text(
        "# survey\nmeasure,length,girth\nlength,1.0,0.6\ngirth,0.6,1.0\n"
    )
    men = read_population(tmp_path, "male")
    assert isinstance(men, Population)
    assert men.given("girth", []) == 20.0
    assert men.given("girth", ["length"]) == pytest.approx(16.0)
