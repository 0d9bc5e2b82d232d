"""A first pose from nothing: the limb is found in a cloud, apart from a trunk, and not laid out on a surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import adapt.search.first_pose as start
from adapt.anatomy_file import load_anatomy
from adapt.fit.pose import fit_pose
from adapt.match.correspondences import Target
from adapt.match.skin_sample import sample_skin
from adapt.match.visibility import pixel_of
from adapt.model.body import joint_centres, pose_skin
from adapt.model.surface import vertex_areas
from adapt.search.first_pose import find_pose, locate, try_pose
from adapt.search.limb_segments import slender_parts, thicker_than
from adapt.search.pose_score import find_skin, free_space_share, merged_share, score_pose
from capture.cloud.fuse import Cloud, Region, View, view_points
from capture.errors import FitError
from capture.rigid import exp_so3, log_so3
from capture.simulation.sensor import carmine_camera
from tests.analytic_depth import plane, rays
from tests.known_limb import bent, exact_target

FRAME = 3


@pytest.fixture(scope="module")
def sample(arm):
    return sample_skin(arm, at_most=1500)


@pytest.fixture(scope="module")
def searched(limb):
    """The limb's own body, searched for in one noisy cloud without any hint."""
    return find_pose(limb.subject.body, limb.targets[FRAME])


def farthest_centre_m(limb, theta, frame=FRAME) -> float:
    body = limb.subject.body
    true = joint_centres(body, limb.thetas[frame])
    return max(float(np.linalg.norm(centre - true[name])) for name, centre in joint_centres(body, theta).items())


def test_a_limb_is_found_in_a_cloud_from_nothing(limb, searched):
    assert farthest_centre_m(limb, searched.fit.theta) < 0.006  # measured: 1 to 3 mm
    joints = np.rad2deg(np.abs(searched.fit.theta - limb.thetas[FRAME])[6:])
    assert joints.max() < 5.0, joints  # measured: 1 to 3 degrees
    assert searched.coverage > 0.95
    assert searched.merged_outline < 0.1


def test_the_true_pose_scores_better_than_wrong_ones(limb, searched, sample):
    body, target = limb.subject.body, limb.targets[FRAME]
    for wrong in (turned_about(limb, np.pi), elbow_off(limb, np.deg2rad(40.0))):
        held = fit_pose(body, target, wrong, sample, updates=0)
        assert score_pose(body, target, held, sample).cost_m > 1.5 * searched.cost_m


def test_skin_in_sight_is_found_where_the_pose_is_right_and_not_where_it_is_wrong(limb, searched, sample):
    body, target = limb.subject.body, limb.targets[FRAME]
    found = find_skin(body, target, searched.fit.theta, sample)
    assert list(found.bones) == [bone.name for bone in limb.subject.anatomy.bones]
    for part in (found.whole, *found.bones.values()):
        assert part.in_sight > 0.4, part
        assert part.coverage > 0.95, part
        assert part.skin_m < 0.006, part
    assert found.whole.skin_m < 1.1 * searched.skin_m  # which counts skin that is hidden by other skin, too
    bent_too_far = find_skin(body, target, elbow_off(limb, np.deg2rad(40.0)), sample)
    assert bent_too_far.bones["hand"].coverage < 0.5
    assert bent_too_far.bones["humerus"].coverage > 0.9


def turned_about(limb, angle):
    """The pose with the root turned about the line from shoulder to wrist."""
    theta = limb.thetas[FRAME].copy()
    centres = list(joint_centres(limb.subject.body, theta).values())
    axis = (centres[-1] - centres[0]) / np.linalg.norm(centres[-1] - centres[0])
    turn = exp_so3(angle * axis)
    theta[:3] = log_so3(turn @ exp_so3(theta[:3]))
    theta[3:6] = centres[0] + turn @ (theta[3:6] - centres[0])
    return theta


def elbow_off(limb, angle):
    theta = limb.thetas[FRAME].copy()
    theta[limb.subject.anatomy.coordinate_index("elbow_flexion")] += angle
    return theta


# ---- likely starts


def refuse_to_search(*_, **__):
    raise AssertionError("searched")


def test_a_good_start_is_taken_without_searching(limb, sample, monkeypatch):
    monkeypatch.setattr(start, "find_pose", refuse_to_search)
    near, far = limb.thetas[FRAME] + 0.03, limb.thetas[FRAME] + np.r_[np.zeros(3), np.ones(3), np.zeros(4)]
    found = locate(limb.subject.body, limb.targets[FRAME], sample, [far, near])
    assert farthest_centre_m(limb, found.fit.theta) < 0.006


