"""Every block of the model against finite differences, and the identities that must hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adapt.anatomy import Anatomy, Frame
from adapt.anatomy_file import load_anatomy, read_anatomy, save_anatomy
from adapt.mirror import mirrored
from adapt.model.body import (
    Body,
    bone_frames,
    bone_transforms,
    joint_centres,
    make_body,
    pose_skin,
    pose_skin_by_v_hat,
    pose_skin_varying,
    posed_bones,
    rest_theta,
)
from adapt.model.deformers import bind, carry
from adapt.model.derivatives import Motion, Points, compose, constant_points, invert, move, still_points
from adapt.model.frames import frame_from_landmarks
from adapt.model.handles import d_deform_d_shape, deform, handle_positions, local_scale
from adapt.model.joints import joint_motion
from adapt.model.kinematics import bone_motions
from adapt.model.shape.handle_space import affine_set
from capture.errors import AnatomyError
from capture.rigid import exp_so3, left_jacobian_so3, log_so3
from tests.finite_differences import check_jacobian
from tests.toy_anatomy import toy_anatomy


@pytest.fixture(params=["right", "left"])
def anatomy(request: pytest.FixtureRequest) -> Anatomy:
    return toy_anatomy() if request.param == "right" else mirrored(toy_anatomy())


@pytest.fixture
def theta(anatomy: Anatomy) -> np.ndarray:
    rng = np.random.default_rng(1)
    return rng.uniform(-0.8, 0.8, len(anatomy.coordinates)) + rest_theta(make_body(anatomy))


@pytest.fixture
def body(anatomy: Anatomy) -> Body:
    rng = np.random.default_rng(2)
    identity = affine_set(anatomy).identity
    return make_body(
        anatomy,
        shape=identity + rng.normal(0.0, 0.03, len(identity)),
        v_hat=anatomy.skin_vertices + rng.normal(0.0, 0.003, anatomy.skin_vertices.shape),
    )


def seeded(p: np.ndarray, *, spare: int = 0) -> Points:
    """Landmarks varying with their own 3P coordinates, after ``spare`` other columns."""
    n = p.size
    d = np.concatenate([np.zeros((n, spare)), np.eye(n)], axis=1)
    return Points(p, d.reshape(*p.shape, n + spare))


def turned_by(motion: Motion, reference: Motion) -> np.ndarray:
    """A rotation as the small angle that leads to it from a reference, for finite differences."""
    return np.concatenate([log_so3(motion.rotation @ reference.rotation.T), motion.translation])


def check_motion(function, at: np.ndarray) -> None:  # type: ignore[no-untyped-def]
    reference = function(at)
    jacobian = np.concatenate([reference.d_rotation, reference.d_translation])
    check_jacobian(lambda q: turned_by(function(q), reference), jacobian, at)


def test_exp_and_log_are_inverse_and_the_left_jacobian_is_its_derivative() -> None:
    rng = np.random.default_rng(0)
    for scale in (1e-9, 1e-3, 1.0, 2.9):
        r = rng.normal(size=3)
        r *= scale / np.linalg.norm(r)
        np.testing.assert_allclose(log_so3(exp_so3(r)), r, atol=1e-9)
        check_jacobian(lambda q, r=r: log_so3(exp_so3(q) @ exp_so3(r).T), left_jacobian_so3(r), r)


@pytest.mark.parametrize("short_of_pi", [0.0, 1e-12, 1e-7, 1e-3, 1.0, 2.0, np.pi - 1e-9])
def test_every_rotation_is_that_of_its_own_vector_up_to_half_a_turn(short_of_pi: float) -> None:
    rng = np.random.default_rng(6)
    for axis in (*np.eye(3), *-np.eye(3), *rng.normal(size=(20, 3))):
        rotation = exp_so3((np.pi - short_of_pi) * axis / np.linalg.norm(axis))
        vector = log_so3(rotation)
        assert np.linalg.norm(vector) == pytest.approx(np.pi - short_of_pi, abs=1e-12)
        np.testing.assert_allclose(exp_so3(vector), rotation, atol=1e-12)


def test_composition_inversion_and_action_agree_with_finite_differences() -> None:
    rng = np.random.default_rng(3)
    start, point = rng.normal(size=12), rng.normal(size=(4, 3))

    def one(q: np.ndarray, first: int) -> Motion:
        d_rotation, d_translation = np.zeros((2, 3, 12))
        d_rotation[:, first : first + 3] = left_jacobian_so3(q[first : first + 3])
        d_translation[:, first + 3 : first + 6] = np.eye(3)
        return Motion(exp_so3(q[first : first + 3]), q[first + 3 : first + 6], d_rotation, d_translation)

    check_motion(lambda q: compose(one(q, 0), one(q, 6)), start)
    check_motion(lambda q: invert(one(q, 0)), start)
    moved = move(one(start, 0), constant_points(point, 12))
    check_jacobian(lambda q: move(one(q, 0), constant_points(point, 12)).value, moved.d, start)


def test_a_landmark_frame_is_a_rotation_and_varies_as_stated(anatomy: Anatomy) -> None:
    frame = anatomy.bones[1].frame
    rotation = frame_from_landmarks(anatomy, frame, seeded(anatomy.landmarks)).rotation
    np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    check_motion(lambda q: frame_from_landmarks(anatomy, frame, seeded(q.reshape(-1, 3))), anatomy.landmarks.ravel())


@pytest.mark.parametrize("index", [0, 1, 3], ids=["free", "hinge", "universal"])
def test_each_joint_type_varies_as_stated_with_theta_and_landmarks(
    anatomy: Anatomy, theta: np.ndarray, index: int
) -> None:
    joint, n = anatomy.joints[index], len(theta)

    def motion(q: np.ndarray) -> Motion:
        return joint_motion(anatomy, joint, q[:n], seeded(q[n:].reshape(-1, 3), spare=n), 0)

    check_motion(motion, np.concatenate([theta, anatomy.landmarks.ravel()]))


def test_the_chain_varies_as_stated_with_theta_and_landmarks(anatomy: Anatomy, theta: np.ndarray) -> None:
    n = len(theta)

    def palm(q: np.ndarray) -> Motion:
        return bone_motions(anatomy, q[:n], seeded(q[n:].reshape(-1, 3), spare=n))["palm"]

    check_motion(palm, np.concatenate([theta, anatomy.landmarks.ravel()]))


def test_handles_are_affine_in_shape_and_points_and_vary_as_stated(anatomy: Anatomy) -> None:
    affine, positions = affine_set(anatomy), handle_positions(anatomy)
    points, weights = anatomy.skin_vertices, anatomy.skin_handle_weights
    shape = affine.identity + np.random.default_rng(4).normal(0.0, 0.1, len(affine.identity))
    a = affine.handle_parameters(shape)
    jacobian = d_deform_d_shape(points, weights, positions, affine.basis)
    check_jacobian(lambda s: deform(points, weights, positions, affine.handle_parameters(s)), jacobian, shape)
    step = np.random.default_rng(5).normal(size=points.shape)
    moved = deform(points + step, weights, positions, a) - deform(points, weights, positions, a)
    np.testing.assert_allclose(moved, local_scale(weights, a)[:, None] * step, atol=1e-12)
    np.testing.assert_allclose(
        deform(points, weights, positions, affine.handle_parameters(affine.identity)), points, atol=1e-12
    )


def test_the_affine_set_is_exactly_what_equation_4_leaves(anatomy: Anatomy) -> None:
    affine, positions = affine_set(anatomy), handle_positions(anatomy)
    rows, right = [], []
    for i, first in enumerate(anatomy.handles):
        for j, second in enumerate(anatomy.handles[:i]):
            if first.joint != second.joint:
                continue
            for row, rhs in _equation_4(i, j, positions):
                rows.append(row)
                right.append(rhs)
    constraints = np.array(rows)
    np.testing.assert_allclose(constraints @ affine.origin, right, atol=1e-12)
    np.testing.assert_allclose(constraints @ affine.basis, 0.0, atol=1e-12)
    free = constraints.shape[1] - np.linalg.matrix_rank(constraints)
    assert np.linalg.matrix_rank(affine.basis) == affine.basis.shape[1] == free


def _equation_4(i: int, j: int, positions: np.ndarray):  # type: ignore[no-untyped-def]
    same = np.zeros((len(positions), 4))
    same[i, 0], same[j, 0] = 1.0, -1.0
    yield same.ravel(), 0.0
    for k in range(3):
        row = np.zeros((len(positions), 4))
        row[i, 0] = (positions[i] - positions[j])[k]
        row[i, 1 + k], row[j, 1 + k] = -1.0, 1.0
        yield row.ravel(), (positions[i] - positions[j])[k]


def test_the_forearm_deformer_varies_as_stated(anatomy: Anatomy, theta: np.ndarray) -> None:
    n, m = len(theta), anatomy.landmarks.size
    ramp = np.array([[0.05, -0.33, 0.03], [0.1, -0.36, 0.0], [-0.2, -0.2, 0.0], [0.4, -0.6, 0.0]])

    def skin(q: np.ndarray) -> Points:
        p = seeded(q[n : n + m].reshape(-1, 3), spare=n)
        p = Points(p.value, np.concatenate([p.d, np.zeros((*p.value.shape, ramp.size))], axis=2))
        own = np.concatenate([np.zeros((ramp.size, n + m)), np.eye(ramp.size)], axis=1)
        points = Points(q[n + m :].reshape(-1, 3), own.reshape(*ramp.shape, -1))
        motions = bone_motions(anatomy, q[:n], p)
        deformer = anatomy.deformers[1]
        return carry(deformer, bind(anatomy, deformer, p, points), motions)

    at = np.concatenate([theta, anatomy.landmarks.ravel(), ramp.ravel()])
    check_jacobian(lambda q: skin(q).value, skin(at).d, at)


def test_the_elbow_end_follows_the_ulna_and_the_wrist_end_the_radius(anatomy: Anatomy, theta: np.ndarray) -> None:
    deformer = anatomy.deformers[1]
    p = constant_points(anatomy.landmarks, len(theta))
    motions = bone_motions(anatomy, theta, p)
    axis_start, axis_end = (frame_from_landmarks(anatomy, f, p).translation for f in deformer.frames)
    outside = np.array([axis_start - 0.2 * (axis_end - axis_start), axis_end + 0.2 * (axis_end - axis_start)])
    skin = constant_points(outside + 0.01, len(theta))
    carried = carry(deformer, bind(anatomy, deformer, p, skin), motions).value
    np.testing.assert_allclose(carried[0], move(motions["fore"], skin).value[0], atol=1e-12)
    np.testing.assert_allclose(carried[1], move(motions["spin"], skin).value[1], atol=1e-12)


def test_points_that_do_not_vary_are_carried_as_if_they_had_derivatives_of_zero(
    anatomy: Anatomy, theta: np.ndarray
) -> None:
    motions = bone_motions(anatomy, theta, constant_points(anatomy.landmarks, len(theta)))
    for deformer in anatomy.deformers:
        full, shared = (
            carry(deformer, bind(anatomy, deformer, constant_points(anatomy.landmarks, n), skin), motions)
            for n, skin in (
                (len(theta), constant_points(anatomy.skin_vertices, len(theta))),
                (1, still_points(anatomy.skin_vertices)),
            )
        )
        np.testing.assert_array_equal(shared.value, full.value)
        np.testing.assert_allclose(shared.d, full.d, atol=1e-12)


def test_a_forearm_that_hardly_twists_varies_like_one_that_does(anatomy: Anatomy, theta: np.ndarray) -> None:
    ulna = anatomy.deformers[1].frames[0]
    deformer = replace(anatomy.deformers[1], frames=(ulna, replace(ulna, origin=("styloid",))))  # alike at rest
    skin, p = still_points(anatomy.skin_vertices), constant_points(anatomy.landmarks, 1)
    bound = bind(anatomy, deformer, p, skin)
    index = anatomy.coordinate_index(next(j for j in anatomy.joints if j.child == "spin").coordinates[0])

    def carried(turn: float) -> Points:
        at = theta.copy()
        at[index] = anatomy.coordinates[index].rest + turn
        return carry(deformer, bound, bone_motions(anatomy, at, constant_points(anatomy.landmarks, len(theta))))

    for turn in (0.0, 1e-5, 1e-4, 1e-3):
        slope = (carried(turn + 1e-5).value - carried(turn - 1e-5).value) / 2e-5
        np.testing.assert_allclose(carried(turn).d[:, :, index], slope, atol=1e-8)


def test_the_whole_model_varies_as_stated_with_pose_and_shape(body: Body, theta: np.ndarray) -> None:
    n = len(theta)

    def skin(q: np.ndarray) -> np.ndarray:
        return pose_skin(make_body(body.anatomy, shape=q[n:], v_hat=body.v_hat), q[:n])

    varying = pose_skin_varying(body, theta, with_shape=True)
    at = np.concatenate([theta, body.shape])
    np.testing.assert_allclose(varying.value, skin(at), atol=1e-12)
    check_jacobian(skin, varying.d, at)
    np.testing.assert_allclose(pose_skin_varying(body, theta).d, varying.d[:, :, :n], atol=1e-12)


def test_the_whole_model_varies_as_stated_with_its_template_skin(body: Body, theta: np.ndarray) -> None:
    by_vertex = pose_skin_by_v_hat(body, theta)
    for i in (0, 7, 31):

        def vertex(x: np.ndarray, i: int = i) -> np.ndarray:
            v_hat = body.v_hat.copy()
            v_hat[i] = x
            return pose_skin(make_body(body.anatomy, shape=body.shape, v_hat=v_hat), theta)[i]

        check_jacobian(vertex, by_vertex.d[i], body.v_hat[i])


def test_some_vertices_pose_as_they_do_among_all(body: Body, theta: np.ndarray) -> None:
    some = np.array([3, 5, 40])
    np.testing.assert_array_equal(pose_skin(body, theta, vertices=some), pose_skin(body, theta)[some])
    np.testing.assert_array_equal(
        pose_skin_varying(body, theta, vertices=some).d, pose_skin_varying(body, theta).d[some]
    )
    few, all_of_them = pose_skin_by_v_hat(body, theta, vertices=some), pose_skin_by_v_hat(body, theta)
    np.testing.assert_allclose(few.value, all_of_them.value[some], atol=1e-14)
    np.testing.assert_allclose(few.d, all_of_them.d[some], atol=1e-14)


def test_deformers_that_touch_few_vertices_move_them_as_they_would_among_many(
    anatomy: Anatomy, theta: np.ndarray
) -> None:
    weights = anatomy.deformer_weights.copy()
    weights[10:, 1:] = 0.0
    few, many = (
        pose_skin_varying(make_body(replace(anatomy, deformer_weights=w)), theta, with_shape=True)
        for w in (weights, np.maximum(weights, 1e-30))
    )
    np.testing.assert_allclose(few.value, many.value, atol=1e-15)
    np.testing.assert_allclose(few.d, many.d, atol=1e-15)


def test_poses_and_bodies_asked_for_in_turn_do_not_mix(anatomy: Anatomy, body: Body, theta: np.ndarray) -> None:
    other, changed = make_body(anatomy), theta.copy()
    alone = [
        pose_skin(make_body(anatomy, shape=b.shape, v_hat=b.v_hat), t)
        for b in (body, other)
        for t in (theta, theta + 0.1)
    ]
    changed += 0.1  # in place: a pose is known by its numbers
    for _ in range(2):
        in_turn = [pose_skin(b, t) for b in (body, other) for t in (theta, changed)]
        np.testing.assert_array_equal(in_turn, alone)
    np.testing.assert_array_equal(
        pose_skin(body, np.zeros(len(theta), dtype=int)), pose_skin(body, np.zeros(len(theta)))
    )


def test_the_rest_pose_leaves_everything_in_place(body: Body) -> None:
    theta = rest_theta(body)
    np.testing.assert_allclose(pose_skin(body, theta), body.v_tilde.value, atol=1e-12)
    for name, transform in bone_transforms(body, theta).items():
        np.testing.assert_allclose(transform, np.eye(4), atol=1e-12, err_msg=name)


def test_a_pose_of_the_free_joint_is_the_root_frame_itself(body: Body, theta: np.ndarray) -> None:
    frame = bone_frames(body, theta)["upper"]
    np.testing.assert_allclose(frame[:3, :3], exp_so3(theta[:3]), atol=1e-12)
    np.testing.assert_allclose(frame[:3, 3], theta[3:6], atol=1e-12)
    np.testing.assert_allclose(joint_centres(body, theta)["shoulder"], theta[3:6], atol=1e-12)


def test_joints_never_dislocate_whatever_the_shape(anatomy: Anatomy) -> None:
    rng = np.random.default_rng(6)
    affine = affine_set(anatomy)
    positions = handle_positions(anatomy)
    a = affine.handle_parameters(affine.identity + rng.normal(0.0, 0.1, len(affine.identity)))
    point = rng.normal(size=3)
    moved = a[:, :1] * (point - positions) + positions + a[:, 1:]
    for group in affine.groups:
        images = moved[[handle.joint == group for handle in anatomy.handles]]
        np.testing.assert_allclose(images, images[:1].repeat(len(images), axis=0), atol=1e-12)


def test_bones_move_rigidly_with_their_transforms(body: Body, theta: np.ndarray) -> None:
    transform = bone_transforms(body, theta)["palm"]
    rest = body.rest_bones["palm"]
    np.testing.assert_allclose(posed_bones(body, theta)["palm"], rest @ transform[:3, :3].T + transform[:3, 3])


def test_an_anatomy_survives_its_file(anatomy: Anatomy, tmp_path) -> None:  # type: ignore[no-untyped-def]
    save_anatomy(anatomy, tmp_path / "toy.npz")
    again = read_anatomy(tmp_path / "toy.npz", where=tmp_path)
    assert again.joints == anatomy.joints
    assert again.deformers == anatomy.deformers
    assert isinstance(again.bones[0].frame, Frame)
    np.testing.assert_allclose(again.skin_vertices, anatomy.skin_vertices, atol=1e-7)


def test_wrong_names_and_files_are_told_with_what_would_be_right(anatomy: Anatomy, tmp_path) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(AnatomyError, match="use one of upper, fore, spin, palm"):
        anatomy.bone("tibia")
    with pytest.raises(AnatomyError, match="no anatomy 'tail'"):
        load_anatomy("tail")
    (tmp_path / "x.npz").write_bytes(b"nothing of the kind")
    with pytest.raises(AnatomyError, match=r"x\.npz: not an anatomy file"):
        load_anatomy(tmp_path / "x.npz")
    with pytest.raises(AnatomyError, match="v_hat of toy"):
        make_body(anatomy, v_hat=np.zeros((3, 3)))


@pytest.mark.parametrize("share", [0.0, 0.02, 0.1, 0.5, 0.9, 0.999])
def test_a_truncated_anatomy_is_refused_in_one_line(anatomy: Anatomy, tmp_path, share: float) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "cut.npz"
    save_anatomy(anatomy, path)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(AnatomyError, match=r"cut\.npz: not an anatomy file") as caught:
        load_anatomy(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", ["an array", "a list", "damaged"])
def test_an_npz_of_something_else_is_no_anatomy(anatomy: Anatomy, tmp_path, kind: str) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "other.npz"
    if kind == "an array":
        with path.open("wb") as file:
            np.save(file, np.zeros(3))
    elif kind == "a list":
        np.savez(path, description=np.array("[1, 2]"))
    else:
        save_anatomy(anatomy, path)
        data = bytearray(path.read_bytes())
        data[len(data) // 3 : len(data) // 3 + 200] = bytes(200)
        path.write_bytes(data)
    with pytest.raises(AnatomyError, match=r"other\.npz: not an anatomy file"):
        load_anatomy(path)
