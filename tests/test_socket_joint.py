"""The socket: no pose locks it, and what is told of it as angles is what OpenSim and the ISB mean."""

from __future__ import annotations

import numpy as np
import pytest

from adapt.anatomy import Anatomy, Floats, Joint
from adapt.model.derivatives import constant_points
from adapt.model.joints import joint_motion
from adapt.model.joints.euler import continuous_angles, euler_angles
from adapt.model.pose_space import advance, joint_index, pose_difference, reported_coordinates, wrap
from capture.rigid import exp_so3, log_so3
from tests.test_joint_types import example
from track.angles import thoraco_humeral

ABDUCTION = np.linspace(0.0, 149.0, 31)  # degrees about Y of X-Y-Z, which locks at 90


@pytest.fixture(scope="module")
def toy() -> tuple[Anatomy, Joint]:
    return example("socket")


def posed(toy: tuple[Anatomy, Joint], vectors: Floats) -> Floats:
    """Poses (T, n) whose socket has those rotation vectors (T, 3)."""
    anatomy, joint = toy
    thetas = np.zeros((len(vectors), len(anatomy.coordinates)))
    thetas[:, joint_index(anatomy, joint)] = vectors
    return thetas


def test_no_pose_up_to_three_quarters_of_a_turn_locks_it(toy: tuple[Anatomy, Joint]) -> None:
    anatomy, joint = toy
    index, rng = joint_index(anatomy, joint), np.random.default_rng(3)
    p = constant_points(anatomy.landmarks, len(anatomy.coordinates))
    for angle in (0.0, np.pi / 2.0, 0.99 * np.pi, 1.5 * np.pi):
        for vector in (np.array([0.0, 1.0, 0.0]), rng.normal(size=3)):
            (theta,) = posed(toy, angle * vector[None] / np.linalg.norm(vector))
            by_q = joint_motion(anatomy, joint, theta, p, 0).d_rotation[:, index]
            assert np.linalg.svd(by_q, compute_uv=False).min() > 0.25


@pytest.mark.parametrize("beside", [0.0, 20.0])  # degrees by which the motion misses the lock
def test_reported_angles_are_the_same_rotation_and_do_not_jump_at_the_lock(
    toy: tuple[Anatomy, Joint], beside: float
) -> None:
    anatomy, joint = toy
    turns = exp_so3(np.outer(np.deg2rad(ABDUCTION), [0.0, 1.0, 0.0])) @ exp_so3(np.deg2rad([beside, 0.0, beside]))
    columns = reported_coordinates(anatomy, posed(toy, log_so3(turns)))
    angles = np.column_stack([columns[f"{joint.name}_euler_{axis}"] for axis in "xyz"])
    assert np.abs(np.diff(angles, axis=0)).max() < 25.0
    x, y, z = (exp_so3(np.deg2rad(angles[:, k, None]) * np.eye(3)[k]) for k in range(3))
    np.testing.assert_allclose(x @ y @ z, turns, atol=1e-9)


def test_frames_that_are_not_known_are_passed_over(toy: tuple[Anatomy, Joint]) -> None:
    anatomy, joint = toy
    thetas = posed(toy, np.outer(np.deg2rad(ABDUCTION), [0.0, 1.0, 0.0]))
    thetas[18:20] = np.nan
    y = reported_coordinates(anatomy, thetas)[f"{joint.name}_euler_y"]
    assert np.isnan(y[18:20]).all()
    np.testing.assert_allclose(np.delete(y, [18, 19]), np.delete(ABDUCTION, [18, 19]), atol=1e-6)


def test_continuous_angles_are_opensims_where_these_do_not_jump() -> None:
    vectors = np.random.default_rng(4).uniform(-0.6, 0.6, (40, 3))
    np.testing.assert_allclose(continuous_angles(vectors), euler_angles(vectors), atol=1e-12)


def test_isb_angles_are_those_of_an_arm_in_a_thorax_frame(toy: tuple[Anatomy, Joint]) -> None:
    anatomy, joint = toy
    vectors = np.random.default_rng(5).normal(0.0, 1.0, (50, 3))
    told = reported_coordinates(anatomy, posed(toy, vectors))
    expected = thoraco_humeral(np.eye(4), vectors, [0, 1, 2], side="right")
    for name in ("plane_of_elevation", "elevation", "axial_rotation"):
        np.testing.assert_allclose(told[f"{joint.name}_{name}"], expected[f"thoracohumeral_{name}"], atol=1e-9)


def test_poses_differ_and_advance_by_turns_and_stay_within_half_a_turn(toy: tuple[Anatomy, Joint]) -> None:
    anatomy, joint = toy
    index = joint_index(anatomy, joint)
    earlier, later = posed(toy, np.deg2rad([[0.0, 170.0, 0.0], [0.0, -170.0, 0.0]]))
    apart = pose_difference(anatomy, later, earlier)
    np.testing.assert_allclose(np.rad2deg(apart[index]), [0.0, 20.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(advance(anatomy, earlier, apart), later, atol=1e-12)
    (far,) = posed(toy, np.deg2rad([[0.0, 190.0, 0.0]]))
    np.testing.assert_allclose(wrap(anatomy, far), later, atol=1e-12)
