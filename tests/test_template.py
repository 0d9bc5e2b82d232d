"""The shipped templates are sound in every number, the arm is an arm, and building blocks do what they say."""

from dataclasses import replace

import numpy as np
import pytest

from adapt.anatomy_file import former_anatomies, load_anatomy
from adapt.model.body import bone_transforms, make_body, pose_skin, posed_bones, rest_theta
from adapt.template_builder import checks
from adapt.template_builder.__main__ import PLANS
from adapt.template_builder.check import Check, require
from adapt.template_builder.meshes import Mesh, boundary_loop, level_set, simplified
from adapt.template_builder.plan import HeldPart
from adapt.template_builder.pose_bones import ROOT, PoseProblem, Target, Unknown, fit_pose, placed_bodies
from adapt.template_builder.skin import Cut, catmull_clark, closed, cut_off, height_in
from adapt.template_builder.skinning import holders
from adapt.template_builder.sources_myosim import SourceBody, SourceHinge, SourceSkeleton, StatedJoint, restated
from adapt.template_builder.tetrahedra import TetMesh, evaluate, with_corners_at
from adapt.template_builder.upper_limb import UPPER_LIMB_RIGHT
from adapt.template_builder.weights import bounded_biharmonic
from capture.errors import AnatomyError
from capture.rigid import apply

CUBE = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
CUBE_QUADS = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])


@pytest.fixture(scope="module")
def arm():
    return load_anatomy("upper-limb-right")


@pytest.fixture(scope="module")
def body(arm):
    return make_body(arm)


@pytest.fixture(scope="module", params=PLANS)
def limb(request):
    return load_anatomy(request.param)


def point(arm, name):
    return arm.landmarks[arm.landmark_index(name)]


def all_pass(found):
    failed = [check.line() for check in found if not check.passed]
    assert not failed, "\n".join(failed)


def test_surfaces_are_closed_face_outward_and_bones_lie_beneath_the_skin(limb):
    all_pass(checks.surface_checks(limb))


def test_weights_lie_in_the_unit_interval_and_sum_to_one(limb):
    all_pass(checks.weight_checks(limb))


def test_tetrahedra_are_positive(limb):
    all_pass(checks.tetrahedra_checks(limb))


def test_landmarks_handles_and_rest_values_stand_where_they_should(limb):
    all_pass(checks.landmark_checks(limb))


def test_the_bones_of_a_twist_or_a_bend_never_come_near_half_a_turn_apart(limb):
    all_pass(checks.turn_checks(make_body(limb)))


def test_bone_heads_and_landmarks_stay_together_when_proportions_change(limb):
    all_pass(checks.drift_checks(limb))


def least_depth(body, ends):
    """How deep (m) the shallowest vertex of each bone lies at these ends of coordinates' ranges, the others at rest."""
    theta = rest_theta(body)
    for coordinate, end in ends.items():
        index = body.anatomy.coordinate_index(coordinate)
        theta[index] = getattr(body.anatomy.coordinates[index], end)
    skin = Mesh(pose_skin(body, theta), body.anatomy.skin_faces)
    return {name: skin.depth(vertices).min() for name, vertices in posed_bones(body, theta).items()}


@pytest.mark.parametrize("coordinate", ["elbow_flexion", "pro_sup", "flexion", "deviation"])
@pytest.mark.parametrize("end", ["low", "high"])
def test_no_bone_comes_out_of_the_skin_at_the_ends_of_the_range_of_motion(body, coordinate, end):
    assert min(least_depth(body, {coordinate: end}).values()) > 0.0


def test_the_carpus_stays_beneath_the_skin_of_a_wrist_bent_two_ways_at_once_as_it_did_not(body):
    bent = {"deviation": "low", "flexion": "high"}
    *_, former = former_anatomies("upper-limb-right")
    assert least_depth(make_body(former), bent)["hand"] < 0.0 < least_depth(body, bent)["hand"]


def test_the_template_is_what_its_plan_says(limb):
    plan = PLANS[limb.name]
    assert limb.joints == plan.joints
    assert limb.deformers == plan.deformers
    assert [c.name for c in limb.coordinates] == [c.name for c in plan.coordinates]
    assert [h.name for h in limb.handles] == [h.name for h in plan.handles]
    assert 7000 < len(limb.skin_vertices) < 9000
    assert all(1500 <= len(bone.vertices) <= 8000 for bone in limb.bones)


