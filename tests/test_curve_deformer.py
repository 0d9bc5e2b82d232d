"""The curve deformer: skin rides on shares of the joint's own arc, and neither shears nor collapses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adapt.anatomy import Anatomy, Deformer, Floats
from adapt.model.body import Body, make_body, pose_skin, pose_skin_varying, rest_theta
from adapt.model.deformers import bind, carry
from adapt.model.deformers.curve import Curve
from adapt.model.derivatives import Motion, Points, constant_points, still_points
from adapt.model.joints import JOINT_TYPES
from adapt.model.joints.curve import Curve as CurveJoint
from adapt.model.kinematics import bone_motions
from adapt.model.pose_space import joint_index
from capture.errors import AnatomyError
from tests.finite_differences import check_jacobian
from tests.test_deformer_types import END, START, arched_elbow
from tests.test_model import seeded
from tests.toy_anatomy import toy_anatomy
from track.evaluation.skin_of_blocks import skin_of_blocks_by_shape

CURVE = Deformer("belly", "curve", ("upper", "fore"), (START, END))
POINTS = np.array([[0.03, -0.3, 0.01], [0.05, -0.25, 0.03], [0.02, -0.2, 0.04], [0.1, -0.36, 0.02]])
BENDS = [
    (0.0, 0.0, 0.0),
    (1e-9, 0.0, 0.5),
    (1e-4, 0.0, 0.0),
    (1e-4, -1e-4, 1e-4),
    (0.5, 0.5, 0.5),
    (0.0, 2.0, -0.5),
    (2.0, 0.0, 2.0),
]


def anatomy() -> Anatomy:
    toy = arched_elbow(toy_anatomy())
    return replace(toy, deformers=(toy.deformers[0], CURVE, toy.deformers[2]))


def body() -> Body:
    """A body of other proportions than the template's, in which everything rides on the curve to some part."""
    template = make_body(anatomy())
    scales = np.linspace(0.9, 1.1, len(template.affine.groups))
    return make_body(template.anatomy, shape=template.affine.shape(scales, np.zeros((len(scales), 3))))


def bent(some: Body, q: tuple[float, ...]) -> Floats:
    """A pose with the arc bent so."""
    theta = rest_theta(some) + np.random.default_rng(3).uniform(-0.4, 0.4, len(some.anatomy.coordinates))
    theta[joint_index(some.anatomy, some.anatomy.joint("elbow"))] = q
    return theta


@pytest.mark.parametrize("q", BENDS)
def test_it_varies_as_stated_with_theta_landmarks_and_skin_however_bent(q: tuple[float, ...]) -> None:
    some = body()
    theta, n, m = bent(some, q), len(some.anatomy.coordinates), some.anatomy.landmarks.size

    def skin(x: Floats) -> Points:
        p = seeded(x[n : n + m].reshape(-1, 3), spare=n)
        p = Points(p.value, np.concatenate([p.d, np.zeros((*p.value.shape, POINTS.size))], axis=2))
        own = np.concatenate([np.zeros((POINTS.size, n + m)), np.eye(POINTS.size)], axis=1)
        points = Points(x[n + m :].reshape(-1, 3), own.reshape(*POINTS.shape, -1))
        return carry(CURVE, bind(some.anatomy, CURVE, p, points), bone_motions(some.anatomy, x[:n], p))

    at = np.concatenate([theta, some.anatomy.landmarks.ravel(), POINTS.ravel()])
    check_jacobian(lambda x: skin(x).value, skin(at).d, at)


@pytest.mark.parametrize("q", BENDS)
def test_the_compiled_loops_follow_however_bent(q: tuple[float, ...]) -> None:
    some = body()
    theta, rows = bent(some, q), np.arange(len(some.v_hat))
    model = skin_of_blocks_by_shape(some, theta, rows)
    fast = pose_skin_varying(some, theta, with_shape=True)
    np.testing.assert_allclose(fast.value, model.value, atol=1e-12)
    np.testing.assert_allclose(fast.d, model.d, atol=1e-11)


@pytest.mark.parametrize("q", BENDS)
def test_every_point_is_carried_as_what_rides_on_its_share_of_the_joint(q: tuple[float, ...]) -> None:
    some = body()
    theta, joint = bent(some, q), some.anatomy.joint("elbow")
    p = constant_points(some.p.value, len(theta))
    bound = bind(some.anatomy, CURVE, p, still_points(POINTS))
    shares = Curve().bone_shares(bound)[1]
    assert ((shares > 0.0) & (shares < 1.0)).sum() >= 3
    curve = JOINT_TYPES[joint.type]
    assert isinstance(curve, CurveJoint)
    motions = bone_motions(some.anatomy, theta, p)
    index = joint_index(some.anatomy, joint)
    for share, point, found in zip(shares, POINTS, carry(CURVE, bound, motions).value, strict=True):
        on_base = curve.along(some.anatomy, joint, theta[index], p, index, float(share))
        there = motions["upper"].matrix() @ on_base.matrix() @ np.append(point, 1.0)
        np.testing.assert_allclose(found, there[:3], atol=1e-12)