def test_without_a_good_start_the_limb_is_searched_for(limb, searched, sample, monkeypatch):
    calls = []

    def search(body, target):
        calls.append(target)
        return searched

    monkeypatch.setattr(start, "find_pose", search)
    for starts in ([], [turned_about(limb, np.pi)]):
        found = locate(limb.subject.body, limb.targets[FRAME], sample, starts)
        assert farthest_centre_m(limb, found.fit.theta) < 0.006
    assert len(calls) == 2


def test_a_start_stands_when_the_search_finds_nothing(limb, sample, monkeypatch):
    def search(body, target):
        raise FitError("nothing there")

    monkeypatch.setattr(start, "find_pose", search)
    near = [limb.thetas[FRAME] + 0.03]
    found = locate(limb.subject.body, limb.targets[FRAME], sample, near, good_m=0.0)
    assert farthest_centre_m(limb, found.fit.theta) < 0.006
    with pytest.raises(FitError, match="nothing there"):
        locate(limb.subject.body, limb.targets[FRAME], sample, [])


def test_a_start_far_from_the_cloud_is_no_pose(limb, sample):
    far = limb.thetas[FRAME] + np.r_[np.zeros(3), np.ones(3), np.zeros(4)]
    assert try_pose(limb.subject.body, limb.targets[FRAME], sample, far) is None


# ---- slender parts: a sensor at the origin looks along +Z at boards that face it


def board(camera, depth_m, x_m, y_m):
    """Depth (H, W) of an upright rectangle ``x_m``, ``y_m`` (from, to) at a depth; 0 beside it."""
    at = depth_m * rays(camera)
    inside = (at[..., 0] > x_m[0]) & (at[..., 0] < x_m[1]) & (at[..., 1] > y_m[0]) & (at[..., 1] < y_m[1])
    return np.where(inside, depth_m, 0.0)


def cloud_of(depth) -> Cloud:
    """What the sensor's depth image (H, W) tells."""
    view = View("one", carmine_camera(), np.eye(4), depth.astype(np.float32))
    points, normals, boundary = view_points(view, Region(np.full(3, -5.0), np.full(3, 5.0)), spacing_m=0.0075)
    return Cloud(points, normals, boundary, np.zeros(len(points), np.int64), (view,))


TRUNK = ((-0.20, 0.20), (-0.30, 0.30))
ARM = ((0.18, 0.60), (-0.04, 0.04))
THICKER_M = 0.085


def test_an_arm_is_slender_and_the_trunk_it_hangs_on_is_not():
    camera = carmine_camera()
    cloud = cloud_of(np.maximum(board(camera, 1.4, *TRUNK), board(camera, 1.4, *ARM)))
    largest = slender_parts(cloud, THICKER_M)[0]
    of_trunk = cloud.points[:, 0] < 0.20
    assert of_trunk.mean() > 0.5
    assert (largest.points[:, 0] > 0.19).all()
    assert len(largest.points) > 0.8 * (~of_trunk).sum()
    assert largest.views == cloud.views
    assert (largest.sensor == 0).all()


def test_an_arm_in_front_of_a_trunk_is_slender_too():
    camera = carmine_camera()
    trunk, arm = board(camera, 1.4, *TRUNK), board(camera, 1.2, (-0.15, 0.15), (-0.04, 0.04))
    cloud = cloud_of(np.where(arm > 0.0, arm, trunk))
    largest = slender_parts(cloud, THICKER_M)[0]
    assert (largest.points[:, 2] < 1.3).all()
    assert len(largest.points) > 0.7 * (cloud.points[:, 2] < 1.3).sum()


def test_several_slender_parts_come_largest_first():
    camera = carmine_camera()
    arms = [board(camera, 1.4, ARM[0], ARM[1]), board(camera, 1.4, (-0.45, -0.18), ARM[1])]
    parts = slender_parts(cloud_of(np.maximum(board(camera, 1.4, *TRUNK), np.maximum(*arms))), THICKER_M)
    assert len(parts) == 2
    assert len(parts[0].points) > len(parts[1].points)
    assert (parts[0].points[:, 0] > 0.0).all()
    assert (parts[1].points[:, 0] < 0.0).all()


def test_a_cloud_without_slender_parts_is_taken_whole():
    cloud = cloud_of(board(carmine_camera(), 1.4, *TRUNK))
    assert [len(part.points) for part in slender_parts(cloud, THICKER_M)] == [len(cloud.points)]


