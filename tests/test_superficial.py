"""Bones lie as deep beneath the templates' skin as beneath people's, and the skin is moved to that and no farther."""

from dataclasses import replace

import numpy as np
import pytest

from adapt.anatomy_file import former_anatomies, load_anatomy
from adapt.template_builder.__main__ import PLANS
from adapt.template_builder.depth_checks import depth_checks
from adapt.template_builder.meshes import Mesh, level_set
from adapt.template_builder.skin_depth import at_depths
from adapt.template_builder.superficial import Spot, depth_at, filled_in
from capture.errors import AnatomyError


def ball(centre, radius, spacing=0.004):
    points = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    faces = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]])
    faces = np.concatenate([faces, [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]])
    seed = Mesh(1e-4 * points + np.asarray(centre), faces)
    return level_set([seed], spacing=spacing, grow=radius)


@pytest.fixture(scope="module")
def skin():
    return ball((0.0, 0.0, 0.0), 0.06)


@pytest.fixture(scope="module")
def bone():
    return ball((0.0, 0.0, 0.0), 0.04, spacing=0.003)


TOP = {"top": np.array([0.0, 0.04, 0.0]), "side": np.array([0.04, 0.0, 0.0])}


# ---- the templates


@pytest.mark.parametrize("name", PLANS)
def test_bones_lie_as_deep_as_in_people(name):
    failed = [c.line() for c in depth_checks(load_anatomy(name), PLANS[name]) if not c.passed]
    assert not failed, "\n".join(failed)


def test_the_template_as_it_was_fails_the_check_of_depths():
    arm, plan = next(former_anatomies("upper-limb-right")), PLANS["upper-limb-right"]
    failed = {c.name for c in depth_checks(arm, plan) if not c.passed}
    assert "ulna's border, 50 % beneath the skin, no more" in failed


@pytest.mark.parametrize("name", PLANS)
def test_every_depth_says_who_measured_it_or_that_it_is_assumed(name):
    for spot in PLANS[name].spots:
        assert 0.0 < spot.low < spot.high
        assert spot.source.startswith(("measured on", "ASSUMED")), spot.name


# ---- spots


def test_the_depth_of_a_spot_is_that_of_the_shallowest_vertex_there(skin, bone):
    spot = Spot("top", "bone", "top", 0.0, 1.0, "", along=0.01)
    assert depth_at(spot, skin, {"bone": bone}, TOP) == pytest.approx(0.02, abs=3e-4)


def test_a_spot_without_vertices_is_told(bone):
    spot = Spot("nowhere", "bone", "top", 0.0, 1.0, "", along=1e-6)
    with pytest.raises(AnatomyError, match="no vertices of the bone at 'nowhere'"):
        spot.vertices(bone.vertices, {"top": np.array([1.0, 0.0, 0.0])})


def test_between_two_spots_of_one_border_depths_go_from_one_to_the_other():
    first = Spot("a", "bone", "top", 0.002, 0.004, "", to="side", share=0.0)
    second = replace(first, name="b", low=0.006, high=0.010, share=1.0)
    dense = filled_in((first, second), TOP)
    assert len(dense) > 4
    assert all(spot.low == pytest.approx(0.002 + 0.004 * spot.share) for spot in dense)
    assert all(spot.high == pytest.approx(0.004 + 0.006 * spot.share) for spot in dense)


# ---- the skin


def test_skin_is_drawn_to_a_bone_that_lies_too_deep_and_stays_elsewhere(skin, bone):
    spot = Spot("top", "bone", "top", 0.011, 0.013, "", along=0.006)
    held = np.zeros(len(skin.vertices), dtype=bool)
    moved, field = at_depths(skin, held, {"bone": bone}, TOP, (spot,), {"bone": 0.002})
    assert 0.011 < depth_at(spot, moved, {"bone": bone}, TOP) < 0.013
    below = skin.vertices[:, 1] < 0.0
    assert np.abs(field[below]).max() < 2e-4
    assert moved.is_closed()


def test_skin_gives_way_to_a_bone_that_comes_too_near(skin):
    bone = ball((0.0, 0.015, 0.0), 0.044, spacing=0.003)
    held = np.zeros(len(skin.vertices), dtype=bool)
    moved, field = at_depths(skin, held, {"bone": bone}, TOP, (), {"bone": 0.004})
    assert skin.depth(bone.vertices).min() < 0.002
    assert moved.depth(bone.vertices).min() > 0.0037
    assert field.min() > -1e-4


def test_what_is_held_does_not_move(skin, bone):
    spot = Spot("top", "bone", "top", 0.011, 0.013, "", along=0.006)
    held = skin.vertices[:, 1] < 0.045
    moved, _ = at_depths(skin, held, {"bone": bone}, TOP, (spot,), {})
    assert np.array_equal(moved.vertices[held], skin.vertices[held])
