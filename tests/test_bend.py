"""The ball joint and the bend deformer: derivatives, ends, and skin that does not collapse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adapt.anatomy import Anatomy, Deformer, Frame, Joint
from adapt.anatomy_file import read_anatomy, save_anatomy
from adapt.model.body import make_body, pose_skin, pose_skin_by_v_hat, pose_skin_varying, rest_theta
from adapt.model.deformers.bend import Bend
from adapt.model.derivatives import Motion, Points, constant_points, move, still_points
from adapt.model.joints import joint_motion
from adapt.model.kinematics import bone_motions
from capture.errors import AnatomyError
from capture.rigid import exp_so3
from tests.finite_differences import check_jacobian
from tests.test_model import check_motion, seeded
from tests.toy_anatomy import toy_anatomy

BENT = Frame(("inner", "outer"), ("top",), ("styloid",), ("inner",), ("outer",))
START = Frame(("top", "inner", "outer"), ("top",), ("inner", "outer"), ("inner",), ("outer",))
END = Frame(("inner", "outer", "styloid"), ("inner", "outer"), ("styloid",), ("inner",), ("outer",))
ELBOW = Deformer("upper", "bend", ("upper", "fore"), (START, END, BENT))
ABOUT_ELBOW = np.array([[0.03, -0.31, 0.01], [-0.02, -0.29, 0.0], [0.06, -0.33, 0.03], [0.02, -0.305, -0.04]])


@pytest.fixture
def anatomy() -> Anatomy:
    """The toy arm with a ball for its wrist and a bend between upper and fore arm."""
    toy = toy_anatomy()
    twist = ("head", "styloid")
    wrist = toy.joint("wrist")
    ball = Joint(
        "wrist", "ball", wrist.parent, wrist.child, ("dev", "flex", "spin"), (*wrist.axes, twist), wrist.centre
    )
    return replace(toy, joints=(*toy.joints[:-1], ball), deformers=(ELBOW, *toy.deformers[1:]))


@pytest.fixture
def theta(anatomy: Anatomy) -> np.ndarray:
    rng = np.random.default_rng(1)
    return rng.uniform(-0.8, 0.8, len(anatomy.coordinates)) + rest_theta(make_body(anatomy))


def test_a_ball_varies_as_stated_with_pose_and_landmarks(anatomy: Anatomy, theta: np.ndarray) -> None:
    n, joint = len(theta), anatomy.joint("wrist")

    def motion(q: np.ndarray) -> Motion:
        return joint_motion(anatomy, joint, q[:n], seeded(q[n:].reshape(-1, 3), spare=n), 0)

    check_motion(motion, np.concatenate([theta, anatomy.landmarks.ravel()]))


def test_a_ball_turns_as_opensims_body_fixed_rotations_do() -> None:
    """Axes that stand as the rest angles leave them give R(z, q1) R(x, q2) R(y, q3), undone at rest."""
    x, y, z = np.eye(3)
    rest, angles = np.array([0.2, -0.3, 0.4]), np.array([0.9, 0.3, -0.5])

    def turned(q: np.ndarray) -> np.ndarray:
        return exp_so3(q[0] * z) @ exp_so3(q[1] * x) @ exp_so3(q[2] * y)

    axes = (z, exp_so3(rest[0] * z) @ x, exp_so3(rest[0] * z) @ exp_so3(rest[1] * x) @ y)
    toy, names = toy_anatomy(), [(f"from{k}", f"to{k}") for k in range(3)]
    points = np.array([point for axis in axes for point in (-axis, axis)])
    coordinates = tuple(replace(c, rest=r) for c, r in zip(toy.coordinates[6:9], rest, strict=True))
    ball = Joint("ball", "ball", "upper", "fore", tuple(c.name for c in coordinates), tuple(names), ("from0",))
    flat = tuple(name for pair in names for name in pair)
    anatomy = replace(toy, joints=(ball,), coordinates=coordinates, landmark_names=flat, landmarks=points)
    motion = joint_motion(anatomy, ball, angles, constant_points(points, 3), 0)
    np.testing.assert_allclose(motion.rotation, turned(angles) @ turned(rest).T, atol=1e-12)
    np.testing.assert_allclose(motion.translation, 0.0, atol=1e-12)


def carried(anatomy: Anatomy, theta: np.ndarray, skin: np.ndarray) -> np.ndarray:
    p = constant_points(anatomy.landmarks, len(theta))
    motions = bone_motions(anatomy, theta, p)
    points = constant_points(skin, len(theta))
    return Bend().carry(Bend().bind(anatomy, ELBOW, p, points), (motions["upper"], motions["fore"])).value


def test_the_bend_deformer_varies_as_stated(anatomy: Anatomy, theta: np.ndarray) -> None:
    n, m = len(theta), anatomy.landmarks.size
    theta = theta.copy()
    theta[anatomy.coordinate_index("bend")] = 2.0
    away = np.array([[0.0, -0.1, 0.0], [0.2, -0.42, 0.0]])  # before the start, beyond the end
    points = np.concatenate([ABOUT_ELBOW, away])

    def skin(q: np.ndarray) -> Points:
        p = seeded(q[n : n + m].reshape(-1, 3), spare=n)
        p = Points(p.value, np.concatenate([p.d, np.zeros((*p.value.shape, points.size))], axis=2))
        own = np.concatenate([np.zeros((points.size, n + m)), np.eye(points.size)], axis=1)
        varying = Points(q[n + m :].reshape(-1, 3), own.reshape(*points.shape, -1))
        motions = bone_motions(anatomy, q[:n], p)
        return Bend().carry(Bend().bind(anatomy, ELBOW, p, varying), (motions["upper"], motions["fore"]))

    at = np.concatenate([theta, anatomy.landmarks.ravel(), points.ravel()])
    check_jacobian(lambda q: skin(q).value, skin(at).d, at)


def test_points_that_do_not_vary_are_carried_as_if_they_had_derivatives_of_zero(
    anatomy: Anatomy, theta: np.ndarray
) -> None:
    p = constant_points(anatomy.landmarks, len(theta))
    motions = bone_motions(anatomy, theta, p)
    pair = motions["upper"], motions["fore"]
    varying = Bend().carry(Bend().bind(anatomy, ELBOW, p, constant_points(ABOUT_ELBOW, len(theta))), pair)
    still = Bend().carry(Bend().bind(anatomy, ELBOW, p, still_points(ABOUT_ELBOW)), pair)
    np.testing.assert_allclose(still.value, varying.value, atol=1e-14)
    np.testing.assert_allclose(still.d, varying.d, atol=1e-12)


def test_skin_before_the_bend_rides_on_the_first_bone_and_beyond_it_on_the_second(
    anatomy: Anatomy, theta: np.ndarray
) -> None:
    p = constant_points(anatomy.landmarks, len(theta))
    motions = bone_motions(anatomy, theta, p)
    ends = constant_points(np.array([[0.0, -0.1, 0.02], [0.2, -0.42, 0.02]]), len(theta))
    moved = carried(anatomy, theta, ends.value)
    np.testing.assert_allclose(moved[0], move(motions["upper"], ends).value[0], atol=1e-12)
    np.testing.assert_allclose(moved[1], move(motions["fore"], ends).value[1], atol=1e-12)


def test_at_rest_the_bend_leaves_skin_where_it_is(anatomy: Anatomy) -> None:
    rest = rest_theta(make_body(anatomy))
    np.testing.assert_allclose(carried(anatomy, rest, ABOUT_ELBOW), ABOUT_ELBOW, atol=1e-12)


def test_the_whole_model_with_a_bend_varies_as_stated(anatomy: Anatomy, theta: np.ndarray) -> None:
    body = make_body(anatomy)
    n = len(theta)

    def skin(q: np.ndarray) -> np.ndarray:
        return pose_skin(make_body(anatomy, shape=q[n:]), q[:n])

    varying = pose_skin_varying(body, theta, with_shape=True)
    check_jacobian(skin, varying.d, np.concatenate([theta, body.shape]))
    own = pose_skin_by_v_hat(body, theta)
    np.testing.assert_allclose(own.value, varying.value, atol=1e-12)
    for axis in range(3):
        step = np.zeros_like(body.v_hat)
        step[:, axis] = 1e-6
        there, back = (pose_skin(make_body(anatomy, v_hat=body.v_hat + s * step), theta) for s in (1.0, -1.0))
        np.testing.assert_allclose((there - back) / 2e-6, own.d[:, :, axis], atol=1e-6)


def tube(radius: float = 0.05, half: float = 0.15) -> tuple[np.ndarray, Anatomy]:
    """A straight tube along -y about the origin, which bends there about z: its skin (N, 3) and an anatomy for it."""
    along, around = np.meshgrid(np.linspace(half, -half, 61), np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False))
    skin = np.stack([radius * np.cos(around), along, radius * np.sin(around)], axis=-1).reshape(-1, 3)
    points = {
        "centre": (0.0, 0.0, 0.0),
        "below": (0.0, -0.1, 0.0),
        "left": (0.0, 0.0, -0.05),
        "right": (0.0, 0.0, 0.05),
        "start": (0.0, 0.06, 0.0),
        "end": (0.0, -0.06, 0.0),
        "beyond": (0.0, -0.2, 0.0),
    }
    toy = toy_anatomy()
    return skin, replace(toy, landmark_names=tuple(points), landmarks=np.array(list(points.values())))


def bent_tube(degrees: float) -> tuple[np.ndarray, np.ndarray]:
    """The tube at rest and bent forward (towards +x) by an angle."""
    skin, anatomy = tube()
    frames = tuple(
        Frame((origin,), (origin,), (to,), ("left",), ("right",))
        for origin, to in (("start", "centre"), ("end", "beyond"), ("centre", "below"))
    )
    still = Motion(np.eye(3), np.zeros(3), np.zeros((3, 0)), np.zeros((3, 0)))
    turned = replace(still, rotation=exp_so3(np.array([0.0, 0.0, np.radians(degrees)])))
    points = constant_points(skin, 0)
    bound = Bend().bind(
        anatomy, Deformer("bend", "bend", ("one", "two"), frames), constant_points(anatomy.landmarks, 0), points
    )
    return skin, Bend().carry(bound, (still, turned)).value


@pytest.mark.parametrize("degrees", [30.0, 60.0, 90.0, 120.0])
def test_the_outer_side_of_a_bend_keeps_its_distance_from_the_joint(degrees: float) -> None:
    """Over a kneecap skin must not sink in; a linear blend would halve the distance at 120 degrees."""
    rest, bent = bent_tube(degrees)
    outer = rest[:, 0] <= 0.0  # turned about z, what hangs down swings towards +x
    np.testing.assert_allclose(
        np.linalg.norm(bent[outer, :2], axis=1), np.linalg.norm(rest[outer, :2], axis=1), atol=1e-12
    )


@pytest.mark.parametrize(("degrees", "least", "most"), [(60.0, 1.0, 1.2), (90.0, 1.0, 1.45)])
def test_tissue_evades_outwards_on_the_inner_side_but_no_farther_than_a_mitre(
    degrees: float, least: float, most: float
) -> None:
    rest, bent = bent_tube(degrees)
    crease = (rest[:, 0] > 0.04) & (np.abs(rest[:, 1]) < 1e-6)
    ratio = np.linalg.norm(bent[crease, :2], axis=1) / np.linalg.norm(rest[crease, :2], axis=1)
    assert least < ratio.min() <= ratio.max() < most
    assert most == pytest.approx(1.0 / np.cos(np.radians(degrees) / 2.0), abs=0.05)


def test_a_file_with_a_ball_and_a_bend_says_what_it_said(anatomy: Anatomy, tmp_path) -> None:  # type: ignore[no-untyped-def]
    save_anatomy(anatomy, tmp_path / "a.npz")
    read = read_anatomy(tmp_path / "a.npz", where=tmp_path)
    assert read.joints == anatomy.joints
    assert read.deformers == anatomy.deformers


def test_a_ball_has_three_axes() -> None:
    hip = Joint("hip", "ball", "pelvis", "femur", ("a", "b"), (("p", "q"), ("r", "s")), ("p",))
    with pytest.raises(AnatomyError, match="ball has 3 coordinate"):
        make_body(replace(toy_anatomy(), joints=(hip,)))