def test_before_its_start_skin_goes_with_the_base_and_beyond_its_end_with_the_top() -> None:
    some = body()
    theta = bent(some, (0.5, -0.3, 0.8))
    p = constant_points(some.p.value, len(theta))
    motions = bone_motions(some.anatomy, theta, p)
    for point, bone in (((0.0, 0.2, 0.0), "upper"), ((0.2, -0.6, 0.0), "fore")):
        bound = bind(some.anatomy, CURVE, p, still_points(np.array([point])))
        expected = motions[bone].matrix() @ np.append(point, 1.0)
        np.testing.assert_allclose(carry(CURVE, bound, motions).value[0], expected[:3], atol=1e-12)


def test_the_skin_has_no_kink_where_it_starts_and_ends() -> None:
    some = body()
    line = np.linspace([0.0, 0.1, 0.0], [0.15, -0.6, 0.0], 2001)
    bound = bind(some.anatomy, CURVE, constant_points(some.p.value, 1), still_points(line))
    share = Curve().bone_shares(bound)[1]
    steps = np.diff(share)
    assert (share[0], share[-1]) == (0.0, 1.0)
    assert (steps >= 0.0).all()
    assert np.abs(np.diff(steps)).max() < 0.05 * steps.max()  # the slope itself has no step


def belly(bend: float, twist: float) -> tuple[Floats, Floats]:
    """Volume of a round trunk and the radii (N,) of its sections, at rest straight, bent forward and twisted so."""
    arc, height, radius = 0.2, 0.5, 0.12
    turn, ys = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False), np.linspace(-0.15, 0.35, 101)
    rings = np.array([[[radius * np.cos(a), y, radius * np.sin(a)] for a in turn] for y in ys])
    names = ("base", "top", "left", "right", "low", "high")
    landmarks = np.array([[0, 0, 0], [0, arc, 0], [0, 0, -0.1], [0, 0, 0.1], [0, -0.1, 0], [0, 0.3, 0]])
    toy = arched_elbow(toy_anatomy())
    across = ("left",), ("right",)
    elbow = replace(toy.joint("elbow"), frames=(type(START)(("base",), ("base",), ("top",), *across),))
    still = tuple(replace(c, rest=0.0) for c in toy.coordinates)
    trunk = replace(
        toy, joints=(toy.joints[0], elbow), coordinates=still, landmark_names=names, landmarks=landmarks + 0.0
    )
    planes = tuple(type(START)((at,), ("base",), ("top",), *across) for at in ("low", "high"))
    deformer = Deformer("belly", "curve", ("upper", "fore"), planes)  # type: ignore[arg-type]
    p, none = constant_points(trunk.landmarks, 0), np.zeros((3, 0))
    kind = JOINT_TYPES["curve"]
    h = kind.motion(trunk, elbow, np.array([0.0, -bend, twist]), constant_points(trunk.landmarks, 3), [0, 1, 2])
    motions = {
        "upper": Motion(np.eye(3), np.zeros(3), none, none),
        "fore": Motion(h.rotation, h.translation, none, none),
    }
    points = constant_points(rings.reshape(-1, 3), 0)
    posed = carry(deformer, bind(trunk, deformer, p, points), motions).value.reshape(rings.shape)
    middles = posed.mean(axis=1)
    radii = np.linalg.norm(posed - middles[:, None], axis=2).ravel()
    assert height == ys[-1] - ys[0]
    return np.array(volume(posed)), radii


def volume(rings: Floats) -> float:
    """Volume (m^3) of a closed tube of rings (R, A, 3)."""
    total, ends = 0.0, (rings[0].mean(axis=0), rings[-1].mean(axis=0))
    after = np.roll(rings, -1, axis=1)
    corners = [(rings[:-1], after[1:], after[:-1]), (rings[:-1], rings[1:], after[1:])]
    corners += [
        (np.broadcast_to(ends[0], rings[0].shape), rings[0], after[0]),
        (np.broadcast_to(ends[1], rings[0].shape), after[-1], rings[-1]),
    ]
    for a, b, c in corners:
        total += float(np.einsum("...i,...i->...", np.cross(a, b), c).sum()) / 6.0
    return abs(total)


@pytest.mark.parametrize(("bend", "twist"), [(0.0, 0.8), (0.6, 0.0), (1.0, 0.5)])
def test_a_round_trunk_keeps_its_sections_and_nearly_its_volume(bend: float, twist: float) -> None:
    rest, radii = belly(0.0, 0.0)
    posed, bent_radii = belly(bend, twist)
    np.testing.assert_allclose(bent_radii, radii, atol=1e-12)
    assert abs(float(posed / rest) - 1.0) < 0.01


def test_where_no_curve_leads_from_bone_to_bone_there_is_none() -> None:
    some = anatomy()
    astray = replace(CURVE, bones=("upper", "palm"))
    with pytest.raises(AnatomyError, match="deformer belly: no curve leads from upper to palm"):
        make_body(replace(some, deformers=(some.deformers[0], astray, some.deformers[2])))


def test_skin_of_the_rest_pose_stays_though_the_curve_is_bent_there() -> None:
    some = body()
    assert np.abs([c.rest for c in some.anatomy.coordinates if c.name in ("bend", "lean", "turn")]).min() > 0.2
    np.testing.assert_allclose(pose_skin(some, rest_theta(some)), some.v_tilde.value, atol=1e-12)
