"""Every registered type of deformer: derivatives, compiled twin, shares, mirror image, file, export.

A new type is tested by being in the registry, with an example of its parts in ``EXAMPLES``.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from adapt.anatomy import Anatomy, Coordinate, Deformer, Frame, Joint
from adapt.anatomy_file import load_anatomy, read_anatomy, save_anatomy
from adapt.mirror import mirrored, mirrored_body
from adapt.model.body import Body, make_body, pose_skin, pose_skin_varying, rest_theta
from adapt.model.deformers import DEFORMER_TYPES, bind, bone_shares, carry
from adapt.model.derivatives import Points, constant_points, still_points
from adapt.model.joints import JOINT_TYPES
from adapt.model.kinematics import bone_motions
from adapt.model.pose_space import joint_index
from capture.errors import AnatomyError
from tests.finite_differences import check_jacobian
from tests.test_model import seeded
from tests.toy_anatomy import toy_anatomy
from track.evaluation.skin_of_blocks import skin_of_blocks, skin_of_blocks_by_shape
from track.export.linear_skin import linear_skin, skin_gap

ULNA = Frame(("inner", "outer"), ("styloid",), ("inner", "outer"), ("inner",), ("outer",))
WRIST = Frame(("styloid", "styloid2"), ("styloid",), ("head",), ("styloid",), ("styloid2",))
START = Frame(("top", "inner", "outer"), ("top",), ("inner", "outer"), ("inner",), ("outer",))
END = Frame(("inner", "outer", "styloid"), ("inner", "outer"), ("styloid",), ("inner",), ("outer",))
BENT = Frame(("inner", "outer"), ("top",), ("styloid",), ("inner",), ("outer",))
EXAMPLES = {
    "rigid": (("fore",), ()),
    "forearm": (("fore", "spin"), (ULNA, WRIST)),
    "bend": (("upper", "fore"), (START, END, BENT)),
    "halfway": (("upper", "fore"), (BENT, ULNA)),
    "curve": (("upper", "fore"), (START, END)),
}
ARCHED = Frame(("inner", "outer"), ("inner", "outer"), ("styloid",), ("inner",), ("outer",))
ABOUT_ELBOW = np.array([[0.03, -0.31, 0.01], [0.06, -0.33, 0.03], [0.1, -0.36, 0.02], [-0.02, -0.29, 0.0]])


def arched_elbow(toy: Anatomy) -> Anatomy:
    """The toy arm whose forearm stands at the end of an arc that is bent and twisted at rest, too."""
    elbow = Joint("elbow", "curve", "upper", "fore", ("bend", "lean", "turn"), (), ("inner", "outer"), (), (ARCHED,))
    more = Coordinate("lean", "rad", -1.1, 0.9, -0.4), Coordinate("turn", "rad", -1.0, 1.0, 0.3)
    joints = tuple(elbow if joint.name == "elbow" else joint for joint in toy.joints)
    return replace(toy, joints=joints, coordinates=(*toy.coordinates, *more))


@pytest.fixture(scope="module", params=DEFORMER_TYPES)
def case(request: pytest.FixtureRequest) -> tuple[Body, Deformer]:
    """The toy arm, of other proportions than at rest, with a deformer of the type in the place of its second."""
    bones, frames = EXAMPLES[request.param]
    deformer, toy = Deformer("tested", request.param, bones, frames), arched_elbow(toy_anatomy())
    anatomy = replace(toy, deformers=(toy.deformers[0], deformer, toy.deformers[2]))
    body = make_body(anatomy)
    scales = np.linspace(0.9, 1.1, len(body.affine.groups))
    return make_body(anatomy, shape=body.affine.shape(scales, np.zeros((len(scales), 3)))), deformer


def some_theta(body: Body) -> np.ndarray:
    return np.random.default_rng(4).uniform(-0.6, 0.6, len(body.anatomy.coordinates)) + rest_theta(body)


def test_it_varies_as_stated_with_theta_landmarks_and_skin(case: tuple[Body, Deformer]) -> None:
    (body, deformer), m = case, case[0].anatomy.landmarks.size
    anatomy, theta = body.anatomy, some_theta(body)
    n = len(theta)

    def skin(q: np.ndarray) -> Points:
        p = seeded(q[n : n + m].reshape(-1, 3), spare=n)
        p = Points(p.value, np.concatenate([p.d, np.zeros((*p.value.shape, ABOUT_ELBOW.size))], axis=2))
        own = np.concatenate([np.zeros((ABOUT_ELBOW.size, n + m)), np.eye(ABOUT_ELBOW.size)], axis=1)
        points = Points(q[n + m :].reshape(-1, 3), own.reshape(*ABOUT_ELBOW.shape, -1))
        return carry(deformer, bind(anatomy, deformer, p, points), bone_motions(anatomy, q[:n], p))

    at = np.concatenate([theta, anatomy.landmarks.ravel(), ABOUT_ELBOW.ravel()])
    check_jacobian(lambda q: skin(q).value, skin(at).d, at)


def test_points_that_do_not_vary_are_carried_as_if_their_derivatives_were_zero(case: tuple[Body, Deformer]) -> None:
    body, deformer = case
    anatomy, theta = body.anatomy, some_theta(body)
    motions = bone_motions(anatomy, theta, constant_points(body.p.value, len(theta)))
    pairs = ((len(theta), constant_points(ABOUT_ELBOW, len(theta))), (1, still_points(ABOUT_ELBOW)))
    full, shared = (
        carry(deformer, bind(anatomy, deformer, constant_points(body.p.value, n), skin), motions) for n, skin in pairs
    )
    np.testing.assert_array_equal(shared.value, full.value)
    np.testing.assert_allclose(shared.d, full.d, atol=1e-12)


def test_at_rest_it_leaves_the_skin_where_it_is(case: tuple[Body, Deformer]) -> None:
    body, _ = case
    np.testing.assert_allclose(pose_skin(body, rest_theta(body)), body.v_tilde.value, atol=1e-12)


def test_the_compiled_loops_pose_the_skin_as_the_model_does(case: tuple[Body, Deformer]) -> None:
    body, _ = case
    theta, everything = some_theta(body), np.arange(len(body.v_hat))
    model, with_shape = (
        skin_of_blocks(body, theta, columns=len(theta)),
        skin_of_blocks_by_shape(body, theta, everything),
    )
    for expected, fast in (
        (model, pose_skin_varying(body, theta)),
        (with_shape, pose_skin_varying(body, theta, with_shape=True)),
    ):
        np.testing.assert_allclose(fast.value, expected.value, atol=1e-12)
        np.testing.assert_allclose(fast.d, expected.d, atol=1e-11)


def test_the_whole_body_varies_as_stated_with_pose_and_shape(case: tuple[Body, Deformer]) -> None:
    body, _ = case
    theta = some_theta(body)
    n, rows = len(theta), np.arange(0, len(body.v_hat), 7)

    def skin(q: np.ndarray) -> np.ndarray:
        there = make_body(body.anatomy, shape=q[n:], v_hat=body.v_hat)
        return pose_skin(there, q[:n], vertices=rows)

    varying = pose_skin_varying(body, theta, with_shape=True, vertices=rows)
    check_jacobian(skin, varying.d, np.r_[theta, body.shape])


def test_its_bones_share_the_skin_out_whole(case: tuple[Body, Deformer]) -> None:
    body, deformer = case
    bound = body.bound_skin[body.anatomy.deformers.index(deformer)]
    shares = bone_shares(deformer, bound)
    assert tuple(shares) == deformer.bones
    np.testing.assert_allclose(sum(shares.values()), np.ones(len(body.v_hat)), atol=1e-12)
    assert all((share >= 0.0).all() for share in shares.values())


def test_the_mirror_image_moves_as_the_mirror_image(case: tuple[Body, Deformer]) -> None:
    right, _ = case
    left = mirrored_body(right)
    theta = some_theta(right)
    signs = np.ones(len(theta))
    for joint in right.anatomy.joints:
        signs[np.array(joint_index(right.anatomy, joint))[list(JOINT_TYPES[joint.type].turned_over)]] = -1.0
    flipped = pose_skin(left, signs * theta) * [1.0, 1.0, -1.0]
    np.testing.assert_allclose(flipped, pose_skin(right, theta), atol=1e-12)
    assert repr(mirrored(left.anatomy).deformers) == repr(right.anatomy.deformers)


def test_it_survives_its_file(case: tuple[Body, Deformer], tmp_path: Path) -> None:
    save_anatomy(case[0].anatomy, tmp_path / "arm.npz")
    assert read_anatomy(tmp_path / "arm.npz", where=tmp_path).deformers == case[0].anatomy.deformers


def test_linear_blending_with_helper_joints_poses_the_skin_nearly_as_it_does(case: tuple[Body, Deformer]) -> None:
    body, _ = case
    thetas = np.array([rest_theta(body), some_theta(body)])
    gap = skin_gap(linear_skin(body, thetas), thetas)
    coarse = skin_gap(linear_skin(body, thetas, steps=1), thetas)
    assert gap.mean_m < 1e-3
    assert gap.mean_m <= coarse.mean_m


def test_other_parts_than_its_own_make_no_deformer_of_the_type(case: tuple[Body, Deformer]) -> None:
    body, deformer = case
    anatomy, kind = body.anatomy, DEFORMER_TYPES[deformer.type]
    for wrong in ({"bones": (*deformer.bones, "palm")}, {"frames": (*deformer.frames, ULNA)}):
        with pytest.raises(AnatomyError) as caught:
            make_body(replace(anatomy, deformers=(replace(deformer, **wrong),)))  # type: ignore[arg-type]
        expected = (
            f"deformer tested: a deformer of type {kind.name} has {kind.bones} bone(s) and {kind.frames} frame(s)"
        )
        assert expected in str(caught.value)


def test_an_unknown_type_is_refused_in_one_line_with_the_known_ones(
    case: tuple[Body, Deformer], tmp_path: Path
) -> None:
    body, deformer = case
    save_anatomy(body.anatomy, tmp_path / "arm.npz")
    with np.load(tmp_path / "arm.npz") as data:
        arrays = dict(data)
    description = json.loads(str(arrays["description"]))
    description["deformers"][body.anatomy.deformers.index(deformer)]["type"] = "rubber"
    np.savez(tmp_path / "arm.npz", **(arrays | {"description": np.array(json.dumps(description))}))
    with pytest.raises(AnatomyError) as caught:
        load_anatomy(tmp_path / "arm.npz")
    message = str(caught.value)
    assert f"deformer {deformer.name}: no type 'rubber': the types are {', '.join(DEFORMER_TYPES)}" in message
    assert "\n" not in message


def test_every_type_has_an_example() -> None:
    assert set(EXAMPLES) == set(DEFORMER_TYPES)
