"""The shipped right leg is a right leg: its proportions, its signs, its skin in motion."""

import numpy as np
import pytest

from adapt.anatomy_file import load_anatomy
from adapt.model.body import bone_transforms, joint_centres, make_body, pose_skin, posed_bones, rest_theta
from adapt.model.shape.handle_space import affine_set
from adapt.model.shape.prior import shape_prior
from adapt.template_builder.joint_accuracy import compare_with_table
from adapt.template_builder.knee import PATELLAR_FACETS, PATELLOFEMORAL, PLATEAU, WALKER_KNEE
from adapt.template_builder.lower_limb import LOWER_LIMB_RIGHT
from adapt.template_builder.meshes import Mesh
from adapt.template_builder.pose_bones import ROOT, PoseProblem, placed_bodies
from adapt.template_builder.skin import Cut, evened, height_in
from adapt.template_builder.sources_myosim import Follow, Piece, SourceBody, SourceHinge, SourceSkeleton, in_pieces
from capture.rigid import apply, exp_so3, transform
from tests.test_template import sphere
from track.evaluation.made_up_motions import motion_names, perform


@pytest.fixture(scope="module")
def leg():
    return load_anatomy("lower-limb-right")


@pytest.fixture(scope="module")
def body(leg):
    return make_body(leg)


def point(leg, name):
    return leg.landmarks[leg.landmark_index(name)]


def posed(body, **degrees):
    theta = rest_theta(body)
    for name, angle in degrees.items():
        theta[body.anatomy.coordinate_index(name)] = np.radians(angle)
    return theta


def test_it_is_a_right_leg_with_the_fibula_and_the_little_toe_outside(leg):
    for inner, outer in (("FME", "FLE"), ("MM", "LM"), ("toe1_tip", "toe5_tip"), ("pubis", "ASIS")):
        assert point(leg, inner)[2] < point(leg, outer)[2], (inner, outer)
    assert point(leg, "toe1_tip")[0] > point(leg, "heel")[0] + 0.2
    assert point(leg, "patella_base")[0] > point(leg, "knee")[0] + 0.03


def test_the_leg_has_a_mans_proportions(leg):
    ankle = (point(leg, "MM") + point(leg, "LM")) / 2.0
    # Shares of the stature: Drillis & Contini (1966).
    assert np.linalg.norm(point(leg, "HJC") - point(leg, "knee")) == pytest.approx(
        0.245 * LOWER_LIMB_RIGHT.skin.stature, rel=0.03
    )
    assert np.linalg.norm(point(leg, "knee") - ankle) == pytest.approx(0.246 * LOWER_LIMB_RIGHT.skin.stature, rel=0.03)
    assert 0.07 < np.linalg.norm(point(leg, "FME") - point(leg, "FLE")) < 0.09
    assert 0.21 < np.linalg.norm(point(leg, "heel") - point(leg, "toe1_tip")) < 0.27


@pytest.mark.parametrize(
    ("coordinate", "bone", "moving", "towards"),
    [
        ("hip_flexion_r", "femur", "FME", (1.0, 0.0, 0.0)),
        ("hip_adduction_r", "femur", "FME", (0.0, 0.0, -1.0)),
        ("hip_rotation_r", "femur", "patella_base", (0.0, 0.0, -1.0)),
        ("knee_angle_r", "tibia", "MM", (-1.0, 0.0, 0.0)),
        ("ankle_angle_r", "foot", "toe1_tip", (0.0, 1.0, 0.0)),
    ],
)
def test_positive_coordinates_turn_as_opensims_do(body, coordinate, bone, moving, towards):
    """Hip flexion lifts the knee forward, rotation is inward, the knee bends the shank back, the ankle lifts toes."""
    leg = body.anatomy
    theta = rest_theta(body)
    theta[leg.coordinate_index(coordinate)] += 0.1
    moved = apply(bone_transforms(body, theta)[bone], point(leg, moving)[None])[0] - point(leg, moving)
    assert moved @ np.array(towards) > 0.7 * np.linalg.norm(moved) > 0.0


