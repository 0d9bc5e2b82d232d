"""The building blocks of the whole body: pockets filled, depths looked up, sides mirrored, stages kept."""

import igl
import numpy as np
import pytest

from adapt.anatomy import Coordinate, Frame, Joint
from adapt.template_builder.body_rest import RADII, blade_at_rest
from adapt.template_builder.body_skin import Finer, both_halves, other_side, stretched, unstretched
from adapt.template_builder.body_trunk import CERVICAL, load_trunk
from adapt.template_builder.deformer_cores import convex_hull
from adapt.template_builder.depth_grid import depth_grid
from adapt.template_builder.meshes import Mesh, joined, parts_of
from adapt.template_builder.pockets import border_loops, without_pockets
from adapt.template_builder.pose_bones import Placement
from adapt.template_builder.skin import Cut, cut_off
from adapt.template_builder.sources_makehuman import SourceSkin
from adapt.template_builder.stages import Stages
from adapt.template_builder.tetrahedra import evaluate, on_grid
from adapt.template_builder.two_sides import left_name, with_left_coordinates, with_left_joints
from capture.rigid import exp_so3


def ball(radius, centre=(0.0, 0.0, 0.0)):
    """A sphere of triangles."""
    rng = np.random.default_rng(1)
    points = rng.normal(size=(1500, 3))
    hull = convex_hull(radius * points / np.linalg.norm(points, axis=1, keepdims=True))
    return Mesh(hull.vertices + np.asarray(centre), hull.faces)


def bottle():
    """A ball of 60 mm with a hollow of 30 mm inside, open to the outside by a channel 8 mm wide."""
    spacing = 0.002
    axis = np.arange(-0.07, 0.0701, spacing)
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).transpose(2, 1, 0, 3).reshape(-1, 3)
    x, y, z = points.T
    reach = np.linalg.norm(points, axis=1)
    channel = np.where(y > 0.0, np.hypot(x, z) - 0.004, 1.0)
    outside = np.maximum(reach - 0.060, np.maximum(0.030 - reach, -channel))
    vertices, faces, *_ = igl.marching_cubes(outside, points, *(len(axis),) * 3, 0.0)
    mesh = Mesh(np.asarray(vertices), np.asarray(faces, dtype=np.int64))
    return mesh if mesh.volume() > 0.0 else Mesh(mesh.vertices, mesh.faces[:, ::-1].copy())


def test_a_pocket_behind_a_narrow_mouth_is_filled_and_the_mesh_closed_again():
    open_to_outside = bottle()
    assert open_to_outside.depth(np.zeros((1, 3)))[0] < 0.0
    filled = without_pockets(open_to_outside, np.full(3, -0.09), np.full(3, 0.11))
    assert filled.is_closed()
    assert len(parts_of(filled)) == 1
    assert filled.depth(np.zeros((1, 3)))[0] > 0.05
    hollow = 4.0 / 3.0 * np.pi * 0.030**3
    assert filled.volume() - open_to_outside.volume() == pytest.approx(hollow, rel=0.15)


def test_a_mesh_without_pockets_stays_as_it_is():
    whole = ball(0.05)
    assert without_pockets(whole, np.full(3, -0.08), np.full(3, 0.08)) is whole


def test_borders_that_meet_in_a_vertex_are_two():
    around = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5], [0, 5, 6], [0, 6, 1]])
    two_fans = np.delete(around, [0, 3], axis=0)  # they share vertex 0 alone
    assert sorted(len(loop) for loop in border_loops(two_fans)) == [4, 4]


def test_depths_looked_up_are_the_exact_ones_near_the_surface_of_both_halves():
    surface = ball(0.06)
    half = convex_hull(np.concatenate([surface.vertices, surface.vertices * [1.0, 1.0, -1.0]]))
    look_up = depth_grid(half, halved=True)
    points = np.random.default_rng(2).normal(0.0, 0.04, (3000, 3))
    points = points[np.abs(np.linalg.norm(points, axis=1) - 0.06) < 0.02]
    np.testing.assert_allclose(look_up(points), half.depth(points), atol=2e-4)