def test_it_is_a_right_arm_with_the_radius_on_the_thumbs_side(arm):
    assert point(arm, "elbow_axis_medial")[2] < point(arm, "elbow_axis_lateral")[2]
    across = point(arm, "RS") - point(arm, "US")
    assert across @ (point(arm, "thumb_tip") - point(arm, "finger5_tip")) > 0.0
    # Chirality: for a right hand, (towards the thumb) x (towards the fingertips) points out of the palm.
    fingers = point(arm, "finger3_tip") - point(arm, "MC3_base")
    palm = np.cross(across, fingers)
    assert palm @ (point(arm, "wrist_deviation_axis_palmar") - point(arm, "wrist_deviation_axis_dorsal")) > 0.0


def about(arm, axis, points):
    """Distances (N,) m along an axis from its first landmark, and how points (N, 3) lie off it (N, 3) m."""
    first, second = (point(arm, name) for name in axis)
    direction = (second - first) / np.linalg.norm(second - first)
    along = (points - first) @ direction
    return along, points - first - np.outer(along, direction)


def test_the_elbow_turns_where_the_trochlea_is_narrowest(arm):
    axis = ("elbow_axis_medial", "elbow_axis_lateral")
    along, off = about(arm, axis, arm.bone("humerus").vertices)
    along -= np.linalg.norm(point(arm, axis[1]) - point(arm, axis[0])) / 2.0
    radius = np.linalg.norm(off, axis=1)
    at = {mm: np.median(radius[(np.abs(along - 1e-3 * mm) < 0.0015) & (radius < 0.013)]) for mm in (-10, 0, 8)}
    assert 0.007 < at[0] < 0.0095
    assert at[0] + 0.001 < min(at[-10], at[8])  # towards the trochlea's inner rim and towards the capitulum


@pytest.mark.parametrize(("bone", "head"), [("radius", "radial_head"), ("ulna", "ulnar_head")])
def test_the_forearm_turns_about_the_middles_of_both_heads(arm, bone, head):
    axis = ("ulnar_head", "radial_head")
    vertices = arm.bone(bone).vertices
    along, off = about(arm, axis, vertices)
    near = np.abs(along - about(arm, axis, point(arm, head)[None])[0]) < 0.004
    across = np.linalg.svd(off - off.mean(axis=0), full_matrices=False)[2][:2]
    ring = off[near] @ across.T
    assert np.linalg.norm(ring.max(axis=0) + ring.min(axis=0)) / 2.0 < 0.0016


def test_the_arm_has_a_mans_proportions(arm):
    elbow = (point(arm, "EM") + point(arm, "EL")) / 2.0
    wrist = (point(arm, "US") + point(arm, "RS")) / 2.0
    assert 0.26 < np.linalg.norm(point(arm, "GH") - elbow) < 0.32
    assert 0.23 < np.linalg.norm(elbow - wrist) < 0.28
    assert 0.050 < np.linalg.norm(point(arm, "EM") - point(arm, "EL")) < 0.070


@pytest.mark.parametrize(
    ("coordinate", "moving", "towards"),
    [
        ("elbow_flexion", "finger3_tip", ("elbow_axis_medial", "GH")),
        ("pro_sup", "thumb_tip", ("EL", "EM")),
        ("flexion", "finger3_tip", ("wrist_deviation_axis_dorsal", "wrist_deviation_axis_palmar")),
        ("deviation", "finger3_tip", ("RS", "US")),
    ],
)
@pytest.mark.parametrize("side", ["right", "left"])
def test_positive_coordinates_turn_as_opensims_do(side, coordinate, moving, towards):
    """Flexion brings the hand to the shoulder, pronation the thumb inward, wrist flexion the fingers palmward."""
    arm = load_anatomy(f"upper-limb-{side}")
    body = make_body(arm)
    theta = rest_theta(body)
    index = arm.coordinate_index(coordinate)
    theta[index] = arm.coordinates[arm.coordinate_index(coordinate)].rest + 0.1
    moved = apply(bone_transforms(body, theta)["hand"], point(arm, moving)[None])[0] - point(arm, moving)
    assert moved @ (point(arm, towards[1]) - point(arm, towards[0])) > 0.0


