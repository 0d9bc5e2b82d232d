"""The ellipsoid: a blade whose middle stays on the surface, on either side; and OpenSim's own joint."""

from __future__ import annotations

import numpy as np
import pytest

from adapt.anatomy import Anatomy, Floats, Joint
from adapt.mirror import mirrored
from adapt.model.derivatives import constant_points
from adapt.model.frames import frame_from_landmarks
from adapt.model.joints import JOINT_TYPES
from adapt.model.joints.ellipsoid import Ellipsoid
from capture.rigid import transform
from tests.test_joint_types import REFLECTION, example
from track.evaluation import opensim_tools

POSES = [(0.0, 0.0, 0.0), (-1.31, -0.05, 0.21), (1e-4, 1e-4, 1e-4), (-1.5, 1.0, -0.3), (2.0, 2.0, 2.0)]


def placed(anatomy: Anatomy, joint: Joint, q: Floats) -> Floats:
    """X (4, 4)."""
    ellipsoid = JOINT_TYPES[joint.type]
    assert isinstance(ellipsoid, Ellipsoid)
    return ellipsoid.placed(anatomy, joint, q, constant_points(anatomy.landmarks, 0), ()).matrix()


def sizes(anatomy: Anatomy, joint: Joint) -> Floats:
    """Distances (3,) m of the pairs of landmarks."""
    index = np.array([[anatomy.landmark_index(name) for name in pair] for pair in joint.axes])
    return np.linalg.norm(np.diff(anatomy.landmarks[index], axis=1)[:, 0], axis=1)


def test_the_child_stays_on_the_ellipsoid_and_begins_where_the_third_pair_points() -> None:
    anatomy, joint = example("ellipsoid")
    for q in POSES:
        on_sphere = placed(anatomy, joint, np.array(q))[:3, 3] / sizes(anatomy, joint)
        assert np.linalg.norm(on_sphere) == pytest.approx(1.0, abs=1e-12)
    start = placed(anatomy, joint, np.zeros(3))
    np.testing.assert_allclose(start, transform(np.eye(3), sizes(anatomy, joint) * [0.0, 0.0, 1.0]), atol=1e-12)


def test_a_left_child_has_the_right_ones_coordinates() -> None:
    right, joint = example("ellipsoid")
    left = mirrored(right)
    other = left.joint(joint.name)
    assert JOINT_TYPES[joint.type].turned_over == ()
    for q in POSES:
        there, here = (
            frame_from_landmarks(a, j.frames[0], constant_points(a.landmarks, 0)).matrix() @ placed(a, j, np.array(q))
            for a, j in ((right, joint), (left, other))
        )
        np.testing.assert_allclose(here[:3, 3], (REFLECTION @ there)[:3, 3], atol=1e-12)
        np.testing.assert_allclose(here[:3, :3], -(REFLECTION @ there)[:3, :3], atol=1e-12)


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("q", POSES)
def test_opensims_own_joint_is_the_same(q: tuple[float, ...], side: str) -> None:
    pytest.importorskip("opensim", reason="OpenSim is not installed: pip install bonetrack[opensim]")
    module = opensim_tools.opensim()
    anatomy, joint = example("ellipsoid")
    if side == "left":
        anatomy = mirrored(anatomy)
        joint = anatomy.joint(joint.name)
    radii = (1.0 if side == "right" else -1.0) * sizes(anatomy, joint)
    model, child = module.Model(), module.Body("child", 1.0, module.Vec3(0.0), module.Inertia(1.0))
    model.addBody(child)
    vector, middle = module.Vec3(*map(float, radii)), module.Vec2(0.0)
    model.addJoint(module.ScapulothoracicJoint("blade", model.getGround(), child, vector, middle, 0.0))
    state = model.initSystem()
    for coordinate, value in zip(model.getCoordinateSet(), (*q, 0.0), strict=True):
        coordinate.setValue(state, value, False)
    model.realizePosition(state)
    there = child.getTransformInGround(state)
    turn = np.array([[there.R().get(i, j) for j in range(3)] for i in range(3)])
    found = transform(turn, np.array([there.p().get(i) for i in range(3)]))
    np.testing.assert_allclose(found, placed(anatomy, joint, np.array(q)), atol=1e-12)
