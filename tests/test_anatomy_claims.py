"""What the shipped right upper limb is claimed to do (docs/model.md), held against measured numbers with a margin."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from adapt.anatomy import Anatomy
from adapt.anatomy_file import load_anatomy
from adapt.model.body import Body, make_body, pose_skin, posed_bones, rest_theta
from track.evaluation.bones import (
    FIGURE_7,
    Proportions,
    depth_inside,
    drift,
    grid,
    heads,
    joint_poses,
    overlap,
    pose,
    similarity_residual,
)
from track.evaluation.sections import Sections, sections
from track.evaluation.skinning import bone_weights, bound_to, dual_quaternions, forearm_line, linear_blending

LEVELS = np.linspace(0.10, 0.95, 18)
TWISTS = (-90.0, -45.0, 0.0, 45.0, 90.0)
WHOLE_TWIST = (90.0, -90.0)  # 180 degrees, from full pronation to full supination


@pytest.fixture(scope="module")
def anatomy() -> Anatomy:
    return load_anatomy("upper-limb-right")


@pytest.fixture(scope="module")
def body(anatomy: Anatomy) -> Body:
    return make_body(anatomy)


def forearm_sections(body: Body, skin: np.ndarray, theta: np.ndarray) -> Sections:
    return sections(skin, body.anatomy.skin_faces, *forearm_line(body, theta), LEVELS)


def blended_over_the_whole_twist(body: Body, method) -> Sections:  # type: ignore[no-untyped-def]
    bound, theta = (pose(body, pro_sup=angle) for angle in WHOLE_TWIST)
    skin = method(pose_skin(body, bound), bone_weights(body), bound_to(body, bound, theta))
    return forearm_sections(body, skin, theta)


@pytest.mark.parametrize("angle", TWISTS)
def test_a_twist_keeps_every_section_and_the_volume_of_the_forearm(body: Body, angle: float) -> None:
    rest = forearm_sections(body, body.v_tilde.value, rest_theta(body))
    theta = pose(body, pro_sup=angle)
    posed = forearm_sections(body, pose_skin(body, theta), theta)
    np.testing.assert_allclose(posed.areas / rest.areas, 1.0, atol=0.04)
    assert posed.volume() / rest.volume() == pytest.approx(1.0, abs=0.02)


def test_linear_blending_collapses_in_the_same_twist(body: Body) -> None:
    rest = forearm_sections(body, body.v_tilde.value, rest_theta(body))
    posed = blended_over_the_whole_twist(body, linear_blending)
    assert (posed.areas / rest.areas).min() < 0.05
    assert posed.volume() / rest.volume() < 0.4


def test_dual_quaternions_bend_the_forearm_where_the_deformer_does_not(body: Body) -> None:
    rest = forearm_sections(body, body.v_tilde.value, rest_theta(body)).bow().max()
    theta = pose(body, pro_sup=WHOLE_TWIST[1])
    ours = forearm_sections(body, pose_skin(body, theta), theta).bow().max()
    assert ours < rest + 0.002
    assert blended_over_the_whole_twist(body, dual_quaternions).bow().max() > rest + 0.004


def test_the_comparators_are_exact_where_all_bones_move_as_one(body: Body) -> None:
    turn = np.eye(4)
    turn[:3, :3], turn[:3, 3] = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], (0.1, 0.2, 0.3)
    rest, weights = body.v_tilde.value, bone_weights(body)
    transforms = np.tile(turn, (weights.shape[1], 1, 1))
    for method in (linear_blending, dual_quaternions):
        np.testing.assert_allclose(method(rest, weights, transforms), rest @ turn[:3, :3].T + turn[:3, 3], atol=1e-6)


def test_sections_of_a_slanted_box_have_its_area() -> None:
    corners = np.array(list(product((0.0, 1.0), (0.0, 2.0), (0.0, 5.0))))
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    corners[:, 0] += 0.3 * corners[:, 2]  # a shear keeps the sections' area and moves their middle
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    cut = sections(corners, faces, np.zeros(3), np.array([0.0, 0.0, 5.0]), np.array([0.2, 0.5, 0.7]))
    np.testing.assert_allclose(cut.areas, 2.0)
    np.testing.assert_allclose(cut.middles, [[0.5 + 0.3 * z, 1.0, z] for z in (1.0, 2.5, 3.5)])


def outside(body: Body, degrees: dict[str, float]) -> dict[str, float]:
    """Bones with a vertex more than 0.2 mm outside the skin in a pose, and by how many mm."""
    theta = pose(body, **degrees)
    skin = pose_skin(body, theta)
    depths = {
        name: 1000.0 * float(depth_inside(vertices, skin, body.anatomy.skin_faces).min())
        for name, vertices in posed_bones(body, theta).items()
    }
    return {name: depth for name, depth in depths.items() if depth <= -0.2}


def test_no_bone_leaves_the_skin_when_elbow_and_forearm_move(body: Body) -> None:
    poses = grid(elbow_flexion=(0.0, 90.0, 130.0), pro_sup=(-90.0, 0.0, 90.0))
    assert {str(degrees): out for degrees in poses if (out := outside(body, degrees))} == {}


def test_no_bone_leaves_the_skin_when_forearm_and_wrist_move(body: Body) -> None:
    poses = grid(pro_sup=(-90.0, -45.0, 90.0), deviation=(-10.0, 25.0), flexion=(-70.0, 70.0))
    assert {str(degrees): out for degrees in poses if (out := outside(body, degrees))} == {}


def test_a_bone_that_leaves_the_skin_is_seen(body: Body) -> None:
    theta = rest_theta(body)
    bone = posed_bones(body, theta)["ulna"] + [0.0, 0.03, 0.0]
    assert depth_inside(bone, pose_skin(body, theta), body.anatomy.skin_faces).min() < -0.005


@pytest.mark.parametrize(
    ("first", "second", "ranges"),
    [
        ("humerus", "ulna", {"elbow_flexion": (0.0, 65.0, 130.0)}),
        ("humerus", "radius", {"elbow_flexion": (0.0, 65.0, 130.0), "pro_sup": (-90.0, 90.0)}),
        ("ulna", "radius", {"pro_sup": (-90.0, -15.0, 90.0)}),
        ("radius", "hand", {"deviation": (-10.0, 25.0), "flexion": (-70.0, 0.0, 70.0)}),
        ("ulna", "hand", {"pro_sup": (-90.0, 90.0), "deviation": (-10.0, 25.0), "flexion": (-70.0, 70.0)}),
    ],
)
def test_neighbouring_bones_stand_no_deeper_in_each_other_than_2_mm(
    body: Body, first: str, second: str, ranges: dict[str, tuple[float, ...]]
) -> None:
    faces = {bone.name: bone.faces for bone in body.anatomy.bones}
    for degrees in grid(**ranges):
        posed = posed_bones(body, pose(body, **degrees))
        assert overlap((posed[first], faces[first]), (posed[second], faces[second])) < 0.0021, degrees


@pytest.mark.parametrize("kind", FIGURE_7, ids=lambda kind: kind.name)
def test_heads_of_bones_keep_their_shape_in_bodies_of_other_proportions(anatomy: Anatomy, kind: Proportions) -> None:
    template, other = make_body(anatomy), kind.body(anatomy)
    for name, (bone, index) in heads(anatomy).items():
        left, scale = similarity_residual(template.rest_bones[bone][index], other.rest_bones[bone][index])
        # Carpus and knuckles are several small bones each, not one head.
        assert left < (0.0025 if name.startswith("hand") else 0.0015), name
        assert scale == pytest.approx(kind.scale, abs=0.02), name


@pytest.mark.parametrize("kind", FIGURE_7, ids=lambda kind: kind.name)
def test_joints_of_bodies_of_other_proportions_move_as_the_templates_do(anatomy: Anatomy, kind: Proportions) -> None:
    template, other = make_body(anatomy), kind.body(anatomy)
    for joint in anatomy.joints:
        if joint.parent is not None:
            poses = joint_poses(other, joint, steps=3)
            assert drift(template, other, joint, poses, scale=kind.scale) < 0.001, joint.name


def test_a_joint_whose_bones_do_not_scale_together_is_seen_to_drift(anatomy: Anatomy) -> None:
    template, longer = make_body(anatomy), FIGURE_7[0].body(anatomy)
    elbow = anatomy.joint("elbow")
    assert drift(template, longer, elbow, [rest_theta(longer)], scale=1.5) > 0.001