def test_skin_near_the_cut_and_on_the_fingers_counts_little(arm):
    height = height_in(UPPER_LIMB_RIGHT.skin.cuts, arm.skin_vertices)
    tip = np.argmin(np.linalg.norm(arm.skin_vertices - point(arm, "finger3_tip"), axis=1))
    elbow = np.argmin(np.linalg.norm(arm.skin_vertices - point(arm, "olecranon"), axis=1))
    assert arm.fit_weight[np.abs(height) < 1e-5].max() == 0.0
    assert arm.fit_weight[tip] <= 0.101
    assert arm.fit_weight[elbow] == 1.0


def test_a_failed_check_is_named_with_its_number():
    with pytest.raises(AnatomyError, match=r"arm: .*depth: 1 >= 2 mm"):
        require([Check("depth", 1.0, 2.0, "mm", least=True)], "arm")


def test_catmull_clark_keeps_a_closed_surface_closed_and_smooths_a_cube():
    vertices, quads = catmull_clark(*catmull_clark(CUBE, CUBE_QUADS))
    mesh = Mesh(vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))
    assert mesh.is_closed()
    assert 0.3 < abs(mesh.volume()) < 0.7
    np.testing.assert_allclose(vertices.mean(axis=0), 0.5, atol=1e-12)


def sphere(radius=0.05, spacing=0.004):
    tetrahedron = Mesh(
        np.array([[0.0, 0, 0], [1e-4, 0, 0], [0, 1e-4, 0], [0, 0, 1e-4]]),
        np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
    )
    return level_set([tetrahedron], spacing=spacing, grow=radius)


def test_a_level_set_is_closed_and_faces_outward_at_its_distance():
    ball = sphere()
    assert ball.is_closed()
    assert ball.volume() == pytest.approx(4.0 / 3.0 * np.pi * 0.05**3, rel=0.02)
    np.testing.assert_allclose(np.linalg.norm(ball.vertices, axis=1), 0.05, atol=4e-4)
    assert simplified(ball, count=300).is_closed()


def test_a_cut_ball_is_closed_by_a_flat_cap_on_the_plane():
    cut = Cut((0.0, 0.01, 0.0), (0.0, 1.0, 0.3))
    part, is_cap = closed(cut_off(sphere(), cut, np.array([0.0, 0.05, 0.0])))
    assert part.is_closed()
    assert part.volume() > 0.0
    np.testing.assert_allclose(cut.height(part.vertices[is_cap]), 0.0, atol=1e-12)
    assert cut.height(part.vertices).min() > -1e-12


def test_a_closed_surface_has_no_border():
    with pytest.raises(AnatomyError, match="no border"):
        boundary_loop(sphere().faces)


