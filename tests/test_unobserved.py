"""What nothing in sight tells goes back to rest, and does not take what is in sight along."""

from __future__ import annotations

import numpy as np
import pytest

from adapt.anatomy import Anatomy
from adapt.anatomy_file import load_anatomy
from adapt.fit.unobserved import towards_rest, unobserved_coordinates
from adapt.model.body import bone_transforms, make_body, rest_theta

SHANK_AND_FOOT = ("tibia", "foot")


@pytest.fixture(scope="module")
def leg() -> Anatomy:
    return load_anatomy("lower-limb-left")


def shown_only(anatomy: Anatomy, *names: str) -> np.ndarray:
    return np.array([bone.name in names for bone in anatomy.bones])


def stepping(leg: Anatomy) -> np.ndarray:
    """A pose with the knee bent, the pelvis turned and moved."""
    theta = rest_theta(make_body(leg))
    theta[:6] += [0.3, -0.5, 0.2, 0.4, 0.1, 1.2]
    theta[leg.coordinate_index("knee_angle_l")] = np.deg2rad(60.0)
    theta[leg.coordinate_index("hip_flexion_l")] = np.deg2rad(40.0)
    theta[leg.coordinate_index("ankle_angle_l")] = np.deg2rad(-20.0)
    return theta


@pytest.mark.parametrize(
    ("shown", "told"),
    [
        (SHANK_AND_FOOT, {"ankle_angle_l"}),
        (("pelvis", "femur"), {"hip_flexion_l", "hip_adduction_l", "hip_rotation_l"}),
        (("pelvis", "foot"), {"hip_flexion_l", "hip_adduction_l", "hip_rotation_l", "knee_angle_l", "ankle_angle_l"}),
    ],
)
def test_a_joint_is_told_of_where_bones_show_on_both_its_sides(leg, shown, told):
    free = set(leg.joints[0].coordinates)
    nothing_tells = unobserved_coordinates(leg, shown_only(leg, *shown))
    assert {c.name for c, u in zip(leg.coordinates, nothing_tells, strict=True) if not u} - free == told


def test_bones_in_sight_stay_where_they_were_predicted_and_hidden_joints_go_towards_rest(leg):
    body, predicted = make_body(leg), stepping(leg)
    guess = towards_rest(body, predicted, predicted, shown_only(leg, *SHANK_AND_FOOT), 0.6)
    before, after = bone_transforms(body, predicted), bone_transforms(body, guess)
    for name in SHANK_AND_FOOT:
        np.testing.assert_allclose(after[name], before[name], atol=1e-9)
    assert np.linalg.norm(after["pelvis"][:3, 3] - before["pelvis"][:3, 3]) > 0.05
    knee, ankle = leg.coordinate_index("knee_angle_l"), leg.coordinate_index("ankle_angle_l")
    assert np.deg2rad(30.0) < guess[knee] < np.deg2rad(45.0)  # 60 degrees, six tenths of the way from rest
    assert guess[ankle] == predicted[ankle]


def test_a_limb_that_shows_as_a_whole_is_predicted_as_before(leg):
    body, predicted = make_body(leg), stepping(leg)
    assert towards_rest(body, predicted, predicted, np.ones(len(leg.bones), dtype=bool), 0.9) is predicted


def test_a_hidden_knee_does_not_bend_on_for_ever(leg):
    body, theta, knee = make_body(leg), stepping(leg), leg.coordinate_index("knee_angle_l")
    for _ in range(90):
        drifting = theta.copy()
        drifting[knee] += np.deg2rad(1.0)
        theta = towards_rest(body, drifting, theta, shown_only(leg, *SHANK_AND_FOOT), 0.97)
    assert theta[knee] < np.deg2rad(10.0)
