"""The curve: an arc of constant length from base to top, right up to half a turn, and what rides on a share of it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad_vec

from adapt.anatomy import Floats
from adapt.model.compiled.reach import arc
from adapt.model.derivatives import Motion, constant_points
from adapt.model.frames import landmark_mean
from adapt.model.joints import JOINT_TYPES, joint_motion
from adapt.model.joints.curve import Curve
from adapt.model.parts import refuse_wrong_parts
from adapt.model.pose_space import joint_index
from capture.errors import AnatomyError
from capture.rigid import exp_so3, transform
from tests.finite_differences import check_jacobian
from tests.test_joint_types import UPRIGHT, constant_curvature, example
from tests.test_model import check_motion, seeded
from tests.toy_leg import with_joint
from track.evaluation import opensim_tools

BENDS = [(0.3, -0.5, 0.2), (0.0, 1.4, 0.4), (0.9, 0.8, -0.7), (-1.2, 0.3, 1.0)]
FAR = [(0.0, 2.0, 0.3), (2.5, 0.0, -0.4), (1.9, 0.4, 0.2), (0.0, 3.0, 0.0)]  # more than a quarter of a turn
NEAR = [(0.0, 0.0, 0.0), (1e-9, 0.0, 0.5), (1e-4, -2e-4, 0.1), (7e-4, 7e-4, 0.0), (0.0071, 0.0071, 0.3)]


class Toy:
    """A curve in the toy leg, its coordinates at rest, and the frame and length that its landmarks give."""

    def __init__(self) -> None:
        self.anatomy, self.joint = example("curve")
        curve = JOINT_TYPES[self.joint.type]
        assert isinstance(curve, Curve)
        self.curve, self.p = curve, constant_points(self.anatomy.landmarks, 3)
        self.rest = np.array([self.anatomy.coordinates[i].rest for i in joint_index(self.anatomy, self.joint)])
        self.frame = curve.frame(self.anatomy, self.joint, self.p).matrix()
        self.base, self.top = (landmark_mean(self.anatomy, self.p, names)[0] for names in (("low",), ("high",)))

    def at(self, q: Floats, share: float) -> Floats:
        """[R(s), t(s)] (4, 4)."""
        return self.curve.placed_at(self.anatomy, self.joint, q, self.p, (), share).matrix()

    @property
    def length(self) -> float:
        """m."""
        return float(self.at(np.zeros(3), 1.0)[1, 3])


@pytest.fixture(scope="module")
def toy() -> Toy:
    return Toy()


def test_at_rest_the_curve_runs_from_the_base_to_the_top(toy: Toy) -> None:
    np.testing.assert_allclose(toy.frame[:3, 3], toy.base, atol=1e-12)
    np.testing.assert_allclose((toy.frame @ toy.at(toy.rest, 1.0))[:3, 3], toy.top, atol=1e-12)
    assert toy.length > np.linalg.norm(toy.top - toy.base)  # it is bent


@pytest.mark.parametrize("q", [*BENDS, *FAR])
def test_it_is_the_integral_of_a_tangent_that_turns_evenly(toy: Toy, q: tuple[float, ...]) -> None:
    end = toy.at(np.array(q), 1.0)
    across = np.array([end[0, 1], 0.0, end[2, 1]])
    sine = float(np.linalg.norm(across))
    angle = float(np.arctan2(sine, end[1, 1]))
    up, side = np.eye(3)[1], across / sine
    for share in (0.3, 1.0):
        path, _ = quad_vec(lambda s: np.cos(s * angle) * up + np.sin(s * angle) * side, 0.0, share)
        there = toy.at(np.array(q), share)
        np.testing.assert_allclose(there[:3, 3], toy.length * path, atol=1e-12)
        tangent = np.cos(share * angle) * up + np.sin(share * angle) * side
        np.testing.assert_allclose(there[:3, 1], tangent, atol=1e-12)


@pytest.mark.parametrize("q", [*NEAR, *BENDS, *FAR])
def test_its_top_turns_by_its_angles_and_its_base_stays(toy: Toy, q: tuple[float, ...]) -> None:
    x, z, y = (exp_so3(value * axis) for value, axis in zip(q, np.eye(3)[[0, 2, 1]], strict=True))
    np.testing.assert_allclose(toy.at(np.array(q), 1.0)[:3, :3], x @ z @ y, atol=1e-14)
    np.testing.assert_allclose(toy.at(np.array(q), 0.0), np.eye(4), atol=1e-14)


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("q", [*NEAR, *BENDS, *FAR])
def test_what_rides_on_a_share_varies_as_stated(toy: Toy, q: tuple[float, ...], share: float) -> None:
    used = np.array([toy.anatomy.landmark_index(name) for name in toy.joint.landmarks()])

    def motion(x: Floats) -> Motion:
        landmarks = toy.anatomy.landmarks.copy()
        landmarks[used] = x[3:].reshape(-1, 3)
        p = seeded(landmarks, spare=3)
        whole = toy.curve.along(toy.anatomy, toy.joint, x[:3], p, [0, 1, 2], share)
        columns = [0, 1, 2, *(3 + 3 * k + c for k in used for c in range(3))]
        return Motion(whole.rotation, whole.translation, whole.d_rotation[:, columns], whole.d_translation[:, columns])

    check_motion(motion, np.r_[q, toy.anatomy.landmarks[used].ravel()])


def test_what_rides_on_the_whole_goes_with_the_child_and_on_nothing_stays(toy: Toy) -> None:
    theta, index = np.zeros(len(toy.anatomy.coordinates)), joint_index(toy.anatomy, toy.joint)
    theta[index] = BENDS[2]
    child = joint_motion(toy.anatomy, toy.joint, theta, constant_points(toy.anatomy.landmarks, len(theta)), 0)
    for share, expected in ((0.0, np.eye(4)), (1.0, child.matrix())):
        ridden = toy.curve.along(toy.anatomy, toy.joint, theta[index], toy.p, [0, 1, 2], share)
        np.testing.assert_allclose(ridden.matrix(), expected, atol=1e-13)
    at_rest = toy.curve.along(toy.anatomy, toy.joint, toy.rest, toy.p, [0, 1, 2], 0.4)
    np.testing.assert_allclose(at_rest.matrix(), np.eye(4), atol=1e-14)


@pytest.mark.parametrize("q", [*NEAR, *BENDS, *FAR])
def test_the_compiled_arc_ends_where_the_curve_does_and_varies_alike(toy: Toy, q: tuple[float, ...]) -> None:
    def end(at: Floats) -> Floats:
        w = at.copy()
        arc(w, np.zeros((3, 3)))
        return w

    d = np.zeros((3, 3))
    arc(np.array(q), d)
    np.testing.assert_allclose(toy.length * end(np.array(q)), toy.at(np.array(q), 1.0)[:3, 3], atol=1e-15)
    check_jacobian(end, d, np.array(q))


def test_a_frame_that_does_not_start_at_the_base_is_refused(toy: Toy) -> None:
    beside = type(UPRIGHT)(("medial",), UPRIGHT.y_from, UPRIGHT.y_to, UPRIGHT.z_from, UPRIGHT.z_to)
    for frames, message in (((beside,), "runs from its origin"), ((), "one frame"), ((UPRIGHT, UPRIGHT), "one frame")):
        with pytest.raises(AnatomyError, match=message):
            refuse_wrong_parts(with_joint(toy.anatomy, toy.joint, frames=frames))


@pytest.mark.parametrize("q", [*NEAR, *BENDS, *FAR])
def test_opensims_own_joint_is_the_same_but_where_it_jumps(toy: Toy, q: tuple[float, ...]) -> None:
    """OpenSim 4.6 takes a curve for a straight line below 0.001 rad, and from 1.526 rad on: see docs/opensim.md."""
    pytest.importorskip("opensim", reason="OpenSim is not installed: pip install bonetrack[opensim]")
    module = opensim_tools.opensim()
    model, child = module.Model(), module.Body("child", 1.0, module.Vec3(0.0), module.Inertia(1.0))
    model.addBody(child)
    joint = module.ConstantCurvatureJoint("curve", model.getGround(), child, module.Vec3(0.0), toy.length)
    model.addJoint(joint)
    state = model.initSystem()
    for coordinate, value in zip(model.getCoordinateSet(), q, strict=True):
        coordinate.setValue(state, value, False)
    model.realizePosition(state)
    there = child.getTransformInGround(state)
    turn = np.array([[there.R().get(i, j) for j in range(3)] for i in range(3)])
    found = transform(turn, np.array([there.p().get(i) for i in range(3)]))
    ours = toy.at(np.array(q), 1.0)
    bend = float(np.arccos(np.clip(ours[1, 1], -1.0, 1.0)))
    if 0.001 < bend < 1.5:
        np.testing.assert_allclose(found, ours, atol=1e-9)
        np.testing.assert_allclose(constant_curvature(np.array(q), toy.length), ours, atol=1e-12)
    elif bend > 1e-6:
        assert np.abs(found - ours).max() > 0.2 * min(bend, 1.0) * toy.length
