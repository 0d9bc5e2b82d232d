"""What is known of a body with both sides before it is seen: its sides are alike, and its trunk has proportions."""

from __future__ import annotations

import numpy as np
import pytest

from adapt.anatomy import Floats
from adapt.fit.plausible_sizes import bone_lengths
from adapt.model.body import Body, make_body
from adapt.model.shape.prior import ALIKE_SIGMA, LENGTH_SIGMA, SIZE_SIGMA, bones_between_groups, shape_prior
from adapt.model.size import resized
from tests.toy_trunk import toy_trunk


@pytest.fixture(scope="module")
def trunk() -> Body:
    return make_body(toy_trunk())


def cost(body: Body, shape: Floats) -> float:
    """Standard deviations squared of a shape from the template's."""
    away = shape - body.affine.identity
    return float(away @ shape_prior(body.anatomy, body.affine).precision @ away)


def longer_forearms(body: Body, right: float, left: float) -> Floats:
    """The shape with forearms longer by these shares."""
    shifts = np.zeros((len(body.affine.groups), 3))
    for side, share in (("r", right), ("l", left)):
        elbow, hand = (body.affine.groups.index(f"{name}_{side}") for name in ("elbow", "hand"))
        shifts[hand] = share * (body.affine.centres[hand] - body.affine.centres[elbow])
    return body.affine.shape(np.ones(len(shifts)), shifts)


def test_all_pairs_of_a_bones_heads_are_told(trunk: Body) -> None:
    pairs = bones_between_groups(trunk.anatomy, trunk.affine)
    names = trunk.affine.groups
    chest = {frozenset((names[a], names[b])) for (a, b), bone in pairs.items() if bone == "chest"}
    assert len(chest) == 6  # waist, neck, and a collar bone's end on either side
    assert frozenset(("sternum_r", "sternum_l")) in chest
    assert {bone.bone for bone in bone_lengths(trunk)} >= {"pelvis", "chest", "collar_r", "arm_l", "fore_l"}


def test_another_size_costs_what_sizes_cost(trunk: Body) -> None:
    assert cost(trunk, resized(trunk, 1.0 + SIZE_SIGMA).shape) == pytest.approx(1.0, abs=0.05)


def test_arms_of_different_lengths_cost_more_than_long_arms(trunk: Body) -> None:
    share = 0.03
    both, one = (cost(trunk, longer_forearms(trunk, share, left)) for left in (share, -share))
    assert both == pytest.approx(2.0 * (share / LENGTH_SIGMA) ** 2, rel=0.1)
    assert one - both == pytest.approx((2.0 * share / ALIKE_SIGMA) ** 2, rel=0.1)


def test_a_broad_chest_is_nothing_strange(trunk: Body) -> None:
    """Ten per cent broader at the same height: some deviations of single measures, and no impossibility."""
    shifts = np.zeros((len(trunk.affine.groups), 3))
    beyond = {"r": 0.1 * trunk.affine.centres[trunk.affine.groups.index("sternum_r")][2]}
    for k, name in enumerate(trunk.affine.groups):
        if name[-2:] in ("_r", "_l"):
            sign = 1.0 if name.endswith("_r") else -1.0
            shifts[k, 2] = sign * (beyond["r"] if name.startswith("sternum") else 0.1 * 0.17)
    assert cost(trunk, trunk.affine.shape(np.ones(len(shifts)), shifts)) < 25.0


def test_the_sides_of_a_limb_are_not_asked_about(arm) -> None:  # type: ignore[no-untyped-def]
    body = make_body(arm)
    assert cost(body, resized(body, 1.0 + SIZE_SIGMA).shape) == pytest.approx(1.0, abs=0.05)