def test_both_halves_are_closed_and_each_other_s_images():
    right = cut_off(ball(0.05), Cut((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), np.array([0.0, 0.0, 0.05]))
    whole = both_halves(right)
    assert whole.is_closed()
    assert whole.volume() == pytest.approx(ball(0.05).volume(), rel=0.01)
    np.testing.assert_array_equal(whole.vertices[other_side(whole.vertices)] * [1.0, 1.0, -1.0], whole.vertices)


def test_what_was_stretched_is_brought_back():
    joints = {
        "r-hand": np.array([0.2, 0.2, 0.5]),
        "r-finger": np.array([0.3, 0.2, 0.54]),
        "neck": np.array([0.0, 1.0, 0.0]),
    }
    rig = SourceSkin("", np.zeros((0, 3)), np.zeros((0, 4)), joints | {"top": np.array([0.0, 1.3, 0.0])})
    finer = (Finer("r-hand", "r-finger", 1.9, (-0.02, 0.03)), Finer("neck", "top", 1.3, (0.0, 0.06)))
    points = np.random.default_rng(3).uniform(-0.1, 0.1, (4000, 3)) + np.array([0.22, 0.2, 0.5])
    large = stretched(points, rig, finer)
    assert np.abs(large - points).max() > 0.05
    np.testing.assert_allclose(unstretched(large, rig, finer), points, atol=1e-9)


def test_left_parts_are_named_and_turned_as_images_of_the_right_ones():
    hip = Joint("hip_r", "hinge", "pelvis", "femur_r", ("hip_flexion_r",), (("hip_in_r", "hip_out_r"),), ("HJC_r",))
    right, left = with_left_joints((hip,))
    assert right is hip
    assert left.axes == (("hip_out_l", "hip_in_l"),)
    assert left.parent == "pelvis"
    assert left.child == "femur_l"
    angle = Coordinate("hip_flexion_r", "rad", -0.5, 2.0, 0.1)
    assert with_left_coordinates((angle,), (hip,))[1] == Coordinate("hip_flexion_l", "rad", -0.5, 2.0, 0.1)
    assert left_name(left_name("femur_r")) == "femur_r"
    assert left_name("vertex") == "vertex"


def test_spine_coordinates_have_no_image():
    frame = Frame(("a",), ("a",), ("b",), ("c_l",), ("c_r",))
    curve = Joint("neck", "curve", "thorax", "head", ("bend", "nod", "twist"), (), ("a",), frames=(frame,))
    assert with_left_joints((curve,)) == (curve,)


def test_a_blade_s_rest_values_put_its_joint_on_the_ellipsoid_they_are_told_in():
    thorax = Placement(exp_so3(np.array([0.0, 0.0, -0.1])), np.array([0.1, 0.3, 0.0]), np.array([0.9, 0.95, 1.0]))
    scapula = Placement(exp_so3(np.array([0.1, -0.3, 0.2])), np.array([0.0, 0.6, 0.17]), np.ones(3))
    (abduction, elevation, upward), ends = blade_at_rest(thorax, scapula)
    turn = (
        exp_so3(abduction * np.array([0.0, 1.0, 0.0]))
        @ exp_so3(-elevation * np.array([1.0, 0.0, 0.0]))
        @ exp_so3(upward * np.array([0.0, 0.0, 1.0]))
    )
    reached = ends["ellipsoid_centre"] + thorax.rotation @ (RADII * thorax.scale * turn[:, 2])
    np.testing.assert_allclose(reached, scapula.points(np.array([-0.0598196, -0.0390416, -0.0559802])), atol=1e-12)
    assert np.linalg.norm(ends["ellipsoid_top"] - ends["ellipsoid_centre"]) == pytest.approx(0.95 * RADII[1])


def test_stages_are_made_once_and_again_when_what_they_depend_on_changes(tmp_path):
    made = []
    stages = Stages(tmp_path / "kept")
    for of in ((np.zeros(3),), (np.zeros(3),), (np.ones(3),)):
        assert stages.kept("sum", of, lambda of=of: made.append(of) or float(of[0].sum())) == of[0].sum()
    assert len(made) == 2
    Stages(None).kept("sum", (np.ones(3),), lambda: made.append(None))
    assert len(made) == 3


def test_the_trunk_has_no_relief_on_its_breastbone_and_a_neck_of_seven_vertebrae():
    pytest.importorskip("myo_sim")
    skeleton = load_trunk()
    thorax = skeleton.bodies["thorax"]
    parts = parts_of(Mesh(thorax.vertices, thorax.faces))
    assert len(parts) == 37
    assert all(part.is_closed() for part in parts)
    assert max(len(part.vertices) for part in parts) == 723
    heights = [skeleton.bodies[name].vertices[:, 1].mean() for name in CERVICAL]
    assert len(heights) == 7
    assert all(len(skeleton.bodies[name].vertices) >= 142 for name in CERVICAL)
    assert joined(parts).volume() > 5e-4


def test_tetrahedra_on_a_grid_hold_the_surface_are_positive_and_come_out_the_same():
    surface = ball(0.06)
    mesh = on_grid(surface, edge=0.015)
    assert mesh.volumes().min() > 0.0
    assert mesh.volumes() == pytest.approx(0.015**3 / 6.0)
    np.testing.assert_array_equal(mesh.points, on_grid(surface, edge=0.015).points)
    reached = evaluate(mesh, mesh.points, surface.vertices)  # the places themselves, interpolated: exact inside
    np.testing.assert_allclose(reached, surface.vertices, atol=1e-9)