@pytest.mark.parametrize(
    ("name", "least_m", "most_m"), [("upper-limb-right", 0.08, 0.09), ("lower-limb-left", 0.14, 0.17)]
)
def test_what_is_too_thick_for_a_limb_follows_from_its_template(name, least_m, most_m):
    """Above an arm's radius in a sleeve and below a trunk's; for a leg above a thigh's."""
    assert least_m < thicker_than(load_anatomy(name)) < most_m


# ---- beyond the images' edges


def lower_part(view: View, rows: int) -> View:
    """What a sensor sees whose image starts ``rows`` farther down."""
    camera = replace(view.camera, height=view.camera.height - rows, cy=view.camera.cy - rows)
    return replace(view, camera=camera, depth=view.depth[rows:])


def test_skin_beyond_the_images_edges_speaks_neither_for_a_pose_nor_against_it(limb, sample):
    body, theta = limb.subject.body, limb.thetas[FRAME]
    whole = exact_target(body, theta).cloud
    rows = [int(np.median(pixel_of(view, whole.points)[0])) for view in whole.views]
    views = tuple(lower_part(view, cut) for view, cut in zip(whole.views, rows, strict=True))
    everywhere = Region(np.full(3, -10.0), np.full(3, 10.0))
    parts = [view_points(view, everywhere, spacing_m=0.0075) for view in views]
    points, normals, boundary = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    cut = Cloud(points, normals, boundary, np.repeat([0, 1], [len(part[0]) for part in parts]), views)
    assert len(cut.points) < 0.7 * len(whole.points)
    held = fit_pose(body, Target(cut), theta, sample, updates=0)
    score = score_pose(body, Target(cut), held, sample)
    assert score.skin_m < 0.006
    assert score.coverage > 0.95


# ---- attachment


def placed(body, theta, sample):
    """One placement's vertices and normals (1, N, 3), and their weights (N,)."""
    skin = pose_skin(body, theta)
    chosen = sample.vertices
    return skin[chosen][None], sample.normals(skin)[chosen][None], sample.observations[chosen]


def test_a_free_limb_is_not_merged(limb, sample):
    body = limb.subject.body
    for elbow in (20.0, 90.0):
        theta = bent(body, elbow, 0.0)
        share = merged_share(exact_target(body, theta).cloud, *placed(body, theta, sample))
        assert share.shape == (1,)
        assert share[0] < 0.05, elbow


@pytest.mark.parametrize(("in_front_m", "least", "most"), [(0.0, 0.9, 1.0), (0.3, 0.0, 0.05)])
def test_a_limb_laid_out_on_a_surface_is_merged_and_one_before_it_is_not(limb, sample, in_front_m, least, most):
    wall = cloud_of(plane(carmine_camera(), np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, 1.4])))
    body = limb.subject.body
    points, normals, weights = placed(body, bent(body, 0.0, 0.0), sample)
    middle = points[0].mean(axis=0)
    flat = np.linalg.svd(points[0] - middle, full_matrices=False)[2]  # the longest axis first, the thinnest along Z
    laid = (points - middle) @ flat.T + [0.0, 0.0, 1.4 - in_front_m]
    assert least <= merged_share(wall, laid, normals @ flat.T, weights)[0] <= most


# ---- empty space


def test_a_limb_where_the_sensors_saw_it_is_not_in_the_void_and_one_beside_it_is(limb):
    """Though a third of its pixels have no reading."""
    skin = pose_skin(limb.subject.body, limb.thetas[FRAME])
    areas = vertex_areas(skin, limb.subject.anatomy.skin_faces)
    placed_there = np.stack([skin, skin + np.array([0.0, 0.15, 0.0])])
    there, beside = free_space_share(limb.targets[FRAME].cloud, placed_there, areas)
    assert there < 0.1
    assert beside > 0.6


@pytest.mark.parametrize(("depth_m", "free_space"), [(1.1, 1.0), (2.2, 0.0)])
def test_a_limb_before_a_wall_is_in_free_space_and_one_hidden_behind_it_is_not(limb, depth_m, free_space):
    wall = cloud_of(board(carmine_camera(), 1.6, (-2.0, 2.0), (-2.0, 2.0)))
    skin = pose_skin(limb.subject.body, bent(limb.subject.body, 60.0, 0.0))
    moved = skin - skin.mean(axis=0) + np.array([0.0, 0.0, depth_m])
    assert free_space_share(wall, moved[None], np.ones(len(skin)))[0] == pytest.approx(free_space, abs=0.02)
