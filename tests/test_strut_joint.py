"""The strut: a bar that points at another bone, does not stretch, and by that holds the other bone in fits."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from adapt.anatomy import Anatomy, Floats, Joint
from adapt.anatomy_check import refuse_unsound
from adapt.anatomy_file import anatomy_description
from adapt.fit.least_squares import levenberg_marquardt
from adapt.fit.priors import held_term
from adapt.fit.problem import Arrow, Quadratic, Unknowns, gaussian_term
from adapt.mirror import mirrored_body
from adapt.model.body import Body, bone_transforms, make_body, rest_theta
from adapt.model.joints import JOINT_TYPES
from adapt.model.joints.strut import HELD_M
from adapt.model.parts import refuse_wrong_parts
from adapt.model.shape.handle_space import affine_set
from adapt.search.pose_score import FoundPart
from capture.errors import AnatomyError
from capture.rigid import apply
from tests.finite_differences import check_jacobian
from tests.test_joint_types import example, thetas_of
from tests.toy_leg import with_joint
from track.export.osim_joints import follower_columns
from track.observed_bones import bones_shown, coordinates_seen


@pytest.fixture(scope="module")
def limb() -> tuple[Body, Joint]:
    anatomy, joint = example("strut")
    return make_body(anatomy), joint


def ends(body: Body, joint: Joint, theta: Floats) -> tuple[Floats, Floats, Floats]:
    """Where the parent has the first end (3,), the other bone the second one, and the bar its own second one."""
    anatomy, moved = body.anatomy, bone_transforms(body, theta)
    first, second = (body.p.value[anatomy.landmark_index(name)] for name in joint.axes[0])
    carriers = (joint.parent, joint.other, joint.child)
    points = (first, second, second)
    return tuple(apply(moved[str(c)], x[None])[0] for c, x in zip(carriers, points, strict=True))  # type: ignore[return-value]


def off_length(body: Body, joint: Joint, theta: Floats) -> float:
    """By how much (m) the ends are further apart than the bar is long."""
    first, second, own = ends(body, joint, theta)
    return float(np.linalg.norm(second - first) - np.linalg.norm(own - first))


def test_the_bar_stays_at_its_parent_keeps_its_length_and_points_at_the_other_bone(limb: tuple[Body, Joint]) -> None:
    for body in (limb[0], mirrored_body(limb[0])):
        joint = body.anatomy.joint(limb[1].name)
        first_at_rest = body.p.value[body.anatomy.landmark_index(joint.axes[0][0])]
        for theta in thetas_of(body, joint):
            first, second, own = ends(body, joint, theta)
            by_bar = apply(bone_transforms(body, theta)[joint.child], first_at_rest[None])[0]
            np.testing.assert_allclose(by_bar, first, atol=1e-12)
            along = (second - first) / np.linalg.norm(second - first)
            np.testing.assert_allclose((own - first) / np.linalg.norm(own - first), along, atol=1e-12)
        assert abs(off_length(body, joint, rest_theta(body))) < 1e-12


def test_what_it_holds_is_the_distance_of_its_ends_and_varies_as_stated(limb: tuple[Body, Joint]) -> None:
    body, joint = limb
    n, m = len(body.anatomy.coordinates), len(body.shape)
    theta = thetas_of(body, joint)[1]
    assert held_term(body, theta).energy == pytest.approx(0.5 * (off_length(body, joint, theta) / HELD_M) ** 2)
    shape = affine_set(body.anatomy).identity + np.random.default_rng(3).normal(0.0, 0.01, m)

    def energy(x: Floats) -> Floats:
        return np.array(held_term(make_body(body.anatomy, shape=x[n:]), x[:n]).energy)

    whole = held_term(make_body(body.anatomy, shape=shape), theta, with_shape=True)
    check_jacobian(energy, whole.gradient, np.r_[theta, shape])
    np.testing.assert_allclose(np.outer(whole.gradient, whole.gradient), 2.0 * whole.energy * whole.hessian, atol=1e-6)


def test_a_term_over_a_pose_and_the_shape_lands_in_both() -> None:
    of = Unknowns(m=2, q=1, n=3)
    arrow, slope = Arrow(of, 2, np.zeros((1, 1))), np.arange(1.0, 6.0)  # of the pose, then of the shape
    arrow.add_across(1, Quadratic(0.5, slope, np.outer(slope, slope)))
    expected = np.array([4.0, 5.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0])
    np.testing.assert_allclose(arrow.quadratic().gradient, expected)
    np.testing.assert_allclose(arrow.quadratic().hessian, np.outer(expected, expected))


def test_a_fit_keeps_the_bar_within_two_millimetres_where_data_would_stretch_it(limb: tuple[Body, Joint]) -> None:
    body, joint = limb
    start = rest_theta(body)
    wanted = start.copy()
    wanted[body.anatomy.coordinate_index("bend")] += 0.5
    precision = np.eye(len(start)) / np.deg2rad(2.0) ** 2

    def quadratic(theta: Floats) -> Quadratic:
        return gaussian_term(theta, wanted, precision) + held_term(body, theta)

    theta = levenberg_marquardt(quadratic, start, steps=20)
    assert abs(off_length(body, joint, wanted)) > 0.01
    assert abs(off_length(body, joint, theta)) < 0.002


def test_its_turns_are_told_from_the_bones_alone_and_not_known_where_they_are_not(limb: tuple[Body, Joint]) -> None:
    body, joint = limb
    thetas = np.vstack([rest_theta(body), thetas_of(body, joint)])
    placed = [bone_transforms(body, theta) for theta in thetas]
    transforms = {bone.name: np.array([each[bone.name] for each in placed]) for bone in body.anatomy.bones}
    known = follower_columns(body, transforms)
    assert list(known) == list(JOINT_TYPES[joint.type].opensim_owners(joint))
    transforms["shank"][2] = np.nan
    for name, column in follower_columns(body, transforms).items():
        assert np.isnan(column[2])
        np.testing.assert_allclose(np.delete(column, 2), np.delete(known[name], 2))


@pytest.mark.parametrize(
    ("changed", "message"),
    [({"other": None}, "an other bone"), ({"frames": ()}, "one frame"), ({"axes": (("back", "low"),)}, "first end")],
)
def test_a_strut_without_its_parts_is_refused(
    limb: tuple[Body, Joint], changed: dict[str, object], message: str
) -> None:
    with pytest.raises(AnatomyError, match=message):
        refuse_wrong_parts(with_joint(limb[0].anatomy, limb[1], **changed))


def test_a_joint_that_reaches_nowhere_has_no_other_bone_in_its_file(limb: tuple[Body, Joint]) -> None:
    anatomy: Anatomy = limb[0].anatomy
    told = {joint["name"]: joint for joint in anatomy_description(anatomy)["joints"]}
    assert told[limb[1].name]["other"] == "shank"
    assert all("other" not in parts for name, parts in told.items() if name != limb[1].name)
    with pytest.raises(AnatomyError, match="no other bone"):
        refuse_wrong_parts(with_joint(anatomy, anatomy.joint("knee"), other="kneecap"))


def test_an_other_bone_that_is_placed_later_is_refused_in_a_file(limb: tuple[Body, Joint]) -> None:
    anatomy, joint = limb[0].anatomy, limb[1]
    early = (anatomy.joints[0], joint, *anatomy.joints[1:-1])
    with pytest.raises(AnatomyError, match="stands before one that carries its other bone 'shank'"):
        refuse_unsound(replace(anatomy, joints=early), where=Path("leg.npz"))


def test_a_bar_without_skin_shows_where_both_bones_do_and_shows_what_moves_the_other(limb: tuple[Body, Joint]) -> None:
    anatomy, names = limb[0].anatomy, [bone.name for bone in limb[0].anatomy.bones]
    found, hidden = FoundPart(0.4, 0.002, 1.0), FoundPart(0.0, 0.05, 0.0)
    for thigh, shank in ((found, found), (found, hidden), (hidden, found)):
        shown = bones_shown(anatomy, {"thigh": thigh, "shank": shank})
        assert shown[names.index("foot")] == (thigh is found and shank is found)
    seen = coordinates_seen(anatomy, np.array([name == "foot" for name in names]))
    assert seen[anatomy.coordinate_index("bend")]