def block(n=4):
    """A cube of n^3 cells, each of five tetrahedra's six-fold cousin: Kuhn's six."""
    grid = np.stack(np.meshgrid(*[np.arange(n + 1)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) / n
    index = np.arange((n + 1) ** 3).reshape([n + 1] * 3)
    tets = []
    for cell in np.ndindex(n, n, n):
        for order in ((0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)):
            corner, path = np.array(cell), [index[cell]]
            for axis in order:
                corner = corner + np.eye(3, dtype=int)[axis]
                path.append(index[tuple(corner)])
            tets.append(path)
    mesh = TetMesh(grid, np.array(tets))
    flipped = np.where(mesh.volumes()[:, None] < 0.0, mesh.tets[:, [0, 1, 3, 2]], mesh.tets)
    return TetMesh(grid, flipped)


def test_values_linear_in_space_are_interpolated_exactly_and_clamped_outside():
    mesh, points = block(), np.random.default_rng(1).uniform(0.0, 1.0, (200, 3))
    np.testing.assert_allclose(evaluate(mesh, mesh.points, points), points, atol=1e-12)
    np.testing.assert_allclose(evaluate(mesh, mesh.points, np.array([[0.5, 0.5, 1.2]])), [[0.5, 0.5, 1.0]], atol=0.1)


def test_a_corner_moves_onto_a_point_without_inverting_a_tetrahedron():
    wanted = np.array([[0.53, 0.47, 0.55]])
    mesh, corners = with_corners_at(block(), wanted, within=0.2)
    np.testing.assert_array_equal(mesh.points[corners], wanted)
    assert mesh.volumes().min() > 0.0
    with pytest.raises(AnatomyError, match="smaller tets"):
        with_corners_at(block(), wanted + 5.0, within=0.2)


def test_bounded_biharmonic_weights_hold_at_handles_and_rise_between_them():
    mesh = block()
    ends = [np.flatnonzero(mesh.points[:, 0] == end) for end in (0.0, 1.0)]
    weights = bounded_biharmonic(mesh, ends)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(weights[ends[0]], [[1.0, 0.0]] * len(ends[0]), atol=1e-6)
    rising = [weights[np.isclose(mesh.points[:, 0], x), 1].mean() for x in (0.0, 0.25, 0.5, 0.75, 1.0)]
    assert np.all(np.diff(rising) > 0.05)


def test_small_bones_hold_what_lies_around_them_too_but_nothing_of_another_bone():
    small, radius = sphere(0.005, 0.001), sphere(0.02, 0.002)
    inside = {"humerus": Mesh(small.vertices - 1.0, small.faces), "ulna": Mesh(small.vertices + 1.0, small.faces)}
    inside |= {"hand": small, "radius": Mesh(radius.vertices + np.array([0.0, 0.0265, 0.0]), radius.faces)}
    held = HeldPart("hand", "hand", "start", "end", -0.02, around=0.003)
    plan = replace(UPPER_LIMB_RIGHT, held=(held,), cushions=())
    along = {"start": np.zeros(3), "end": np.array([0.0, -1.0, 0.0])}
    points = np.array([[0.0, 0, 0], [0.007, 0, 0], [0.0, -0.009, 0], [0.0, 0.0072, 0]])
    carriers = [plan.deformers[k].name if k >= 0 else "" for k in holders(points, plan, inside, along)]
    assert carriers == ["hand", "hand", "", "forearm"]


def two_bodies():
    stick = np.array([[0.0, 0, 0], [0.0, -1.0, 0]])
    nothing = np.zeros((0, 3), dtype=np.int64)
    upper = SourceBody("upper", "world", np.zeros(3), np.eye(3), (), stick, nothing)
    hinge = SourceHinge("bend", np.array([0.0, 0.0, 1.0]), 0.0, 2.0)
    lower = SourceBody("lower", "upper", np.array([0.0, -1.0, 0.0]), np.eye(3), (hinge,), stick, nothing)
    return SourceSkeleton("none", {"upper": upper, "lower": lower})


def test_the_pose_fit_recovers_a_known_pose_and_scale():
    truth = dict.fromkeys(ROOT, 0.0) | {"root_ry": 0.2, "root_tx": 0.1, "bend": 0.8, "log_size": 0.1}
    unknowns = tuple(Unknown(name, 0.0, 10.0) for name in truth)
    scale_of = dict.fromkeys(("upper", "lower"), ("log_size", "log_size", "log_size"))
    problem = PoseProblem(two_bodies(), "upper", scale_of, unknowns, {}, {})
    placed = placed_bodies(problem, truth)
    spots = [("upper", [0.3, 0, 0]), ("upper", [0, -1.0, 0.2]), ("lower", [0, -1.0, 0]), ("upper", [0.0, 0, 0])]
    targets = tuple(Target(b, np.array(x), placed[b].points(np.array(x)), 1e-3) for b, x in spots)
    found = fit_pose(replace(problem, targets=targets), lambda points: np.ones(len(points)))
    assert {name: pytest.approx(value, abs=1e-3) for name, value in truth.items()} == found


def test_a_joint_that_a_plan_states_replaces_the_sources_and_leaves_the_bone():
    sideways = SourceHinge("bend", np.array([1.0, 0.0, 0.0]), 0.0, 2.0)
    stated = restated(two_bodies(), {"lower": StatedJoint((0.1, -1.0, 0.0), (sideways,))})
    rotation, position = stated.bodies["lower"].in_parent({"bend": np.pi / 2.0})
    np.testing.assert_allclose(position, [0.1, -1.0, 0.0])
    np.testing.assert_allclose(rotation @ [0.0, -1.0, 0.0], [0.0, 0.0, -1.0], atol=1e-12)
    np.testing.assert_array_equal(stated.bodies["lower"].vertices, two_bodies().bodies["lower"].vertices)


def test_no_joint_of_the_arm_is_the_sources():
    """What was released for non-commercial use is not taken: elbow, forearm and wrist are stated, and credited."""
    assert {axis.body for axis in UPPER_LIMB_RIGHT.axes} == set(UPPER_LIMB_RIGHT.stated)
    licences = {licence for _, _, licence in UPPER_LIMB_RIGHT.upstream}
    assert {"CC BY 3.0", "BSD-2-Clause"} <= licences