@pytest.mark.parametrize(
    ("joint", "table", "guides"),
    [("knee", WALKER_KNEE, PLATEAU), ("patellofemoral", PATELLOFEMORAL, PATELLAR_FACETS)],
)
def test_knee_and_kneecap_follow_the_published_tables(leg, joint, table, guides):
    compared = compare_with_table(leg, leg.joint(joint), table, guides, np.radians(np.arange(0.0, 121.0, 5.0)))
    assert compared.distance.max() < 0.0015
    assert np.degrees(compared.turn.max()) < 1.5


@pytest.mark.parametrize(
    "degrees",
    [
        {"knee_angle_r": 0.0},
        {"knee_angle_r": 60.0},
        {"knee_angle_r": 90.0},
        {"knee_angle_r": 120.0},
        {"hip_flexion_r": 90.0},
        {"hip_flexion_r": 120.0, "hip_rotation_r": 40.0},
        {"hip_flexion_r": -30.0, "hip_adduction_r": -50.0},
        {"hip_adduction_r": 30.0},
        {"ankle_angle_r": -40.0},
        {"ankle_angle_r": 30.0},
    ],
    ids=str,
)
def test_no_bone_comes_out_of_the_skin(body, degrees):
    theta = posed(body, **degrees)
    skin = Mesh(pose_skin(body, theta), body.anatomy.skin_faces)
    for name, vertices in posed_bones(body, theta).items():
        assert skin.depth(vertices).min() > -0.00015, name


@pytest.mark.parametrize("flexion", [60.0, 90.0, 120.0])
def test_the_knee_does_not_collapse_in_front_when_it_bends(body, flexion):
    """Skin over the front of the knee keeps its distance from the joint, where a linear blend would lose half."""
    leg = body.anatomy
    centre = joint_centres(body, rest_theta(body))["knee"]
    offset = leg.skin_vertices - centre
    front = (offset[:, 0] > 0.03) & (np.abs(offset[:, 1]) < 0.02) & (np.abs(offset[:, 2]) < 0.03)
    theta = posed(body, knee_angle_r=flexion)
    after = np.linalg.norm(pose_skin(body, theta)[front] - joint_centres(body, theta)["knee"], axis=1)
    assert (after / np.linalg.norm(offset[front], axis=1)).min() > 0.9


def test_a_bone_with_all_its_handles_at_one_joint_is_no_bone_between_joints(leg):
    """The kneecap: what is known of shapes before the data is finite, and grows with no length of its own."""
    affine = affine_set(leg)
    precision = shape_prior(leg, affine).precision
    assert np.isfinite(precision).all()
    assert np.linalg.eigvalsh(precision).min() > 0.0


def test_skin_near_the_cuts_and_on_the_toes_counts_little(leg):
    height = height_in(LOWER_LIMB_RIGHT.skin.cuts, leg.skin_vertices)
    toe, knee = (
        np.argmin(np.linalg.norm(leg.skin_vertices - point(leg, name), axis=1)) for name in ("toe1_tip", "patella_base")
    )
    assert leg.fit_weight[np.abs(height) < 1e-5].max() == 0.0
    assert leg.fit_weight[toe] <= 0.4
    assert leg.fit_weight[knee] == 1.0
    shank_and_thigh = (leg.skin_vertices[:, 1] > -0.7) & (height > 0.051)
    assert leg.fit_weight[shank_and_thigh].min() == 1.0


def test_a_left_legs_coordinates_bear_opensims_names_and_it_moves_as_the_right_one():
    right, left = (load_anatomy(f"lower-limb-{side}") for side in ("right", "left"))
    assert [c.name for c in left.coordinates[6:]] == [c.name[:-2] + "_l" for c in right.coordinates[6:]]
    assert motion_names(left) == motion_names(right) != ()
    thetas = [perform(make_body(leg), motion_names(leg), seconds_each=0.4).thetas[:, 6:] for leg in (right, left)]
    np.testing.assert_array_equal(*thetas)


