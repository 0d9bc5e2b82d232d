"""The forms that a first search tries come from the anatomy's joints alone, whatever their types."""

from __future__ import annotations

import numpy as np
import pytest

from adapt.anatomy import Anatomy
from adapt.anatomy_file import load_anatomy
from adapt.model.body import make_body, pose_skin
from adapt.model.pose_space import joint_coordinates
from adapt.search.first_pose import variations
from adapt.search.typical_poses import FORMS, straightest, typical_forms


@pytest.fixture(scope="module", params=["upper-limb-right", "lower-limb-left"])
def anatomy(request) -> Anatomy:
    return load_anatomy(request.param)


def test_every_joint_is_varied_within_its_range_and_the_root_is_not(anatomy):
    forms = np.array(typical_forms(anatomy))
    varied = joint_coordinates(anatomy)
    assert len(forms) == FORMS
    assert len(varied) == len(anatomy.coordinates) - 6
    for i, coordinate in enumerate(anatomy.coordinates):
        if i in varied:
            assert coordinate.low <= forms[:, i].min()
            assert forms[:, i].max() <= coordinate.high
            assert np.ptp(forms[:, i]) > 0.2 * (coordinate.high - coordinate.low), coordinate.name
        else:
            assert not forms[:, i].any()


def test_no_form_of_the_limb_is_far_from_all_of_them(anatomy):
    body, rng = make_body(anatomy), np.random.default_rng(1)
    some = rng.choice(len(anatomy.skin_vertices), 200, replace=False)
    tried = [pose_skin(body, theta, vertices=some) for theta in typical_forms(anatomy)]
    straight = pose_skin(body, straightest(anatomy), vertices=some)
    nearest, from_straight = [], []
    for _ in range(20):
        theta = straightest(anatomy)
        for i in joint_coordinates(anatomy):
            theta[i] = rng.uniform(anatomy.coordinates[i].low, anatomy.coordinates[i].high)
        skin = pose_skin(body, theta, vertices=some)
        nearest.append(min(apart(skin, other) for other in tried))
        from_straight.append(apart(skin, straight))
    assert np.mean(nearest) < 0.5 * np.mean(from_straight)


def apart(skin, other) -> float:
    """Root mean square distance (m) of two skins (N, 3), one laid rigidly on the other."""
    a, b = skin - skin.mean(axis=0), other - other.mean(axis=0)
    left, _, right = np.linalg.svd(a.T @ b)
    turn = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    return float(np.sqrt(((a @ turn - b) ** 2).sum(axis=1).mean()))


def test_a_pose_is_varied_in_every_joint_and_stays_in_range(anatomy):
    theta = straightest(anatomy)
    varied = variations(anatomy, theta)
    assert np.array_equal(varied[0], theta)
    assert len(varied) == 1 + 2 * len(joint_coordinates(anatomy))
    for other in varied[1:]:
        assert np.count_nonzero(other - theta) <= 1
        assert all(c.low <= x <= c.high for c, x in zip(anatomy.coordinates, other, strict=True))
