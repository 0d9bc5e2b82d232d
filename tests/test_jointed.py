"""A person moved by their own bones: a limb that is not our model's."""

from __future__ import annotations

import numpy as np
import pytest

from adapt.template_builder.meshes import Mesh
from capture.rigid import apply, exp_so3, transform
from track.evaluation.jointed import Jointed, Turn, heat_weights, shared_along
from track.evaluation.swing import Swing, times_and_phase


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