@pytest.mark.parametrize("motion", ["walk", "squat", "swing-and-turn"])
def test_the_made_up_motions_stay_in_range(body, motion):
    theta = perform(body, (motion,), seconds_each=1.0).thetas[:, 6:]
    low, high = np.array([(c.low, c.high) for c in body.anatomy.coordinates[6:]]).T
    assert (theta >= low - 1e-9).all()
    assert (theta <= high + 1e-9).all()


def test_a_body_taken_apart_keeps_every_part_in_its_place():
    triangle = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0]])
    vertices = np.concatenate([triangle, triangle + np.array([0.0, 0.0, 0.2])])
    faces = np.array([[0, 1, 2], [3, 4, 5]])
    hinge = SourceHinge("lift", np.array([0.0, 0.0, 1.0]), -1.0, 1.0)
    whole = SourceBody("toes", "foot", np.array([1.0, 0.0, 0.0]), np.eye(3), (), vertices, faces)
    pieces = tuple(
        Piece(name, "toes", 2, low, low + 0.2, (0.0, 0.0, low), (hinge,)) for name, low in (("one", -0.1), ("two", 0.1))
    )
    apart = in_pieces(SourceSkeleton("none", {"toes": whole}), pieces)
    assert set(apart.bodies) == {"one", "two"}
    placed = [body.position + body.vertices for body in apart.bodies.values()]
    np.testing.assert_allclose(np.concatenate(placed), vertices + np.array([1.0, 0.0, 0.0]), atol=1e-12)


def test_a_body_that_follows_a_table_keeps_its_anchor_when_scaled_apart_from_its_parent():
    def table(angle):
        return transform(exp_so3(np.array([0.0, 0.0, angle])), np.array([0.0, -1.0, 0.1 * angle]))

    anchor = np.array([0.1, -0.2, 0.0])
    askew = SourceHinge("askew", np.array([1.0, 0.0, 0.0]), -1.0, 1.0)
    nothing = np.zeros((0, 3), dtype=np.int64)
    upper = SourceBody("upper", "world", np.zeros(3), np.eye(3), (), np.zeros((1, 3)), nothing)
    follow = Follow("bend", table, tuple(anchor), (askew,))
    lower = SourceBody("lower", "upper", np.zeros(3), np.eye(3), (), anchor[None], nothing, follow)
    skeleton = SourceSkeleton("none", {"upper": upper, "lower": lower})
    scale_of = {"upper": ("log_a", "log_a", "log_a"), "lower": ("log_x", "log_y", "log_x")}
    values = dict.fromkeys(ROOT, 0.0) | {"bend": 0.7, "askew": 0.2, "log_a": 0.1, "log_x": -0.2, "log_y": 0.3}
    placed = placed_bodies(PoseProblem(skeleton, "upper", scale_of, (), {}, {}), values)
    expected = np.exp(0.1) * apply(table(0.7), anchor[None])[0]
    np.testing.assert_allclose(placed["lower"].points(anchor), expected, atol=1e-12)
    np.testing.assert_allclose(placed["lower"].rotation, table(0.7)[:3, :3] @ exp_so3(np.array([0.2, 0.0, 0.0])))


def test_a_ball_cut_twice_is_closed_by_two_flat_caps():
    cuts = (Cut((0.0, 0.02, 0.0), (0.0, -1.0, 0.0)), Cut((0.0, 0.0, -0.01), (0.0, 0.0, 1.0)))
    part, is_cap = evened(sphere(), cuts, np.array([0.0, -0.05, 0.0]), count=800)
    assert part.is_closed()
    assert height_in(cuts, part.vertices).min() > -1e-9
    np.testing.assert_allclose(height_in(cuts, part.vertices[is_cap]), 0.0, atol=1e-9)
    assert 500 < (~is_cap).sum() < 620  # of 800 on the whole ball right of the second cut, the first leaves 70 per cent
