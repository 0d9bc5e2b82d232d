"""A left limb is the mirror image of the right one, at rest, in every pose and in every angle that is reported."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adapt.anatomy import anatomy_arrays
from adapt.anatomy_file import load_anatomy, save_anatomy
from adapt.fit.pose import fit_pose
from adapt.fit.shape import fit_shape
from adapt.match.correspondences import Target
from adapt.match.skin_sample import sample_skin
from adapt.mirror import mirrored, mirrored_name, mirrored_points
from adapt.model.body import (
    Body,
    bone_frames,
    bone_transforms,
    joint_centres,
    make_body,
    pose_skin,
    posed_bones,
    rest_theta,
)
from adapt.model.shape.handle_space import affine_set
from adapt.subject import Subject, load_subject, save_subject
from adapt.template_builder import checks
from adapt.tissue import tissue_deviation, tissue_field
from capture.errors import AnatomyError
from capture.rigid import apply, exp_so3, log_so3
from tests.toy_anatomy import toy_anatomy
from tests.toy_leg import toy_leg
from track.angles import thoraco_humeral
from track.evaluation.made_up_motions import motion_names, perform
from track.evaluation.random_bodies import random_body

LEFT = "upper-limb-left"
REFLECTION = np.diag([1.0, 1.0, -1.0, 1.0])


@pytest.fixture(scope="module")
def left():
    return load_anatomy(LEFT)


@pytest.fixture(scope="module", params=["arm", "toy", "leg", "lower limb"])
def pair(request, arm):
    """A right body of some proportions, and its mirror image."""
    made = {"arm": arm, "toy": toy_anatomy(), "leg": toy_leg()}
    right = made.get(request.param) or load_anatomy("lower-limb-right")
    rng = np.random.default_rng(8)
    identity = affine_set(right).identity
    shape = identity + rng.normal(0.0, 0.02, len(identity))
    v_hat = right.skin_vertices + rng.normal(0.0, 0.002, right.skin_vertices.shape)
    other = shape.reshape(-1, 4) * [1.0, 1.0, 1.0, -1.0]
    return make_body(right, shape=shape, v_hat=v_hat), make_body(
        mirrored(right), shape=other.ravel(), v_hat=mirrored_points(v_hat)
    )


def random_theta(body: Body, seed: int) -> np.ndarray:
    """Any place and orientation of the root, joints anywhere in their ranges."""
    rng = np.random.default_rng(seed)
    low, high = np.array([(c.low, c.high) for c in body.anatomy.coordinates]).T
    theta = rng.uniform(low, high)
    theta[:3], theta[3:6] = rng.uniform(-1.5, 1.5, 3), rng.uniform(-1.0, 1.0, 3)
    return theta


def other_side(theta: np.ndarray) -> np.ndarray:
    """The mirrored root transform with the same joint coordinates."""
    rotation = REFLECTION[:3, :3] @ exp_so3(theta[:3]) @ REFLECTION[:3, :3]
    return np.concatenate([log_so3(rotation), REFLECTION[:3, :3] @ theta[3:6], theta[6:]])


# ---- at rest


def test_a_left_limb_is_loaded_by_its_name(arm, left):
    assert (left.name, left.side) == (LEFT, "left")
    assert left.landmark_names == arm.landmark_names
    assert [c.name for c in left.coordinates] == [c.name for c in arm.coordinates]
    np.testing.assert_array_equal(left.skin_vertices, arm.skin_vertices * [1.0, 1.0, -1.0])


def test_a_limb_mirrored_twice_is_the_limb_itself(arm):
    for anatomy in (arm, toy_anatomy()):
        again = mirrored(mirrored(anatomy))
        assert repr(again) == repr(anatomy)
        before = anatomy_arrays(anatomy)
        for name, array in anatomy_arrays(again).items():
            np.testing.assert_array_equal(array, before[name], err_msg=name)


def test_a_left_limb_is_as_sound_as_the_right_one(left):
    found = [
        *checks.surface_checks(left),
        *checks.tetrahedra_checks(left),
        *checks.landmark_checks(left),
        *checks.turn_checks(make_body(left)),
    ]
    assert not [check.line() for check in found if not check.passed]


def test_it_is_a_left_arm(left):
    """For a left hand, (towards the fingertips) x (towards the thumb) points out of the palm."""
    at = dict(zip(left.landmark_names, left.landmarks, strict=True))
    fingers, thumbs_side = at["finger3_tip"] - at["MC3_base"], at["RS"] - at["US"]
    palm = at["wrist_deviation_axis_palmar"] - at["wrist_deviation_axis_dorsal"]
    assert np.cross(fingers, thumbs_side) @ palm > 0.0
    assert at["elbow_axis_lateral"][2] < at["elbow_axis_medial"][2]


def test_free_coordinates_turn_their_ranges_over_and_others_keep_theirs():
    toy = toy_anatomy()
    limited = replace(toy, coordinates=tuple(replace(c, low=-1.0, high=2.0) for c in toy.coordinates))
    ranges = [(c.low, c.high) for c in mirrored(limited).coordinates]
    turned = [(-2.0, 1.0) if k in (0, 1, 5) else (-1.0, 2.0) for k in range(len(ranges))]
    assert ranges == turned


# ---- in every pose


@pytest.mark.parametrize("seed", range(5))
def test_mirroring_commutes_with_posing(pair, seed):
    right, left = pair
    theta = random_theta(right, seed)
    mirror = other_side(theta)
    np.testing.assert_allclose(pose_skin(left, mirror), mirrored_points(pose_skin(right, theta)), atol=1e-12)
    bones = posed_bones(right, theta)
    for name, vertices in posed_bones(left, mirror).items():
        np.testing.assert_allclose(vertices, mirrored_points(bones[name]), atol=1e-12, err_msg=name)
    centres = joint_centres(right, theta)
    for name, centre in joint_centres(left, mirror).items():
        np.testing.assert_allclose(centre, mirrored_points(centres[name]), atol=1e-12, err_msg=name)
    landmarks, others = posed_landmarks(right, theta), posed_landmarks(left, mirror)
    for name, points in others.items():
        np.testing.assert_allclose(points, mirrored_points(landmarks[name]), atol=1e-12, err_msg=name)


def posed_landmarks(body: Body, theta: np.ndarray) -> dict[str, np.ndarray]:
    """All landmarks (P, 3), carried by each bone in turn."""
    return {name: apply(transform, body.p.value) for name, transform in bone_transforms(body, theta).items()}


@pytest.mark.parametrize("seed", range(5))
def test_frames_of_a_left_limb_are_rotations_whose_z_points_to_the_bodys_right(pair, seed):
    right, left = pair
    theta = random_theta(right, seed)
    frames = bone_frames(right, theta)
    for name, frame in bone_frames(left, other_side(theta)).items():
        assert np.linalg.det(frame[:3, :3]) == pytest.approx(1.0)
        np.testing.assert_allclose(frame, REFLECTION @ frames[name] @ REFLECTION, atol=1e-12, err_msg=name)
    at_rest = bone_frames(left, rest_theta(left))
    reflected = bone_frames(right, rest_theta(right))
    assert all(frame[2, 2] * reflected[name][2, 2] > 0.0 for name, frame in at_rest.items())


def test_the_rest_pose_of_a_left_limb_is_the_mirrored_rest_pose(pair):
    right, left = pair
    np.testing.assert_allclose(rest_theta(left), other_side(rest_theta(right)), atol=1e-12)


# ---- in what is reported


@pytest.mark.parametrize(
    ("humerus", "plane", "elevation"),
    [
        (exp_so3(np.deg2rad([90.0, 0.0, 0.0])), 0.0, 90.0),  # the elbow points left (-Z): abduction
        (np.column_stack([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]), 90.0, 90.0),  # forward: flexion
    ],
)
def test_a_raised_left_arm_has_the_angles_that_isb_gives_it(humerus, plane, elevation):
    assert np.linalg.det(humerus) == pytest.approx(1.0)
    for turned in (np.eye(3), exp_so3(np.array([0.3, -0.7, 1.1]))):
        thorax = np.eye(4)
        thorax[:3, :3] = turned
        angles = thoraco_humeral(thorax, log_so3(turned @ humerus)[None], [0, 1, 2], side="left")
        assert angles["thoracohumeral_plane_of_elevation"][0] == pytest.approx(plane, abs=1e-6)
        assert angles["thoracohumeral_elevation"][0] == pytest.approx(elevation)


def test_both_arms_report_the_same_angles_in_mirrored_poses():
    rng = np.random.default_rng(3)
    thetas, thorax = rng.uniform(-1.0, 1.0, (20, 6)), np.eye(4)
    thorax[:3, :3] = exp_so3(np.array([0.2, 0.5, -0.4]))
    others = np.array([other_side(theta) for theta in thetas])
    right = thoraco_humeral(thorax, thetas, [0, 1, 2], side="right")
    left = thoraco_humeral(REFLECTION @ thorax @ REFLECTION, others, [0, 1, 2], side="left")
    for name, values in right.items():
        np.testing.assert_allclose(left[name], values, atol=1e-9, err_msg=name)


# ---- in files and tables


def test_names_of_sides_change_places():
    assert mirrored_name("upper-limb-right") == LEFT
    assert mirrored_name(LEFT) == "upper-limb-right"
    assert mirrored_name("body") == "body-mirrored"
    assert mirrored_name("body-mirrored") == "body"
    assert mirrored_name("right") == "left"


def test_a_left_limb_survives_its_file(tmp_path, left):
    save_anatomy(left, tmp_path / f"{left.name}.npz")  # a file's anatomy is called as the file
    again = load_anatomy(tmp_path / f"{left.name}.npz")
    assert repr(again) == repr(left)
    np.testing.assert_array_equal(again.skin_vertices, left.skin_vertices)


def test_a_left_subject_comes_back_left(tmp_path, left):
    body = random_body(left, 4)
    save_subject(Subject(body, np.zeros((1, 10)), np.zeros(1), np.eye(len(body.shape)), {}), tmp_path / "s.npz")
    back = load_subject(tmp_path / "s.npz", anatomy=LEFT)
    assert back.anatomy.side == "left"
    np.testing.assert_allclose(back.body.v_hat, body.v_hat, atol=1e-8)
    with pytest.raises(AnatomyError, match="adapt one with --anatomy upper-limb-right"):
        load_subject(tmp_path / "s.npz", anatomy="upper-limb-right")


def test_an_unknown_anatomy_is_told_with_both_sides(tmp_path):
    for name in ("tail", "lower-limb-middle", tmp_path / "none.npz"):
        with pytest.raises(AnatomyError, match=r"upper-limb-left, upper-limb-right"):
            load_anatomy(name)


def test_a_coefficient_of_tissue_means_the_same_on_both_sides(arm, left):
    """Files hold covariances of the coefficients, so the modes may not depend on what a solver makes of their signs."""
    right = tissue_field(arm).modes
    np.testing.assert_allclose(tissue_field(left).modes, right, atol=1e-6 * np.abs(right).max())


def test_tissue_random_bodies_and_motions_are_the_same_on_both_sides(arm, left):
    np.testing.assert_allclose(tissue_deviation(left), tissue_deviation(arm), atol=1e-9)
    bodies = [random_body(anatomy, 4) for anatomy in (arm, left)]
    np.testing.assert_allclose(bodies[1].v_tilde.value, mirrored_points(bodies[0].v_tilde.value), atol=1e-9)
    assert motion_names(left) == motion_names(arm)
    moves = [perform(body, motion_names(arm)[:2], seconds_each=0.2, seed=1).thetas for body in bodies]
    np.testing.assert_array_equal(moves[0][:, 6:], moves[1][:, 6:])


# ---- in fitting


@pytest.fixture(scope="module")
def seen(limb):
    """A right limb in one of its clouds, the mirror images of both, and a pose that is a little off."""
    body, target = limb.subject.body, limb.targets[2]
    shape = body.shape.reshape(-1, 4) * [1.0, 1.0, 1.0, -1.0]
    other = make_body(mirrored(body.anatomy), shape=shape.ravel(), v_hat=mirrored_points(body.v_hat))
    cloud = target.cloud
    views = tuple(replace(view, world_from_sensor=REFLECTION @ view.world_from_sensor) for view in cloud.views)
    points, normals = mirrored_points(cloud.points), mirrored_points(cloud.normals)
    image = Target(replace(cloud, points=points, normals=normals, views=views))
    return (body, target), (other, image), limb.thetas[2] + 0.03


def test_a_left_limb_fits_the_mirrored_cloud_as_the_right_one_fits_the_cloud(seen):
    right, left, theta = seen
    fits = [
        fit_pose(body, target, start, sample_skin(body.anatomy, at_most=500), updates=4)
        for (body, target), start in ((right, theta), (left, other_side(theta)))
    ]
    np.testing.assert_array_equal(fits[1].matches.vertex, fits[0].matches.vertex)
    np.testing.assert_allclose(fits[1].theta, other_side(fits[0].theta), atol=1e-6)
    assert np.abs(fits[0].theta - theta).max() > 0.01


def test_the_shape_of_a_left_limb_is_fitted_as_that_of_the_right_one(seen):
    right, left, theta = seen
    fitted = [
        fit_shape(
            make_body(body.anatomy), [target], start[None], sample_skin(body.anatomy, at_most=500), updates=2
        ).body.shape.reshape(-1, 4)
        for (body, target), start in ((right, theta), (left, other_side(theta)))
    ]
    np.testing.assert_allclose(fitted[1], fitted[0] * [1.0, 1.0, 1.0, -1.0], atol=1e-6)
    assert np.abs(fitted[0] - [1.0, 0.0, 0.0, 0.0]).max() > 0.005
